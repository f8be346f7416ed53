"""Numbers and choices of an effect."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property


@dataclass(frozen=True)
class Parameter:
    """One number of an effect, in SI.

    ``null`` is the value at which the effect vanishes (``None``: there is no fixed one), ``scale`` a
    typical size for steps and plots, ``default`` the value of a parameter that is left out (``None``:
    it must be given). A parameter that is not ``fitted`` says how the effect is meant (a pivot, a
    recorded temperature) and is known beforehand. ``angular`` is the unit on a joint that turns, with an upper
    bound and a typical size of its own where those of a length mean nothing.
    """

    name: str
    unit: str
    lower: float
    upper: float
    null: float | None
    scale: float
    doc: str
    default: float | None = None
    fitted: bool = True
    angular: str = ""
    angular_upper: float | None = None
    angular_scale: float | None = None
    plausible: tuple[float, float] | None = None
    recorded: str = ""

    @cached_property
    def turning(self) -> Parameter:
        """The parameter on a joint that turns."""
        return replace(
            self,
            unit=self.angular or self.unit,
            upper=self.angular_upper or self.upper,
            scale=self.angular_scale or self.scale,
        )


@dataclass(frozen=True)
class Option:
    """A choice in words; the first one is the default. ``recorded``: an experiment says it row by row."""

    name: str
    choices: tuple[str, ...]
    doc: str
    recorded: bool = False
