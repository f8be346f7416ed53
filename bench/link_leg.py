"""Time of one Orthoglide leg in finite elements against the virtual-joint model with identified links.

Processor time, one thread. The virtual joints are timed on the whole machine, three such legs: one leg alone
leaves its platform free, which takes another, slower path.

python bench/link_leg.py [--poses 3]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
import link_leg
from link_table1 import MATERIALS, Material


def main() -> None:
    """Print what is paid once, then the time of a pose by both."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--poses", type=int, default=3, help="of the finite elements")
    poses = np.random.default_rng(0).uniform(-0.08, 0.12, (10_000, 3))
    start = time.process_time()
    foot = link_leg.solid(link_leg.FOOT, Material(*MATERIALS["steel"]), study=False)
    bar = link_leg.solid(link_leg.BAR, Material(*MATERIALS["aluminium"]), study=False)
    print(f"once: meshes and both identifications {time.process_time() - start:.1f} s")
    with tempfile.TemporaryDirectory() as folder:
        machine = link_leg.joint_machine(foot, bar, "pin", Path(folder))
    took = []
    for pose in poses[: parser.parse_args().poses]:
        start = time.process_time()
        link_leg.leg_elements(foot, bar, pose, "pin")
        took.append(time.process_time() - start)
    nodes = len(foot.mesh.nodes) + 2 * len(bar.mesh.nodes)
    print(
        f"finite elements, {nodes} nodes, no new mesh: {np.median(took):.2f} s a pose (median of {len(took)})"
    )
    machine.solve(poses, threads=1)
    start = time.process_time()
    machine.solve(poses, threads=1)
    joints = (time.process_time() - start) / len(poses)
    print(f"virtual joints, three legs: {1e6 * joints:.2f} us a pose (mean of {len(poses)})")
    print(f"one leg: {3 * np.median(took) / joints:.1e} times as fast")


if __name__ == "__main__":
    main()
