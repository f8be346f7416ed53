"""Reading an experiment folder, or a plan: a CSV file with the columns of an experiment without readings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import given_path
from stiffmap.common.errors import FileError, MissingColumnError
from stiffmap.common.tables.table import Table
from stiffmap.common.tables.workbook import TABLES
from stiffmap.common.units import name_and_unit
from stiffmap.common.yaml_text import read as read_yaml
from stiffmap.experiment.channels import AXES, AXIS_CHANNELS, Channel
from stiffmap.experiment.experiment import ASKED, WRENCH, Experiment, Floats, Loop
from stiffmap.experiment.files import columns as read_columns, fields
from stiffmap.experiment.files.schema import ExperimentFile, ExperimentUnitsModel, file_model
from stiffmap.experiment.files.table import ANGLES, Units, read_table
from stiffmap.experiment.readings import kinds
from stiffmap.experiment.virtual.plans import unread
from stiffmap.model.files.report import validated
from stiffmap.solve.machine import Machine

SAME = ("point", "unloaded", "frame", "tool", "title", "reference_temperature")
"""Keys of the file that an `Experiment` has as they are."""
KNOWN = tuple(c for c in fields.PLAN if c not in (*fields.EULER, *fields.TURNED2))
READ_LATER = ("asked", "hours", "instrument", "target", "other_rotation")
"""What a plan may have columns of, and only readings need."""
Parts = Sequence[tuple[tuple[str, ...], Floats | None]]
"""Columns of readings, and what those in coordinates of their own hold for them."""


def load_experiment(path: str | PathLike[str]) -> Experiment:
    """Experiment from a folder with ``experiment.yaml`` and its CSV file, or from the YAML file.

    Raises `FileError` naming file, row, column or key, what was expected and what was found.
    """
    place = given_path(path, "path", "an experiment's folder or its YAML file")
    file = place / "experiment.yaml" if place.is_dir() else place
    if not file.is_file() or file.suffix.lower() in (*TABLES, ".txt"):
        way = "expected a folder with experiment.yaml; stiffmap experiment new makes one of a table"
        raise FileError(f"there is no such experiment ({way})", file=str(place))
    document = read_yaml(file)
    expected = "an experiment file is a mapping with machine, quantity and units"
    model = validated(file_model(), document, str(file), expected)
    units = Units(model, str(file))
    table = _rename(read_table(file.parent / model.data, model.rows), model.columns)
    table = units.of_header(table, {*model.joints, *model.command})
    if units.common["length"] < 1e-5 and not model.command and not {*fields.POSE} & {*units.own}:
        raise FileError(
            "units: with length: um the poses x, y, z would be in µm as well; write their unit, as in "
            "{length: mm, dx: um, dy: um, dz: um} (or x: um, if they are)",
            file=str(file),
        )
    seconds = [f"{c}2" for c in model.command if f"{c}2" in table]
    own = (*model.joints, *model.command, *seconds)
    if taken := next((c for c in own if c in fields.known()), None):
        table.fail(f"joints, command: '{taken}' has a meaning of its own; give the column another name")
    table.refuse_unknown((*fields.known(), *own, *(f"u_{c}" for c in own)), "known:")
    for column in own:
        table.text(column)
    return _assemble(model, table, units, file)


def _rename(table: Table, columns: dict[str, str]) -> Table:
    """Header with the file's own names replaced: ``columns: {dx: DEFL_X}``."""
    header = list(table.header)
    for ours, theirs in columns.items():
        found = [h for h in header if theirs in (h, name_and_unit(h)[0])]
        if not found:
            table.text(theirs)
        unit = name_and_unit(found[0])[1] if found[0] != theirs else ""
        header[header.index(found[0])] = f"{ours} [{unit}]" if unit else ours
    return replace(table, header=tuple(header))


def _channel(name: str, unit: str, *joint: str) -> Channel:
    """A column of a joint, which an encoder reads or which commands it."""
    return Channel(name, "rad" if unit in ANGLES else "m", *joint)


