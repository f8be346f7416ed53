"""A plan as a CSV file: the columns of an experiment without readings, in mm, N and rad, or in the unit that a header
names: ``x [um]``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from stiffmap.common.errors import FileError
from stiffmap.common.units import name_and_unit
from stiffmap.experiment.channels import AXES, AXIS_CHANNELS
from stiffmap.experiment.experiment import WRENCH, Experiment
from stiffmap.experiment.files import columns
from stiffmap.experiment.files.orientation import EULER, TURNED2, rotations
from stiffmap.experiment.files.schema import ExperimentFile, UnitsModel
from stiffmap.experiment.files.table import Table, read_table
from stiffmap.experiment.files.units import Scales
from stiffmap.experiment.virtual.plans import MICRO
from stiffmap.model.files.schema.base import suggestion
from stiffmap.solve.machine import Machine

KNOWN = tuple(c for c in columns.PLAN if c not in (*EULER, *TURNED2))


def load_plan(
    path: Path,
    machine: Machine,
    quantity: str,
    *,
    axes: Sequence[str] = AXES[:3],
    noise: float | None = None,
    angle_noise: float = 1e-5,
) -> Experiment:
    """Plan of a CSV file with x, y, z and, as wanted, loads, orientation, order, temperature, branch,
    set-up, approach and points. Raises `FileError` naming file, row and column."""
    table, own = _units_of_columns(read_table(path))
    for column in table.header:
        if column not in KNOWN:
            near = suggestion(column, list(KNOWN))
            raise FileError(
                f"unknown column '{column}'{near}; a plan knows {', '.join(KNOWN)}", file=table.file, line=1
            )
    head = {"length": "mm", "force": "N", "angle": "rad"}
    units = _units(head | own, table.file)
    model = ExperimentFile(machine=machine.name, quantity=quantity, units=units)  # type: ignore[arg-type]
    scales = Scales.of(model, table.file)
    n = len(table)
    size = np.where([c.unit == "m" for c in AXIS_CHANNELS], noise or MICRO[quantity], angle_noise)
    sigma = np.tile(np.where([a in axes for a in AXES], size, np.nan), (n, 1))
    wrench = scales.wrench(list(WRENCH)) * columns.block(table, WRENCH, blank=False, missing=0.0)
    if quantity == "deflection" and not wrench.any():
        raise FileError("a plan of deflections needs a load (fx, fy, fz, mx, my, mz)", file=table.file)
    return Experiment(
        name=path.stem,
        machine=machine.name,
        quantity=quantity,
        ids=columns.ids(table),
        position=columns.position(table, scales, False),
        wrench=wrench,
        reading=np.where(np.isfinite(sigma), 0.0, np.nan),
        sigma=sigma,
        rotation=rotations(table, scales)[0],
        rotation_against="home",
        approach=columns.approach(table),
        repeat=columns.whole(table, "repeat"),
        order=table.numbers("order") if "order" in table else np.arange(1, n + 1, dtype=float),
        temperature=table.numbers("temperature") if "temperature" in table else None,
        branch=columns.branch(table),
        setup=tuple(table.text("setup")) if "setup" in table else (),
        points=columns.named(table, "point", "tcp"),
        load_points=columns.named(table, "load_point", "tcp"),
    )


def _units_of_columns(table: Table) -> tuple[Table, dict[str, str]]:
    """The table with bare names of columns, and the units that stood behind them in square brackets."""
    split = [name_and_unit(h) for h in table.header]
    names = tuple(name for name, _ in split)
    twice = next((n for n in names if names.count(n) > 1), None)
    if twice:
        raise FileError(f"column '{twice}' stands twice", file=table.file, line=1)
    own = {name: unit.replace("µ", "u").replace("μ", "u") for name, unit in split if unit}
    return replace(table, header=names), own


def _units(given: dict[str, str], file: str) -> UnitsModel:
    try:
        return UnitsModel.model_validate(given)
    except ValidationError as error:
        first = error.errors()[0]
        unknown = [c for c in given if c not in UnitsModel.model_fields]
        column = str(first["loc"][0]) if first["loc"] else next(iter(unknown), "")
        expected = first.get("ctx", {}).get("expected")
        told = f"expected {expected}" if expected else "expected none"
        raise FileError(
            f"unit of column '{column}': {told}; found '{given.get(column, '')}'", file=file, line=1
        ) from error
