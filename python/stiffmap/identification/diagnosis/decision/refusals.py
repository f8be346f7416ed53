"""Values with which an effect is never named, whatever it explains: one rule, one function.

Each looks at one effect of a fitted model and answers with a reason, empty where it has nothing to say. `why_not` asks them
all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from stiffmap.identification.calibration import Tolerances
from stiffmap.identification.calibration.limits import HEAVIEST, SOFTEST
from stiffmap.identification.diagnosis.fitting.interval import unseen
from stiffmap.identification.diagnosis.fitting.model import Model
from stiffmap.model.effects import EffectType, Parameter, get

BEYOND = 100.0
"""Standard uncertainties of its certificate that an instrument is never taken to be off by."""
AT_BOUND, AT_SCALE = 1e-6, 1e-3
"""Share of a shape's range, and of its typical size, within which it is at its bound."""
NEAR_BOUND = 0.01
"""Share of the way from a parameter's null to its bound that still counts as the bound."""
TURNED, MOVED = 0.05, 0.05
"""rad, m: no assembled machine is off by so much."""


@dataclass(frozen=True, eq=False)
class Claimed:
    """One effect of a model, as fitted."""

    model: Model
    number: int
    tolerances: Tolerances

    @property
    def effect(self) -> EffectType:
        """Its kind."""
        return get(self.model.candidates[self.number].kind)

    @property
    def values(self) -> list[tuple[int, Parameter, float]]:
        """Number among all values of the model, parameter, and value in SI, of those that the fit could move."""
        part = self.model.parts()[self.number]
        named = zip(range(part.start, part.stop), self.model.candidates[self.number].parameters, strict=True)
        return [(i, p, float(self.model.si[i])) for i, p in named if i not in self.model.held]


Rule = Callable[[Claimed], str]


def at_its_bound(c: Claimed) -> str:
    """A value where the search ends: the readings ask for something that it cannot have."""
    for _, p, v in c.values:
        as_left_out = p.null is None and p.default is not None and v <= p.default
        if not as_left_out and any(_near(p, v, bound) for bound in (p.lower, p.upper)):
            return f"{p.name} is at its bound"
    return ""


def _near(p: Parameter, value: float, bound: float) -> bool:
    if bound == p.null or not np.isfinite(bound):
        return False
    if p.null is None:
        return abs(value - bound) < min(AT_BOUND * (p.upper - p.lower), AT_SCALE * p.scale)
    return abs(value - bound) <= NEAR_BOUND * abs(bound - p.null)


def not_determined(c: Claimed) -> str:
    """An interval that is the whole range of the parameter, of all that the effect has; or of its size."""
    blind = [p.name for i, p, _ in c.values if unseen(c.model, i)]
    if blind and len(blind) == len(c.values):
        return f"the readings do not determine {blind[0]}"
    sizes = [(i, p) for i, p, _ in c.values if p.null is not None]
    if sizes and all(unseen(c.model, i) for i, _ in sizes):
        return f"the readings do not determine {sizes[0][1].name}"
    return ""


def no_such_turn(c: Claimed) -> str:
    """An angle of a part that nobody would have assembled so."""
    for _, p, v in c.values:
        if (
            p.unit == "rad"
            and p.null == 0.0
            and p.name.startswith("angle")
            and abs(v) > TURNED
            and not _free(c)
        ):
            return f"no assembled part is turned by {1e3 * v:.3g} mrad"
    return ""


def no_such_place(c: Claimed) -> str:
    """A place or length that nobody would have assembled so."""
    for _, p, v in c.values:
        if p.unit == "m" and p.null == 0.0 and abs(v) > MOVED and not _free(c):
            return f"no assembled part is {1e3 * v:.3g} mm off"
    return ""


def _free(c: Claimed) -> bool:
    """Whether nobody has placed what the effect moves with care: a frame, a tool, a payload's centre."""
    return c.effect.kind in ("frame_offset", "tcp_offset", "payload", "external_spring", "cable_anchor")


def no_such_compliance(c: Claimed) -> str:
    """A part that is almost rigid, or a hundred times softer, though someone declared it."""
    for _, p, v in c.values:
        if c.effect.kind == "compliance" and p.name == "scale" and not 1.0 / SOFTEST <= v <= 100.0:
            return f"no part yields {v:.3g} times what is declared"
    return ""


def no_such_weight(c: Claimed) -> str:
    """Masses many times what is declared, or that pull upwards."""
    for _, p, v in c.values:
        if c.effect.kind == "gravity" and p.name == "scale" and not 1.0 / HEAVIEST <= v <= HEAVIEST:
            return f"no masses are {v:.3g} times what is declared"
    return ""


def beyond_its_certificate(c: Claimed) -> str:
    """An instrument that is off by more than a hundred times what its certificate allows."""
    if not c.effect.certified:
        return ""
    off = max((abs(v - (p.null or 0.0)) for _, p, v in c.values), default=0.0)
    most = c.tolerances.instrument
    beyond = off > BEYOND * most
    return f"{off:.2g} is beyond the instrument's certificate ({most:.2g}) a hundred times" if beyond else ""


RULES: tuple[Rule, ...] = (
    at_its_bound, not_determined, no_such_turn, no_such_place, no_such_compliance, no_such_weight, beyond_its_certificate,
)  # fmt: skip
EVERYWHERE: tuple[Rule, ...] = RULES[:-1]
"""Those that hold where no calibration lies below as well: a certificate is one of its numbers."""


def why_not(model: Model, number: int, tolerances: Tolerances, rules: tuple[Rule, ...] = RULES) -> str:
    """Why an effect of a model is never named; empty: it may be."""
    claimed = Claimed(model, number, tolerances)
    return next((why for rule in rules if (why := rule(claimed))), "")
