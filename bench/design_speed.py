"""Time of one design evaluation: `python bench/design_speed.py [--nodes 7] [--designs 60] [--design redesign]`.

Every design has another geometry, so that nothing is kept from one to the next. Processor time of one process.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from stiffmap.workspace.design import load_design
from stiffmap.workspace.design.judging import judge


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--nodes", type=int, default=7)
    parser.add_argument("--designs", type=int, default=60)
    parser.add_argument("--design", default="redesign")
    given = parser.parse_args()
    design = load_design(given.design)
    search = design.model.search.model_copy(update={"nodes": given.nodes})
    design = replace(design, model=design.model.model_copy(update={"search": search}))
    low, high = design.bounds
    x = np.random.default_rng(0).uniform(low, high, (given.designs + 1, len(low)))
    judge(design, x[0])
    begun = time.process_time()
    for row in x[1:]:
        judge(design, row)
    each = 1e3 * (time.process_time() - begun) / given.designs
    print(f"{given.design}, {given.nodes**3} poses: {each:.1f} ms of processor time per design")


if __name__ == "__main__":
    main()
