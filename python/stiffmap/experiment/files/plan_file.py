"""A plan as a CSV file: the columns of an experiment without readings, in mm, N and rad, or in the unit that a header
names: ``x [um]``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from stiffmap.common.errors import FileError
from stiffmap.experiment.channels import AXES
from stiffmap.experiment.experiment import Experiment
from stiffmap.experiment.files.fields import EULER, PLAN, TURNED2
from stiffmap.experiment.files.load import rows_of
from stiffmap.experiment.files.schema import ExperimentFile, ExperimentUnitsModel
from stiffmap.experiment.files.table import Units, read_table
from stiffmap.experiment.virtual.plans import unread
from stiffmap.solve.machine import Machine

KNOWN = tuple(c for c in PLAN if c not in (*EULER, *TURNED2))
READ_LATER = ("asked", "hours", "instrument", "target", "other_rotation")
"""What a plan may have columns of, and only readings need."""


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
        **unread(n, quantity, axes, noise, angle_noise),
        **rows,
    )
