"""Residual of an experiment against a machine, with noise floor, lack of fit, outliers and checks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from stiffmap.common.outputs import number_cells, write_rows
from stiffmap.common.short import short_repr
from stiffmap.experiment.comparison.summary import Summary
from stiffmap.experiment.experiment import Experiment, Floats, Mask
from stiffmap.experiment.noise.checks import Check
from stiffmap.experiment.noise.level import Noise
from stiffmap.experiment.notebook import residual_html

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
        for channel, what, unit, values in self._of_channels(("µm", 1e6), ("mrad", 1e3)):
            out[f"{channel} {what}, {unit}"] = values
        return pd.DataFrame(out, index=pd.Index(e.ids, name="id"))

    def write_table(self, path: Path) -> None:
        """CSV of id, x, y, z, of each channel reading, prediction and residual, and set_aside; mm and rad.

        Raises `FileError` where it cannot be written.
        """
        e = self.experiment
        out: dict[str, list[Any]] = {"id": list(e.ids)}
        out |= {f"{c}_mm": number_cells(1e3 * e.position[:, i]) for i, c in enumerate("xyz")}
        names = {"reading": "", "prediction": "_predicted", "residual": "_residual"}
        for channel, what, unit, values in self._of_channels(("mm", 1e3), ("rad", 1.0)):
            out[f"{channel}{names[what]}_{unit}"] = number_cells(values)
        out["set_aside"] = ["yes" if s else "" for s in self.set_aside]
        write_rows(path, list(out), zip(*out.values(), strict=True))

    def _of_channels(
        self, lengths: tuple[str, float], angles: tuple[str, float]
    ) -> Iterator[tuple[str, str, str, Floats]]:
        """Channel that was read, what of it, unit and values (n,), in these units of lengths and angles (name, and how many are 1 in SI)."""
        e = self.experiment
        parts = {"reading": e.reading, "prediction": self.prediction, "residual": self.values}
        for i in np.flatnonzero(e.axis_read):
            c = e.channels[int(i)]
            unit, factor = lengths if c.unit == "m" else angles
            yield from ((c.name, what, unit, factor * values[:, i]) for what, values in parts.items())

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
