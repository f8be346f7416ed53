"""What derivatives a call asks for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from stiffmap.common.errors import StiffmapError

EffectRequest = tuple[str, Mapping[str, Any]]
Request = EffectRequest | str

INPUTS = {
    "position": ("x", "y", "z"),
    "rotation": ("rx", "ry", "rz"),
    "wrench": ("fx", "fy", "fz", "mx", "my", "mz"),
}
QUANTITIES = ("displacement", "stiffness", "compliance")


@dataclass(frozen=True)
class Requests:
    """Effects whose numbers are varied, inputs of the call that are, and what is differentiated."""

    effects: tuple[EffectRequest, ...]
    inputs: tuple[str, ...]
    of: tuple[str, ...]

    @property
    def whole(self) -> bool:
        """Stiffness or compliance is wanted, so that varied machines are solved in full."""
        return self.of != ("displacement",)

    @property
    def key(self) -> str:
        """Equal for the same machines."""
        return repr((self.whole, [(kind, sorted(a.items())) for kind, a in self.effects]))


def read_requests(given: Sequence[Request], of: Sequence[str]) -> Requests:
    """Checked requests; StiffmapError for one of another form."""
    if isinstance(of, str):
        of = (of,)
    for name in of:
        if name not in QUANTITIES:
            raise StiffmapError(f"derivatives_of: expected some of {', '.join(QUANTITIES)}, got {name!r}")
    effects, inputs = [], []
    for request in given:
        if isinstance(request, str):
            if request not in INPUTS:
                raise StiffmapError(
                    f"derivatives: expected an effect or one of {', '.join(INPUTS)}, got {request!r}"
                )
            inputs.append(request)
        else:
            effects.append(_effect(request))
    return Requests(tuple(effects), tuple(dict.fromkeys(inputs)), tuple(dict.fromkeys(of)))


def _effect(request: Any) -> EffectRequest:
    pair = isinstance(request, (tuple, list)) and len(request) == 2
    if not pair or not isinstance(request[0], str) or not isinstance(request[1], Mapping):
        raise StiffmapError(f"derivatives: expected (kind, {{parameter: value, ...}}), got {request!r}")
    return request[0], dict(request[1])


def parameter_name(request: EffectRequest, parameter: str) -> str:
    """``length bar x error``: kind, element and legs as they were given, parameter."""
    kind, arguments = request
    element = arguments.get("element")
    legs = ",".join(arguments.get("legs") or ())
    return " ".join([kind, *([str(element)] if element else []), *([legs] if legs else []), parameter])
