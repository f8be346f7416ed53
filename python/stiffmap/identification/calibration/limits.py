"""Sizes that no number of an assembled machine has: what asks for them imitates something else.

Each rule is a function of an unknown and the value that the readings would give it; its answer is a reason, empty where
there is none. `refused` asks them all.
"""

from __future__ import annotations

from collections.abc import Callable

from stiffmap.identification.calibration.unknowns import Unknown

FREE = 100.0
"""Times the standard uncertainty; what goes further is no number of this machine."""
HEAVIEST = 3.0
"""Factor on a declared mass, up or down: a scale tells a mass, and who declared it had a drawing or a data sheet."""
SOFTEST = 30.0
"""Factor on a declared compliance, up or down."""

Rule = Callable[[Unknown, float, float], str]


def beyond_all_tolerances(unknown: Unknown, value: float, times: float) -> str:
    """More than `FREE` standard uncertainties."""
    return f"{abs(value):.0f} standard uncertainties are no tolerance" if abs(value) > FREE else ""


def no_such_mass(unknown: Unknown, value: float, times: float) -> str:
    """A mass more than `HEAVIEST` times what is declared, or less than that part of it."""
    absurd = unknown.group == "masses" and not 1.0 / HEAVIEST <= times <= HEAVIEST
    return f"no mass is {times:.3g} times what is declared" if absurd else ""


def no_such_compliance(unknown: Unknown, value: float, times: float) -> str:
    """A compliance more than `SOFTEST` times what is declared, or less than that part of it."""
    factor = unknown.unit == "ln" and unknown.group != "masses"
    absurd = factor and not 1.0 / SOFTEST <= times <= SOFTEST
    return f"no part yields {times:.3g} times what is declared" if absurd else ""


RULES: tuple[Rule, ...] = (beyond_all_tolerances, no_such_mass, no_such_compliance)


def refused(unknown: Unknown, value: float, times: float = 1.0) -> str:
    """Why an unknown is not `value` standard uncertainties off, or `times` what is declared; empty: it may be."""
    return next((why for rule in RULES if (why := rule(unknown, value, times))), "")