def _assemble(model: ExperimentFile, table: Table, units: Units, file: Path) -> Experiment:
    given = [k.channel for k in kinds() if table.one_of((k.name, k.absolute))]
    joints = [_channel(name, j.unit, j.joint, j.side) for name, j in model.joints.items()]
    extra = (*given, *joints)
    parts = _readings(model, table, units, extra)
    parts |= rows_of(model, table) | _setting(model, units, file)
    name = file.parent.name if file.name == "experiment.yaml" else file.stem
    experiment = Experiment(name=name, machine=model.machine, quantity=model.quantity, extra=extra, **parts)
    if experiment.unloaded == "approach" and experiment.approach is None:
        raise FileError(
            "unloaded: approach needs the columns approach_x, approach_y, approach_z", file=str(file)
        )
    return experiment


def _readings(
    model: ExperimentFile, table: Table, units: Units, extra: tuple[Channel, ...]
) -> dict[str, Any]:
    """What the instrument read, SI, and how sure it is."""
    channels = (*AXIS_CHANNELS, *extra)
    reading = table.block([c.name for c in channels], blank=True)
    seen, seen_rotation = read_columns.seen(table), read_columns.seen_rotation(model, table)
    of_kinds = {
        k.name: table.si(k.absolute, blank=True) for k in kinds() if k.absolute and k.absolute in table
    }
    for kind in (k for k in kinds() if k.positive and k.name in of_kinds):
        expected = f"column '{kind.absolute}': expected {kind.title} above zero"
        found = [f"{expected}; found {v:g} m" for v in of_kinds[kind.name]]
        table.check(~(of_kinds[kind.name] <= 0.0), found.__getitem__)
    single = (((name,), values) for name, values in of_kinds.items())
    _promise(reading, channels, table, [(AXES[:3], seen), (AXES[3:], seen_rotation), *single])
    if not np.isfinite(reading).any():
        if empty := [c for c in (*fields.read(), *fields.absolute()) if c in table]:
            raise FileError(
                f"expected a reading in one row or more of {', '.join(empty)}; found none", file=table.file
            )
        raise MissingColumnError(
            f"missing column: no reading ({', '.join((*fields.read(), *fields.absolute()))}, joints)",
            file=table.file,
        )
    _fits(model.quantity, table)
    sigma = read_columns.sigma(model, table, units, channels)
    return {
        "reading": reading,
        "sigma": np.where(np.isfinite(reading), sigma, np.nan),
        "seen": seen,
        "seen_rotation": seen_rotation,
        "absolute": of_kinds,
        "other": read_columns.other(model, table, reading, channels),
    }


def rows_of(model: ExperimentFile, table: Table) -> dict[str, Any]:
    """What else stands in the rows: poses, loads, commands, and how they were reached."""
    gravity, gravity_of = read_columns.gravities(model, table)
    rotation, other_rotation = read_columns.rotations(table, model.orientation)
    return {
        "ids": read_columns.ids(table),
        "position": read_columns.position(table, bool(model.command)),
        "wrench": _wrench(model, table),
        "asked": table.block(ASKED, blank=True) if table.one_of(ASKED) else None,
        "rotation": rotation,
        "other_rotation": other_rotation,
        "command": read_columns.command(model, table),
        "other_command": read_columns.command(model, table, "2"),
        "approach": read_columns.approach(table),
        "repeat": read_columns.whole(table, "repeat"),
        **{c: table.si(c) if c in table else None for c in ("order", "hours", "temperature")},
        "branch": read_columns.branch(table),
        **{c: read_columns.words(table, c) for c in ("setup", "instrument", "target")},
        "points": read_columns.words(table, "point", model.point),
        "load_points": read_columns.words(table, "load_point", model.load_point or model.point),
        "gravity": gravity,
        "gravity_of": gravity_of,
    }


