"""Time and memory of a calibration of many poses of an arm whose every number is off.

    OPENBLAS_NUM_THREADS=1 python bench/calibration_speed.py [--poses 17000]

A UR10 with drawn errors in all its unknowns, weight, frame and tool unknown, position and orientation read
with noise, one reading a pose: what a laser tracker sees in a week. Prints seconds, CPU seconds and peak memory, and fails
where true values are not inside their 95 % intervals as often as they should be.
"""

from __future__ import annotations

import argparse
import resource
import time
from dataclasses import replace

import numpy as np
from tests.python.experiment.virtual.joint_plans import plan_of_joints

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor
from stiffmap.experiment.channels import AXES
from stiffmap.identification.numbers import unknowns
from stiffmap.identification.numbers.sensitivity import predicted

NOISE, ANGLE = 3e-5, 1e-4


def twin(poses: int, seed: int) -> tuple[sm.Machine, Experiment, dict[str, float]]:
    """The declared machine, what was read of the real one, and its errors in standard uncertainties."""
    machine = sm.load_machine("ur10")
    rng = np.random.default_rng(seed)
    joints = np.radians([0, -60, 90, -120, -90, 0]) + rng.uniform(-1.0, 1.0, (poses, 6))
    plan = replace(
        plan_of_joints(machine, joints, axes=AXES, noise=NOISE, angle_noise=ANGLE),
        frame="unknown",
        tool="unknown",
        gravity=(0.0, 0.0, -9.81),
    )
    predictor = Predictor(machine, plan)
    wanted = unknowns(machine.description, predictor.experiment)
    truth = rng.standard_normal(len(wanted))
    exact = predicted(predictor, wanted, truth)
    data = plan.with_readings(exact + plan.sigma * rng.standard_normal(exact.shape))
    return machine, data, {u.name: float(v) for u, v in zip(wanted, truth, strict=True)}


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--poses", type=int, default=17_000)
    parser.add_argument("--seed", type=int, default=0)
    a = parser.parse_args()
    machine, data, truth = twin(a.poses, a.seed)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    wall, cpu = time.perf_counter(), time.process_time()
    c = sm.calibrate(machine, data)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    known = [r for r in c.rows if r.identifiable]
    inside = np.array([abs(r.value - truth[r.name] * r.u) <= 1.96 * r.sigma for r in known])
    print(
        f"{a.poses} poses, {data.read.sum()} readings, {len(c.rows)} unknowns, {c.rank} directions determined: {c.verdict}"
    )
    print(f"{wall:.1f} s, {cpu:.1f} s of CPU; peak memory {peak:.0f} MB ({before:.0f} MB before)")
    print(f"{inside.sum()} of {len(known)} numbers that are determined are inside their 95 % intervals")
    return int(inside.mean() < 0.8)


if __name__ == "__main__":
    raise SystemExit(main())
