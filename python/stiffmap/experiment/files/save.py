"""Writing an experiment as experiment.yaml and data.csv (mm, N, rad)."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.arguments import checked
from stiffmap.common.outputs import make_folder, number_cells, putting, write_rows, write_text
from stiffmap.common.yaml_text import text_of
from stiffmap.experiment.experiment import ASKED, AXES, WRENCH, Channel, Experiment, Floats, Loop
from stiffmap.experiment.files import fields
from stiffmap.experiment.readings import kinds
from stiffmap.experiment.setups import SEEN as SEEN_TARGET

MM = 1e3
PLAIN = {"unloaded": "centre", "frame": "known", "tool": "known"}


@checked
def save_experiment(experiment: Experiment, folder: str | PathLike[str], title: str = "") -> None:
    """Write the folder; raises `FileError` where it cannot be written."""
    columns = _columns(experiment)
    head = _head(experiment, title) | {"rows": len(experiment)}
    with putting(make_folder(folder), "experiment.yaml") as fresh:
        write_rows(fresh / "data.csv", list(columns), zip(*columns.values(), strict=True))
        write_text(fresh / "experiment.yaml", text_of(head))


def _head(e: Experiment, title: str) -> dict[str, object]:
    head: dict[str, Any] = {"title": title or e.title, "machine": e.machine, "quantity": e.quantity}
    head |= {"point": e.point} | ({"load_point": e.load_point} if e.load_point != e.point else {})
    head |= {"units": {"length": "mm", "force": "N", "angle": "rad"}}
    head |= _noise(e) | _own_columns(e)
    told = dict(e.record)
    head |= {"notes": told.pop("notes")} if "notes" in told else {}
    head |= {"record": told} if told else {}
    optional = {"gravity": _gravity(e), "reference_temperature": e.reference_temperature}
    head |= {k: v for k, v in optional.items() if v is not None}
    head |= {k: getattr(e, k) for k, plain in PLAIN.items() if getattr(e, k) != plain}
    if e.rotation is not None and e.rotation_against == "base" and e.command is None:
        head["orientation"] = {"against": "base"}
    if (e.normal, e.surface) != ((0.0, 0.0, 1.0), "known"):
        head["surface"] = {"normal": list(e.normal), "shape": e.surface}
    if e.anchor is not None:
        head["anchor"] = [_short(MM * v, 9) for v in e.anchor]
    if e.certificate:
        head["certificate"] = {
            k: _short(v * (MM if k in ("frame", "tool") else 1.0)) for k, v in e.certificate
        }
    if e.loop != Loop():
        head["metrology"] = vars(e.loop).copy()
    return head


def _gravity(e: Experiment) -> object:
    """Of all rows, or of each set-up."""
    if e.gravity_of is None:
        return None if e.gravity is None else list(e.gravity)
    return {s: [float(v) for v in g] for s, g in zip(e.setup, e.gravity_of, strict=True)}


def _noise(e: Experiment) -> dict[str, Any]:
    """Declared noise; one that differs from row to row is a column instead."""
    each = {c.name: _declared(e, i) for i, c in enumerate(e.channels) if not c.joint}
    common = {name: size for name, size in each.items() if size is not None}
    zero = {c.name: _short(s * _scale(c)) for c, s in zip(e.channels, e.zero_sigma, strict=False) if s}
    return ({"noise": common} if common else {}) | ({"zero_noise": zero} if zero else {})


def _declared(e: Experiment, i: int) -> float | None:
    """The standard deviation of a channel in the unit of the file, where all that was read has the same."""
    s = e.sigma[e.read[:, i], i]
    alike = s.size and np.isfinite(s).all() and np.ptp(s) == 0 and s[0] > 0
    return _short(s[0] * _scale(e.channels[i])) if alike else None


def _short(value: float, digits: int = 6) -> float:
    return float(f"{value:.{digits}g}")


def _own_columns(e: Experiment) -> dict[str, Any]:
    """What an encoder reads and what actuators are commanded by."""
    joints: dict[str, Any] = {}
    for i, c in enumerate(e.channels):
        if c.joint:
            noise = _declared(e, i)
            joints[c.name] = {"joint": c.joint, "unit": _unit(c), "side": c.side}
            joints[c.name] |= {} if noise is None else {"noise": noise}
    command = {c.name: {"actuator": c.joint, "unit": _unit(c)} for c in e.command_of}
    return ({"joints": joints} if joints else {}) | ({"command": command} if command else {})


def _unit(c: Channel) -> str:
    return "mm" if c.unit == "m" else "rad"


def _scale(c: Channel) -> float:
    return MM if c.unit == "m" else 1.0


def _columns(e: Experiment) -> dict[str, list[Any]]:
    columns: dict[str, list[Any]] = {"id": list(e.ids)}
    columns |= _commanded(e) | _loads(e)
    absolute, told = _absolute(e)
    columns |= absolute
    for i, c in enumerate(e.channels):
        if e.axis_read[i] and c.name not in told:
            columns[c.name] = number_cells(e.reading[:, i] * _scale(c))
            if _declared(e, i) is None and np.isfinite(e.sigma[:, i]).any():
                columns[f"u_{c.name}"] = number_cells(e.sigma[:, i] * _scale(c))
    for name in fields.COUNTED:
        if getattr(e, name) is not None:
            columns[name] = number_cells(np.asarray(getattr(e, name), dtype=float))
    return columns | {n: v for n, v in _words(e).items() if not (n == "point" and SEEN_TARGET in v[0])}


def _words(e: Experiment) -> dict[str, list[Any]]:
    return {n: list(getattr(e, field)) for n, field in fields.WORDS.items() if getattr(e, field)}


def plan_columns(e: Experiment) -> dict[str, list[Any]]:
    """Columns of a plan's rows, without readings, as `stiffmap simulate --plan` reads them (mm, N, rad)."""
    loads = {c: v for c, v in _loads(e).items() if e.quantity == "deflection" or any(float(x) for x in v)}
    return {"id": list(e.ids)} | _commanded(e) | loads | _words(e)


