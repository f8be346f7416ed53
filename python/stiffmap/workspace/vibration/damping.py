"""What a machine file says of damping, and what is assumed where it says nothing (docs/theory.md V2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats, real_array
from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import Cable, Joint, Spring
from stiffmap.model.description.tree import all_elements, core_name
from stiffmap.solve.machine import Machine

ASSUMED = 0.02
"""Damping ratio of every mode of a machine that declares none."""


@dataclass(frozen=True, eq=False)
class Damping:
    """Damping by coordinate, and of the modes."""

    viscous: Floats
    """(coordinates,) N·s/m, N·m·s/rad."""
    loss: Floats
    """(coordinates,) structural loss factor of the spring or law of each."""
    ratios: tuple[float, ...]
    """Of the modes, lowest first, the last for all further ones; empty: none."""
    said: str
    """Where it comes from, in words."""
    assumed: bool = False
    """Whether the machine file declares none."""

    def of_modes(self, count: int) -> Floats:
        """(count,) damping ratios."""
        if not self.ratios:
            return np.zeros(count)
        last = self.ratios[-1]
        return np.array([*self.ratios[:count], *[last] * (count - len(self.ratios))])


def damping_of(machine: Machine, given: ArrayLike | None = None) -> Damping:
    """The machine's own damping, or the modal ratios that are given in place of its modal ratios.

    Raises StiffmapError for ratios below 0, or 1 and above (per cent were meant).
    """
    viscous, loss = coordinate_damping(machine)
    own = machine.description.modal_damping
    parts: list[str] = []
    assumed = given is None and not (own or np.any(viscous) or np.any(loss))
    if np.any(viscous):
        parts.append(f"dampers at {int(np.count_nonzero(viscous))} coordinates")
    if np.any(loss):
        parts.append(f"loss factors at {int(np.count_nonzero(loss))} coordinates")
    if given is not None:
        ratios = _ratios(given)
        parts.insert(0, f"modal ratios {_listed(ratios)}, as given")
    elif own:
        ratios = own
        parts.insert(0, f"modal ratios {_listed(ratios)}, declared")
    elif parts:
        ratios = ()
        parts.append("declared; no modal ratios")
    else:
        ratios = (ASSUMED,)
        parts.append(f"assumed: {100 * ASSUMED:g} % of every mode, since the machine file declares none")
    return Damping(viscous, loss, ratios, "; ".join(parts), assumed)


def coordinate_damping(machine: Machine) -> tuple[Floats, Floats]:
    """(coordinates,) and (coordinates,): viscous damping (N·s/m, N·m·s/rad) and loss factors that are declared."""
    names = machine.compiled.names
    index = {n: i for i, n in enumerate(names.coordinates)}
    viscous, loss = np.zeros(len(index)), np.zeros(len(index))
    for full, e in all_elements(machine.description):
        core = core_name(full)
        if isinstance(e, Spring) and e.loss_factor:
            first = names.springs.get(core)
            if first is not None:
                loss[first : first + 6] = e.loss_factor
        elif isinstance(e, Joint) and not isinstance(e, Cable) and (e.damping or e.loss_factor):
            own = [core] if len(e.axes) == 1 else [f"{core}.{i + 1}" for i in range(len(e.axes))]
            for name in own:
                viscous[index[name]] = e.damping or 0.0
                loss[index[name]] = e.loss_factor or 0.0
    return viscous, loss


def _ratios(given: ArrayLike) -> tuple[float, ...]:
    out = np.atleast_1d(real_array(given, "damping", "damping ratios, 0.02 for 2 %"))
    if out.ndim != 1 or not out.size or not ((out >= 0) & (out < 1)).all():
        raise StiffmapError(
            f"damping: expected one damping ratio or a list of them, from 0 to below 1 (0.02 is 2 %), got {given!r}"
        )
    return tuple(float(v) for v in out)


def _listed(ratios: tuple[float, ...]) -> str:
    return ", ".join(f"{100 * r:.3g} %" for r in ratios)
