# SPDX-License-Identifier: MIT
"""An arm at poses in another branch than home: a loaded solve that closes its joints, and one from where they stand; a diagnosis.

OPENBLAS_NUM_THREADS=1 python bench/other_branch.py
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

import stiffmap as sm
from stiffmap.experiment import random_plan, simulate
from stiffmap.model.description import AppliedEffect

JOINTS = np.array([0.3, -1.2, 1.4, -1.0, 1.2, 0.2])
"""rad: the wrist turned over against that of home."""
POSES, LOADS, RUNS = 12, 6, 5


def main() -> None:
    machine = sm.load_machine("ur10")
    joints = JOINTS + np.random.default_rng(3).uniform(-0.3, 0.3, (POSES, 6))
    at = sm.forward_kinematics(machine, joints)
    rows = np.repeat(np.arange(POSES), LOADS)
    force = np.tile(100.0 * np.vstack([np.eye(3), -np.eye(3)]), (POSES, 1))
    wrench = np.hstack([force, np.zeros_like(force)])
    position, rotation = np.array(at.position)[rows], np.array(at.rotation)[rows]
    start = sm.inverse_kinematics(machine, position, rotation).coordinates
    each = {}
    for name, given in (("closed anew", None), ("from where the joints stand", start)):
        times = []
        for _ in range(RUNS):
            begin = time.perf_counter()
            machine.solve(position, wrench, rotation=rotation, start=given, threads=1)
            times.append(time.perf_counter() - begin)
        each[name] = 1e6 * min(times) / len(rows)
        print(f"{name}: {each[name]:.1f} µs per pose")
    slow, fast = each.values()
    print(f"ratio: {slow / fast:.0f}")
    plan = random_plan(machine, "deflection", poses=POSES, seed=1).rows(np.arange(len(rows)))
    soft = AppliedEffect("compliance", "shoulder", ("arm",), (("scale", 11.0),))
    e = simulate(machine, replace(plan, position=position, rotation=rotation, wrench=wrench), [soft], seed=3)
    begin = time.process_time()
    d = sm.diagnose(machine, e, cross_validate=False)
    print(
        f"diagnosis of {len(rows)} rows: {time.process_time() - begin:.1f} s of processor; {'; '.join(map(str, d.effects))}"
    )


if __name__ == "__main__":
    main()
