"""Writing an experiment as experiment.yaml and data.csv (mm, N, rad)."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.errors import FileError
from stiffmap.experiment.columns import APPROACH, POSE, POSE2
from stiffmap.experiment.experiment import AXES, WRENCH, Channel, Experiment, Floats, Loop
from stiffmap.experiment.orientation import VECTOR
from stiffmap.files.yaml_text import text_of

MM = 1e3
PLAIN = {"unloaded": "centre", "frame": "known", "tool": "known"}


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
    head: dict[str, Any] = {"title": title or e.title, "machine": e.machine, "quantity": e.quantity}
    head |= {"point": e.point} | ({"load_point": e.load_point} if e.load_point != e.point else {})
    head |= {"units": {"length": "mm", "force": "N", "angle": "rad"}}
    head |= _noise(e) | _own_columns(e)
    optional = {
        "gravity": None if e.gravity is None else list(e.gravity),
        "reference_temperature": e.reference_temperature,
    }
    head |= {k: v for k, v in optional.items() if v is not None}
    head |= {k: getattr(e, k) for k, plain in PLAIN.items() if getattr(e, k) != plain}
    if e.rotation is not None and e.rotation_against == "base" and e.command is None:
        head["orientation"] = {"against": "base"}
    if e.loop != Loop():
        head["metrology"] = {k: getattr(e.loop, k) for k in ("instrument_on", "target_on", "force_against")}
    return head


def _noise(e: Experiment) -> dict[str, Any]:
    """Declared noise; one that differs from row to row is a column instead."""
    common = {
        c.name: float(f"{e.sigma[e.read[:, i], i][0] * _scale(c):.6g}")
        for i, c in enumerate(e.channels)
        if not c.joint and e.axis_read[i] and _alike(e, i)
    }
    zero = {
        a: float(f"{s * _scale(c):.6g}") for a, c, s in zip(AXES, e.channels, e.zero_sigma, strict=False) if s
    }
    return ({"noise": common} if common else {}) | ({"zero_noise": zero} if zero else {})


def _alike(e: Experiment, i: int) -> bool:
    s = e.sigma[e.read[:, i], i]
    return bool(np.isfinite(s).all() and np.ptp(s) == 0 and s[0] > 0)


def _own_columns(e: Experiment) -> dict[str, Any]:
    """What an encoder reads and what actuators are commanded by."""
    joints: dict[str, Any] = {}
    for i, c in enumerate(e.channels):
        if c.joint:
            joints[c.name] = {"joint": c.joint, "unit": _unit(c), "side": c.side}
            if _alike(e, i):
                joints[c.name]["noise"] = float(f"{e.sigma[e.read[:, i], i][0] * _scale(c):.6g}")
    command = {c.name: {"actuator": c.joint, "unit": _unit(c)} for c in e.command_of}
    return ({"joints": joints} if joints else {}) | ({"command": command} if command else {})


def _unit(c: Channel) -> str:
    return "mm" if c.unit == "m" else "rad"


def _scale(c: Channel) -> float:
    return MM if c.unit == "m" else 1.0


def _columns(e: Experiment) -> dict[str, list[Any]]:
    columns: dict[str, list[Any]] = {"id": list(e.ids)}
    columns |= _commanded(e) | _loads(e)
    for i, c in enumerate(e.channels):
        if e.axis_read[i]:
            columns[c.name] = _text(e.reading[:, i] * _scale(c))
            if not _alike(e, i) and np.isfinite(e.sigma[:, i]).any():
                columns[f"u_{c.name}"] = _text(e.sigma[:, i] * _scale(c))
    for name, values in (("repeat", e.repeat), ("order", e.order), ("temperature", e.temperature)):
        if values is not None:
            columns[name] = _text(np.asarray(values, dtype=float))
    words = (("branch", e.branch), ("setup", e.setup), ("point", e.points), ("load_point", e.load_points))
    return columns | {n: list(v) for n, v in words if v}


def _commanded(e: Experiment) -> dict[str, list[Any]]:
    if e.command is not None:
        out = {c.name: _text(e.command[:, i] * _scale(c)) for i, c in enumerate(e.command_of)}
    else:
        out = {c: _text(e.position[:, i] * MM) for i, c in enumerate(POSE)} | _rotvec(e.rotation, VECTOR)
    if e.other is not None:
        out |= {c: _text(e.other[:, i] * MM) for i, c in enumerate(POSE2)}
        out |= _rotvec(e.other_rotation, [f"{c}2" for c in VECTOR])
    if e.approach is not None:
        out |= {c: _text(e.approach[:, i]) for i, c in enumerate(APPROACH)}
    return out


def _rotvec(rotation: Floats | None, names: Sequence[str]) -> dict[str, list[Any]]:
    if rotation is None:
        return {}
    vectors = Rotation.from_matrix(rotation).as_rotvec()
    return {c: _text(vectors[:, i]) for i, c in enumerate(names)}


def _loads(e: Experiment) -> dict[str, list[Any]]:
    units = [1.0] * 3 + [MM] * 3
    used = [i for i in range(6) if e.wrench[:, i].any() or (i < 3 and e.quantity == "deflection")]
    return {WRENCH[i]: _text(e.wrench[:, i] * units[i]) for i in used}


def _text(values: Any) -> list[str]:
    return ["" if np.isnan(v) else f"{v:.9g}" for v in values]
