"""A machine under a plan, as effects ask it for their signatures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.poses.configuration import coordinates_of
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.model.description import AppliedEffect

STEP = 10.0  # N


@dataclass(frozen=True, eq=False)
class PlanProbe:
    """Implements `effects.evidence.Probe`."""

    predictor: Predictor
    base: Floats

    @property
    def plan(self) -> Experiment:
        """The experiment."""
        return self.predictor.experiment

    def change(self, term: AppliedEffect) -> Floats:
        """(n, c) m, rad: what another effect adds to every reading."""
        return self.predictor([term]) - self.base

    def coordinate(self, element: str, leg: str) -> Floats:
        """(n,) m, rad: commanded coordinate of a drive from its home."""
        machine = self.predictor.machine
        names = machine.actuators
        mine = [n.split(".")[0] == leg if leg else "." not in n for n in names]
        found = [k for k, n in enumerate(names) if mine[k] and n.split(".")[-1] == element]
        if not found:
            raise StiffmapError(f"{f'{leg}.{element}' if leg else element} is no drive of {machine.name}")
        compiled = machine.compiled
        joint = compiled.names.joints[names[found[0]]]
        return np.asarray(self._coordinates[:, joint] - compiled.home_coordinates()[joint])

    @cached_property
    def _coordinates(self) -> Floats:
        return coordinates_of(self.predictor.machine, self.plan)

    def compliance(self) -> Floats:
        """(n, c, 3) change of every reading per newton along x, y, z at the loaded point.

        Where the machine gives way under a little more, by a little less; NaN where it does under both.
        """
        load = self.plan.wrench
        out = []
        for axis in np.eye(6)[:3]:
            slope = (self.predictor.under(load + STEP * axis) - self.base) / STEP
            if not np.isfinite(slope[np.isfinite(self.base)]).all():
                less = (self.base - self.predictor.under(load - STEP * axis)) / STEP
                slope = np.where(np.isfinite(slope), slope, less)
            out.append(slope)
        return np.stack(out, axis=-1)
