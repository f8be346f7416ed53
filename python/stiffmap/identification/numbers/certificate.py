"""Standard uncertainties of what a machine file and a certificate declare, where they say nothing else, and the instrument's own
figures: its scale, and a frame that is known but for an uncertainty."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from stiffmap.common.arguments import checked
from stiffmap.common.broadcasting import real_number, refused
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise.nuisance import nuisance_columns
from stiffmap.experiment.setups import setups_of
from stiffmap.model.description import AppliedEffect, MachineDescription
from stiffmap.model.effects import get, kinds

INSTRUMENT = "instrument"
SCALE = "scale"


@dataclass(frozen=True)
class Tolerances:
    """One standard uncertainty per class of number, SI. Machine files override single ones with ``u``.

    position, direction
        Place of a joint's axis across itself; its direction (m, rad).
    length, mismatch
        Of a link between two passive joints; difference of links that should be alike (m).
    zero, turning_zero
        Of a sliding and a turning drive (m, rad).
    gain
        Scale of a drive's coordinate (1).
    compliance, mass
        Relative.
    sag
        Of a drive of an arm whose file has no weights: rad per m by which the tool rises with it.
    instrument
        Scale of the instrument that reads positions: a laser tracker's certificate says 1e-5.
    tool
        The point that is read, in the tool's axes (m).
    frame, frame_direction
        Place and turn of an instrument's frame that the experiment calls known (m, rad); 0: exact. StiffmapError below 0.
    """

    position: float = 2e-4
    direction: float = 1e-3
    length: float = 2e-4
    mismatch: float = 2e-4
    zero: float = 2e-4
    turning_zero: float = 1e-3
    gain: float = 2e-4
    compliance: float = 0.2
    mass: float = 0.05
    sag: float = 1e-4
    instrument: float = 1e-5
    tool: float = 5e-4
    frame: float = 0.0
    frame_direction: float = 0.0

    def __post_init__(self) -> None:
        for name, u in vars(self).items():
            if not 0.0 <= real_number(u, name) < np.inf:
                raise refused(name, "a standard uncertainty, 0 or more", str(u))

    def scaled(self, factor: float) -> Tolerances:
        """All but the instrument's own, times a factor; StiffmapError for one below 0."""
        own, by = ("instrument", "frame", "frame_direction"), real_number(factor, "factor")
        return replace(self, **{name: u * by for name, u in vars(self).items() if name not in own})


@checked
def certified(tolerances: Tolerances | None, experiment: Experiment) -> Tolerances:
    """The tolerances with what the experiment's certificate says in place of the instrument's."""
    t = tolerances or Tolerances()
    named = {"scale": "instrument", "tool": "tool", "frame": "frame", "frame_direction": "frame_direction"}
    return replace(t, **{named[k]: v for k, v in experiment.certificate})


def scaled(description: MachineDescription, share: float) -> AppliedEffect:
    """The effect of an instrument whose scale is off by this share."""
    effect = next(e for e in map(get, kinds()) if e.instrument_scale)
    element, legs = effect.places(description)[0]
    off = float(effect.parameter(effect.instrument_scale).null or 0.0) + share
    return AppliedEffect(effect.kind, element, legs, ((effect.instrument_scale, off),))


def frame_errors(experiment: Experiment) -> Iterator[tuple[str, str, int]]:
    """Name and unit of what may be off of each set-up's frame, and the column of an unknown frame that shows it."""
    position, known = experiment.quantity == "position", experiment.frame == "known"
    read = [
        c
        for c, shown in zip(experiment.channels, experiment.axis_read[:6], strict=False)
        if position and shown
    ]
    number = 0 if experiment.frame == "unknown" else len(np.unique(setups_of(experiment)[0]))
    for k in range(number):
        which = f" of set-up {k + 1}" if number > 1 else ""
        begin = k * (len(read) + 3)
        for i, c in enumerate(read if known else ()):
            if c.unit == "m":
                yield f"{c.name}{which}", c.unit, begin + i
        yield from ((f"about {a}{which}", "rad", begin + len(read) + i) for i, a in enumerate("xyz"))


def frame_columns(experiment: Experiment, base: Floats) -> Mapping[str, Floats]:
    """(n, c) change of the readings per metre or radian of each of `frame_errors`."""
    whole = replace(experiment, frame="unknown", tool="known", unloaded="centre", surface="known")
    columns = nuisance_columns(whole, base)
    return {name: columns[..., i] for name, _, i in frame_errors(experiment)}
