"""Largest share of a drive's declared effort along a given toolpath, equation (4)."""

from __future__ import annotations

import numpy as np

from stiffmap.workspace.performance.motion.efforts import drive_efforts
from stiffmap.workspace.performance.motion.scaling import drive_values
from stiffmap.workspace.performance.registry import Case, Found, Measure


def compute(case: Case) -> Found:
    """Inverse dynamics along the motion, forces on the tool included."""
    motion = case.motion
    most = drive_values(case.machine, "force", None, "N or N·m")
    run = motion.trajectory(case.machine, gravity=case.gravity)
    e = drive_efforts(case.machine, run, gravity=case.gravity)
    share = np.abs(e["effort"].values) / most
    when, drive = np.unravel_index(int(np.argmax(share)), share.shape)
    note = f"{case.machine.actuators[drive]}: {abs(float(e['effort'].values[when, drive])):.4g} at {run.time[when]:.3g} s"
    return Found(
        float(share.max()), run.position[when], note=note, positions=run.position, values=share.max(axis=1),
        extra={"share": share, "drives": case.machine.actuators, "time": run.time},
    )  # fmt: skip


MEASURE = Measure(
    "path_effort", "share of the drives' efforts along the toolpath", "", "low", compute, order=44
)
