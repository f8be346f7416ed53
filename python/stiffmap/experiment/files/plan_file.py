"""A plan as a CSV file: the columns of an experiment without readings, in mm, N and rad, or in the unit that a header
names: ``x [um]``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from stiffmap.common.errors import FileError
from stiffmap.experiment.channels import AXES, AXIS_CHANNELS
from stiffmap.experiment.experiment import WRENCH, Experiment
from stiffmap.experiment.files import columns
from stiffmap.experiment.files.orientation import EULER, TURNED2, rotations
from stiffmap.experiment.files.schema import ExperimentFile, UnitsModel
from stiffmap.experiment.files.table import read_table
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
    units = UnitsModel(length="mm", force="N", angle="rad")
    model = ExperimentFile(machine=machine.name, quantity=quantity, units=units)  # type: ignore[arg-type]
    scales = Scales.of(model, str(path))
    table = scales.of_header(read_table(path))
    for column in table.header:
        if column not in KNOWN:
            near = suggestion(column, list(KNOWN))
            raise FileError(
                f"unknown column '{column}'{near}; a plan knows {', '.join(KNOWN)}", file=table.file, line=1
            )
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