def _absolute(e: Experiment) -> tuple[dict[str, list[Any]], tuple[str, ...]]:
    """Columns of readings in coordinates of their own, and the channels that they stand for."""
    columns = _block(fields.SEEN, e.seen, MM)
    told: tuple[str, ...] = AXES[:3] if columns else ()
    if e.seen_rotation is not None:
        columns |= _rotvec(e.seen_rotation, fields.SEEN_TURNED)
        told += AXES[3:]
    for kind in kinds():
        values = e.absolute.get(kind.name)
        if values is None and kind.found and kind.commanded and e.registration and kind.channel in e.extra:
            values = e.reading[:, e.channels.index(kind.channel)] + kind.commanded(e)
        if values is not None:
            columns[kind.absolute] = number_cells(values * _scale(kind.channel))
            told += (kind.name,)
    return columns, told


def _commanded(e: Experiment) -> dict[str, list[Any]]:
    if e.command is not None:
        names, units = [c.name for c in e.command_of], [_scale(c) for c in e.command_of]
        out = _block(names, e.command, units) | _block([f"{c}2" for c in names], e.other_command, units)
    else:
        out = _block(fields.POSE, e.position, MM) | _rotvec(e.rotation, fields.VECTOR)
    if e.other is not None and e.command is None:
        out |= _block(fields.POSE2, e.other, MM) | _rotvec(e.other_rotation, [f"{c}2" for c in fields.VECTOR])
    return out | _block(fields.APPROACH, e.approach)


def _block(names: Sequence[str], values: Floats | None, units: Any = 1.0) -> dict[str, list[Any]]:
    """Columns of an array (n, names), SI times `units`; none where there is no array."""
    return {} if values is None else dict(zip(names, map(number_cells, (values * units).T), strict=True))


def _rotvec(rotation: Floats | None, names: Sequence[str]) -> dict[str, list[Any]]:
    if rotation is None:
        return {}
    good = np.asarray(np.isfinite(rotation).all(axis=(1, 2)))[:, None]
    turns = Rotation.from_matrix(np.where(good[:, :, None], rotation, np.eye(3))).as_rotvec()
    return _block(names, np.where(good, turns, np.nan))


def _loads(e: Experiment) -> dict[str, list[Any]]:
    units = [1.0] * 3 + [MM] * 3
    used = [i for i in range(6) if e.wrench[:, i].any() or (i < 3 and e.quantity == "deflection")]
    out = {WRENCH[i]: number_cells(e.wrench[:, i] * units[i]) for i in used}
    if e.asked is None:
        return out
    given = np.flatnonzero(np.isfinite(e.asked).any(axis=0))
    return out | {ASKED[i]: number_cells(e.asked[:, i] * units[i]) for i in given}
