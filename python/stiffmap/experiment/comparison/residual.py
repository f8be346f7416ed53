"""Residual of an experiment against a machine: its size, noise floor, lack of fit, outliers and checks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Mask, whole_number
from stiffmap.common.json_text import plain
from stiffmap.common.number_text import length_text
from stiffmap.common.outputs import number_cells, write_rows
from stiffmap.common.short import short_repr, table, titled
from stiffmap.experiment.channels import AXIS_CHANNELS, Channel, metres
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise.checks import Check
from stiffmap.experiment.noise.level import Noise, rms

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Summary:
    """Of single readings of lengths, m (angles apart, rad)."""

    rms: float
    p95: float
    max: float
    per_axis: dict[str, float]
    """rms of each axis, m or rad."""
    n: int
    """Number of readings (linear and angular)."""
    ratio: float
    """rms over the noise floor, linear and angular readings together."""
    rotation_rms: float | None = None

    @property
    def size(self) -> tuple[float, str]:
        """rms in m of the lengths, or in rad where only angles are read; and that unit."""
        if self.rotation_rms is not None and not np.isfinite(self.rms):
            return self.rotation_rms, "rad"
        return self.rms, "m"


def summary(residual: Floats, sigma: Floats, channels: tuple[Channel, ...] = AXIS_CHANNELS) -> Summary:
    """Summary of residuals (n, c), NaN where nothing was read."""
    linear, angular = residual[:, metres(channels)], residual[:, ~metres(channels)]
    size = np.abs(linear[np.isfinite(linear)])
    if not size.size:
        size = np.array([np.nan])
    read = [i for i in range(len(channels)) if np.isfinite(residual[:, i]).any()]
    per_axis = {channels[i].name: rms(residual[:, i]) for i in read}
    return Summary(
        rms=rms(linear),
        p95=float(np.percentile(size, 95)),
        max=float(size.max()),
        per_axis=per_axis,
        n=int(np.isfinite(residual).sum()),
        ratio=rms(residual / sigma),
        rotation_rms=rms(angular) if np.isfinite(angular).any() else None,
    )


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
    taken into account. NaN where they are as many as the readings."""
    nuisances: int
    """How many unknown frames and zeros were fitted."""
    groups_off: int
    """Poses whose residuals alone are beyond noise (p-value below 1e-3 over all poses)."""
    checks: list[Check]
    limitations: list[str]
    """What this experiment cannot determine, in sentences."""

    def _repr_html_(self) -> str:
        long = {c.name for c in self.experiment.channels if c.unit == "m"}

        def text(name: str, value: float) -> str:
            return length_text(value) if name in long else f"{1e3 * value:.3g} mrad"

        rows = [(a, text(a, v)) for a, v in self.summary.per_axis.items()]
        worst = [(i, a, text(a, v)) for i, a, v in self.worst(20)]
        head = f"{self.experiment.name}: rms {length_text(self.summary.rms)}, p = {self.lack_of_fit:.2g}"
        return titled(head, table(("axis", "rms"), rows), table(("worst row", "axis", "residual"), worst))

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
        whole_number(number, "number", 0)
        z = self.values / self.noise.sigma
        np.nan_to_num(np.abs(z, out=z), copy=False)
        at = [(int(i), int(np.argmax(z[i]))) for i in np.argsort(-z.max(axis=1), kind="stable")[:number]]
        e = self.experiment
        return [(e.ids[i], e.channels[a].name, float(self.values[i, a])) for i, a in at if z[i, a] > 0]

    def as_plain(self, rows: int = 10) -> dict[str, Any]:
        """Data of JSON, SI, with the worst `rows`."""
        e = self.experiment
        data = {
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
        return dict(plain(data))

    def lines(self, rows: int = 10) -> list[str]:
        """The residual in words, with the worst `rows`."""
        s, e = self.summary, self.experiment
        lengths = {c.name: c.unit == "m" for c in e.channels}
        floor = {c.name: float(v) for c, v in zip(e.channels, self.noise.floor, strict=True)}

        def shown(name: str, value: float) -> str:
            return _mm(value) if lengths[name] else _mrad(value)

        aside = [e.ids[i] for i in self.set_aside.nonzero()[0]]
        out = [f"{e.name}: {s.n} readings of {e.quantity} in {len(e)} rows; reading minus prediction"]
        if np.isfinite(s.rms):
            out.append(f"  all lengths: rms {_mm(s.rms)}, 95 % {_mm(s.p95)}, largest {_mm(s.max)}")
        if s.rotation_rms is not None:
            out.append(f"  all angles: rms {_mrad(s.rotation_rms)}")
        out += [f"  found: {name} {_pose(turn, shift)}" for name, turn, shift in e.registration]
        out += [f"  {a}: rms {shown(a, v)}, noise {shown(a, floor[a])}" for a, v in s.per_axis.items()]
        out.append(f"  rms / noise {s.ratio:.2f}; p-value of this residual {_p_value(self.lack_of_fit)}")
        out += [f"  unknown frames and zeros fitted: {self.nuisances}"] if self.nuisances else []
        out.append(f"  poses beyond noise: {self.groups_off} of {int(e.groups.max()) + 1}")
        out.append(f"  outliers (rows): {', '.join(aside) or 'none'}")
        for c in self.checks:
            told = f"rms/noise {c.rms:.2f}, p = {_p_value(c.p)}" if c.contrasts else c.note
            out.append(f"  {c.name} ({c.meaning}): {told}")
        worst = [f"{i} ({a} {shown(a, v)})" for i, a, v in self.worst(rows)]
        out.append(f"  worst rows: {', '.join(worst) or 'none'}")
        return out + [f"  limit: {text}" for text in self.limitations]


def _pose(turn: Floats, shift: Floats) -> str:
    """Where an instrument stands or a target sits."""
    angles = np.degrees(Rotation.from_matrix(turn).as_rotvec())
    at = ", ".join(f"{1e3 * v:.3f}" for v in shift)
    return f"at ({at}) mm, rotation vector ({', '.join(f'{a:.4f}' for a in angles)}) deg"


def _p_value(p: float) -> str:
    if np.isnan(p):
        return "unknown: as many unknowns as readings, so that nothing is left to contradict the machine"
    return f"{p:.2g}" if p > 1e-99 else "below 1e-99"


def _mm(value: float) -> str:
    return f"{1e3 * value:.4f} mm"


def _mrad(value: float) -> str:
    return f"{1e3 * value:.4f} mrad"
