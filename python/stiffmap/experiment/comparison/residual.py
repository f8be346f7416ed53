"""Residual of an experiment against a machine, with noise floor, lack of fit, outliers and checks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import chi2

from stiffmap.common.short import short_repr
from stiffmap.experiment.comparison.limitations import limitations, refuse_unreachable
from stiffmap.experiment.comparison.summary import Summary, summary
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise.checks import Check, checks
from stiffmap.experiment.noise.level import Mask, Noise
from stiffmap.experiment.noise.outliers import without_suspects
from stiffmap.experiment.noise.over_time import over_time
from stiffmap.experiment.noise.whitening import Problem, nuisance_part
from stiffmap.experiment.notebook import residual_html
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.model.description import AppliedEffect
from stiffmap.solve.machine import Machine, takes_machine

if TYPE_CHECKING:
    import pandas as pd


@short_repr
@dataclass(frozen=True, eq=False)
class Residual:
    """Reading minus prediction, SI, base axes; n rows, c channels."""

    experiment: Experiment
    """With the poses that commanded actuator coordinates stand for."""
    prediction: Floats
    """(n, c) with the nuisances of best fit."""
    values: Floats
    """(n, c) NaN where nothing was read."""
    noise: Noise
    set_aside: Mask
    """(n,) rows that contradict their repeats or stand alone; not in `summary` nor `lack_of_fit`."""
    summary: Summary
    lack_of_fit: float
    """p-value of a residual this large if the machine were as its file says; nuisances and shared zeros
    taken into account."""
    nuisances: int
    """How many unknown frames and zeros were fitted."""
    groups_off: int
    """Poses whose residuals alone are beyond noise (p-value below 1e-3 over all poses)."""
    checks: list[Check]
    limitations: list[str]
    """What this experiment cannot determine, in sentences."""

    def _repr_html_(self) -> str:
        return residual_html(self)

    def to_dataframe(self) -> pd.DataFrame:
        """A row per row of the experiment: pose (mm), wrench (N, N·m), and of each channel reading, prediction
        and residual (µm, mrad)."""
        import pandas as pd

        e = self.experiment
        out: dict[str, Any] = {f"{a}, mm": 1e3 * e.position[:, i] for i, a in enumerate("xyz")}
        out |= {f"f{a}, N": e.wrench[:, i] for i, a in enumerate("xyz")}
        for i in np.flatnonzero(e.axis_read):
            c = e.channels[int(i)]
            unit, factor = ("µm", 1e6) if c.unit == "m" else ("mrad", 1e3)
            for what, values in (
                ("reading", e.reading),
                ("prediction", self.prediction),
                ("residual", self.values),
            ):
                out[f"{c.name} {what}, {unit}"] = factor * values[:, i]
        return pd.DataFrame(out, index=pd.Index(e.ids, name="id"))

    def worst(self, number: int = 10) -> list[tuple[str, str, float]]:
        """Rows by their worst reading, most noise floors first: id, channel, residual (m or rad)."""
        z = np.nan_to_num(np.abs(self.values / self.noise.sigma))
        at = [(int(i), int(np.argmax(z[i]))) for i in np.argsort(-z.max(axis=1), kind="stable")[:number]]
        e = self.experiment
        return [(e.ids[i], e.channels[a].name, float(self.values[i, a])) for i, a in at if z[i, a] > 0]

    def as_plain(self, rows: int = 10) -> dict[str, Any]:
        """Data of JSON, SI, with the worst `rows`."""
        e = self.experiment
        return {
            "experiment": e.name,
            "quantity": e.quantity,
            "units": "SI (m, rad), base axes",
            "summary": vars(self.summary),
            "noise_floor": {
                c.name: f for c, f in zip(e.channels, self.noise.floor, strict=True) if c.name in e.axes
            },
            "limitations": self.limitations,
            "lack_of_fit": self.lack_of_fit,
            "nuisances": self.nuisances,
            "poses_off": self.groups_off,
            "set_aside": [e.ids[i] for i in self.set_aside.nonzero()[0]],
            "worst": [{"id": i, "channel": c, "residual": v} for i, c, v in self.worst(rows)],
            "checks": [vars(c) for c in self.checks],
        }


@takes_machine
def residual(
    machine: Machine,
    experiment: Experiment,
    effects: Sequence[AppliedEffect] = (),
    *,
    threads: int | None = None,
) -> Residual:
    """Residual of every reading, with `effects` in the prediction; those of the measurement may be
    among them.

    Raises StiffmapError for unknown points or joints, poses out of reach, and an unknown noise.
    """
    predictor = Predictor(machine, experiment, threads=threads)
    e, base = predictor.experiment, predictor(tuple(effects))
    refuse_unreachable(e, base)
    raw = e.reading - base
    noise, out = without_suspects(e, base)
    problem = Problem.of(e, noise.sigma, base, ~out)
    part = nuisance_part(problem, raw)
    kept = np.where(out[:, None], np.nan, raw - part)
    white = problem.residual(base)
    late = over_time(problem, white)
    return Residual(
        e,
        base + part,
        raw - part,
        noise,
        out,
        summary(kept, noise.sigma, e.channels),
        float(chi2.sf(float(white @ white), max(problem.freedom, 1))),
        int(problem.nuisance.shape[1]),
        _groups_off(problem, white),
        checks(e, e.reading, noise.sigma, ~out),
        [*limitations(e, noise, machine), *([] if late is None else [str(late)])],
    )


def _groups_off(problem: Problem, white: Floats) -> int:
    total, number = np.bincount(problem.groups, white**2), np.bincount(problem.groups)
    p = chi2.sf(total[number > 0], number[number > 0])
    return int((p < 1e-3 / max(len(p), 1)).sum())
