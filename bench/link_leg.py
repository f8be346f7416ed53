"""Time of one Orthoglide leg: finite elements against the virtual-joint model with identified links.

python bench/link_leg.py [--poses 3]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from stiffmap.machine import Machine

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
import link_leg
from link_table1 import MATERIALS, Material


def main() -> None:
    """Print what is paid once, then the time of a pose by both."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--poses", type=int, default=3, help="of the finite elements")
    poses = np.random.default_rng(0).uniform(-0.08, 0.12, (10_000, 3))
    start = time.perf_counter()
    foot = link_leg.solid(link_leg.FOOT, Material(*MATERIALS["steel"]), study=False)
    bar = link_leg.solid(link_leg.BAR, Material(*MATERIALS["aluminium"]), study=False)
    print(f"once: meshes and both identifications {time.perf_counter() - start:.1f} s")
    with tempfile.TemporaryDirectory() as folder:
        machine = link_leg.joint_machine(foot, bar, "pin", Path(folder))
    leg = Machine(replace(machine.description, legs=machine.description.legs[:1]))
    took = []
    for pose in poses[: parser.parse_args().poses]:
        start = time.perf_counter()
        link_leg.leg_elements(foot, bar, pose, "pin")
        took.append(time.perf_counter() - start)
    nodes = len(foot.mesh.nodes) + 2 * len(bar.mesh.nodes)
    print(
        f"finite elements, {nodes} nodes, no new mesh: {np.median(took):.2f} s a pose (median of {len(took)})"
    )
    leg.solve(poses, threads=1)
    start = time.perf_counter()
    leg.solve(poses, threads=1)
    joints = (time.perf_counter() - start) / len(poses)
    print(f"virtual joints, one thread: {1e6 * joints:.1f} us a pose (mean of {len(poses)})")
    print(f"ratio {np.median(took) / joints:.1e}")


if __name__ == "__main__":
    main()
