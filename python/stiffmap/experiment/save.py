"""Writing an experiment as experiment.yaml and data.csv (mm, N, rad)."""

from __future__ import annotations

import csv
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.errors import FileError
from stiffmap.experiment.experiment import AXES, WRENCH, Experiment
from stiffmap.files.yaml_text import text_of

MM = 1e3


def save_experiment(experiment: Experiment, folder: str | PathLike[str], title: str = "") -> None:
    """Write the folder; raises `FileError` where it cannot be written."""
    place = Path(folder)
    try:
        place.mkdir(parents=True, exist_ok=True)
        (place / "experiment.yaml").write_text(text_of(_head(experiment, title)), encoding="utf-8")
        with (place / "data.csv").open("w", newline="", encoding="utf-8") as stream:
            columns = _columns(experiment)
            writer = csv.writer(stream)
            writer.writerow(columns)
            writer.writerows(zip(*columns.values(), strict=True))
    except OSError as error:
        raise FileError(f"cannot be written: {error.strerror}", file=str(place)) from error


def _head(e: Experiment, title: str) -> dict[str, Any]:
    head: dict[str, Any] = {
        "title": title or e.title,
        "machine": e.machine,
        "quantity": e.quantity,
        "point": e.point,
    }
    head |= {"load_point": e.load_point} if e.load_point != e.point else {}
    head |= {"units": {"length": "mm", "force": "N", "angle": "rad"}}
    declared = np.sqrt(np.nanmean(e.sigma[:, e.axis_read] ** 2, axis=0)) * _scale(e)
    head["noise"] = {a: float(f"{s:.6g}") for a, s in zip(e.axes, declared, strict=True) if s > 0}
    if e.gravity is not None:
        head["gravity"] = list(e.gravity)
    if e.reference_temperature is not None:
        head["reference_temperature"] = e.reference_temperature
    head |= {k: v for k, v in (("unloaded", e.unloaded), ("frame", e.frame)) if v not in ("centre", "known")}
    return head


def _scale(e: Experiment) -> Any:
    return np.array([MM if a in AXES[:3] else 1.0 for a in e.axes])


def _columns(e: Experiment) -> dict[str, list[Any]]:
    columns: dict[str, list[Any]] = {"id": list(e.ids)}
    columns |= {c: _text(e.position[:, i] * MM) for i, c in enumerate("xyz")}
    if e.rotation is not None:
        vectors = Rotation.from_matrix(e.rotation).as_rotvec()
        columns |= {c: _text(vectors[:, i]) for i, c in enumerate(("rotx", "roty", "rotz"))}
    units = [1.0] * 3 + [MM] * 3
    columns |= {
        c: _text(e.wrench[:, i] * units[i]) for i, c in enumerate(WRENCH) if e.wrench[:, i].any() or i < 3
    }
    columns |= {a: _text(e.reading[:, AXES.index(a)] * s) for a, s in zip(e.axes, _scale(e), strict=True)}
    for name, values in (("repeat", e.repeat), ("order", e.order), ("temperature", e.temperature)):
        if values is not None:
            columns[name] = _text(np.asarray(values, dtype=float))
    columns |= {n: list(v) for n, v in (("branch", e.branch), ("setup", e.setup)) if v}
    return columns


def _text(values: Any) -> list[str]:
    return ["" if np.isnan(v) else f"{v:.9g}" for v in values]