def _setting(model: ExperimentFile, units: Units, file: Path) -> dict[str, Any]:
    """What holds for all rows."""
    normal = np.array(model.surface.normal)
    if not np.linalg.norm(normal) > 0:
        raise FileError("surface: normal: expected a direction, got three zeros", file=str(file))
    x, y, z = (float(v) for v in normal / np.linalg.norm(normal))
    return {
        "rotation_against": model.orientation.against,
        "command_of": tuple(_channel(n, c.unit, c.actuator) for n, c in model.command.items()),
        "normal": (x, y, z),
        "surface": model.surface.shape,
        "anchor": None if model.anchor is None else tuple(units.common["length"] * v for v in model.anchor),
        **{k: getattr(model, k) for k in SAME},
        "load_point": model.load_point or model.point,
        "zero_sigma": np.nan_to_num(read_columns.declared(model.zero_noise, units, AXIS_CHANNELS)),
        "certificate": _certificate(model, units, file),
        "loop": Loop(**model.metrology.model_dump()),
        "record": tuple((k, v) for k, v in {**model.record.model_dump(), "notes": model.notes}.items() if v),
        "source": str(file),
    }


def _certificate(model: ExperimentFile, units: Units, file: Path) -> tuple[tuple[str, float], ...]:
    """The instrument's standard uncertainties in SI."""
    given = {k: v for k, v in model.certificate.model_dump(exclude_none=True).items() if v > 0.0}
    for key in ("frame", "frame_direction"):
        if key in given and model.frame == "unknown":
            raise FileError(
                f"certificate: {key}: of a frame that is known; found frame: unknown, which is fitted freely",
                file=str(file),
            )
    quantities = {"frame": "length", "tool": "length", "frame_direction": "angle"}
    return tuple(
        (k, v * (units.of(quantities[k], f"certificate: {k}") if k in quantities else 1.0))
        for k, v in given.items()
    )


def _fits(quantity: str, table: Table) -> None:
    """FileError for a column that an experiment of this quantity cannot have."""
    of_position = (*fields.SEEN, *fields.SEEN_TURNED, *fields.SEEN_QUATERNION)
    wrong = [] if quantity == "position" else [(c, "a place (quantity: position)") for c in of_position]
    wrong += [(c, k.title) for k in kinds() if quantity not in k.quantities for c in (k.name, k.absolute)]
    for column, title in wrong:
        if column in table:
            table.fail(f"column '{column}': {title} is no {quantity}")


def _promise(reading: Floats, channels: tuple[Channel, ...], table: Table, parts: Parts) -> None:
    """Marks what absolute columns, next to their readings, will read once poses are known; FileError where both forms are given."""
    at = {c.name: i for i, c in enumerate(channels)}
    for names, values in parts:
        if values is None:
            continue
        if twice := table.one_of(names):
            table.fail(
                f"column '{twice}': the file has the same reading in coordinates of its own as well; give one"
            )
        good = np.isfinite(values.reshape(len(values), -1)).all(axis=1)
        for n in names:
            reading[good, at[n]] = 0.0


def _wrench(model: ExperimentFile, table: Table) -> Floats:
    if model.quantity == "deflection" and not table.one_of(WRENCH):
        raise MissingColumnError(
            "missing column: a deflection needs a load (fx, fy, fz, mx, my, mz), a position none",
            file=table.file,
        )
    return table.block(WRENCH, blank=False, missing=0.0)


def load_plan(path: Path, machine: Machine, quantity: str, **readings: Any) -> Experiment:
    """Plan of a CSV file (mm, N and rad, or the unit that a header names: ``x [um]``) with x, y, z and, as wanted, loads,
    orientation, order, temperature, branch, set-up, approach and points; its `readings` are those of `unread`. Raises `FileError` naming
    file, row and column."""
    units = ExperimentUnitsModel(length="mm", force="N", angle="rad")
    model = ExperimentFile(machine=machine.name, quantity=quantity, units=units)  # type: ignore[arg-type]
    table = Units(model, str(path)).of_header(read_table(path))
    table.refuse_unknown(KNOWN, "a plan knows")
    n = len(table)
    rows = {k: v for k, v in rows_of(model, table).items() if k not in READ_LATER}
    if rows["order"] is None:
        rows["order"] = np.arange(1, n + 1, dtype=float)
    if quantity == "deflection" and not rows["wrench"].any():
        raise FileError("a plan of deflections needs a load (fx, fy, fz, mx, my, mz)", file=table.file)
    return Experiment(
        name=path.stem,
        machine=machine.name,
        quantity=quantity,
        rotation_against="home",
        **unread(n, quantity, **readings),
        **rows,
    )
