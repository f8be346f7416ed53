"""What a kind of reading is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from stiffmap.experiment.channels import Channel
from stiffmap.experiment.experiment import Experiment, Floats


@dataclass(frozen=True, eq=False)
class Seen:
    """The point that is read, at one commanded pose of each of n rows; SI, base axes."""

    plan: Experiment
    motion: Floats
    """(n, 6) m, rad: from where it is commanded to where it is, linear part first; NaN where the pose fails."""
    position: Floats
    """(n, 3) m, where it is commanded."""


@dataclass(frozen=True, eq=False)
class ReadingKind:
    """One column of readings that follows from the motion of the point that is read.

    name, unit
        The column of data.csv and its unit in SI, ``m`` or ``rad``; its noise goes by the same name.
    change
        (n,) the reading, measured minus commanded: from the motion at a pose and, where `pair`, at a second one.
    pair
        Whether it is taken between two commanded poses.
    quantities
        Of experiments that may have it; the reading of a deflection is the loaded less the unloaded one.
    absolute, commanded
        Column that gives the same reading in coordinates of its own, and (n,) what the command stands for in it.
    found
        Where instruments stand and targets sit, as in `Experiment.registration`, from the absolute readings (n,) of best fit.
    positive
        Whether an absolute reading is above zero.
    nuisance
        (n,) changes of the reading by what nobody knows, as a surface's height, where the machine stands; fitted and taken out.
    tool_offset
        (n,) change of the reading per length of an offset of the target along axis k of the tool, (n, 3) in base axes.
    """

    name: str
    unit: str
    title: str
    change: Callable[[Seen, Seen | None], Floats]
    pair: bool = False
    quantities: tuple[str, ...] = ("deflection", "position")
    absolute: str = ""
    commanded: Callable[[Experiment], Floats] | None = None
    found: Callable[[Experiment, Floats], tuple[tuple[str, Floats, Floats], ...]] | None = None
    positive: bool = False
    nuisance: Callable[[Experiment], Iterator[Floats]] | None = None
    tool_offset: Callable[[Experiment, Floats, int], Floats] | None = None

    @property
    def channel(self) -> Channel:
        """Its column of `Experiment.reading`."""
        return Channel(self.name, self.unit)
