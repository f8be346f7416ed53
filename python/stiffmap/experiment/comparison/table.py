"""The residual of every reading as CSV."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from stiffmap.common.outputs import write_rows
from stiffmap.experiment.comparison.residual import Residual

MM = 1e3


def write_table(r: Residual, path: Path) -> None:
    """Columns id, x, y, z, per channel reading, prediction and residual, set_aside; mm and rad.

    Raises `FileError` where it cannot be written.
    """
    columns = _columns(r)
    write_rows(path, list(columns), zip(*columns.values(), strict=True))


def _columns(r: Residual) -> dict[str, list[Any]]:
    e = r.experiment
    out: dict[str, list[Any]] = {"id": list(e.ids)}
    out |= {f"{c}_mm": _text(e.position[:, i] * MM) for i, c in enumerate("xyz")}
    for i, c in enumerate(e.channels):
        if e.axis_read[i]:
            scale, unit = (MM, "mm") if c.unit == "m" else (1.0, "rad")
            out[f"{c.name}_{unit}"] = _text(e.reading[:, i] * scale)
            out[f"{c.name}_predicted_{unit}"] = _text(r.prediction[:, i] * scale)
            out[f"{c.name}_residual_{unit}"] = _text(r.values[:, i] * scale)
    return out | {"set_aside": ["yes" if s else "" for s in r.set_aside]}


def _text(values: Any) -> list[str]:
    return ["" if np.isnan(v) else f"{v:.9g}" for v in values]
