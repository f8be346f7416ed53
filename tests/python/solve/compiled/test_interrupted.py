"""Ctrl-C in a batch; use after fork and in spawned processes."""

from __future__ import annotations

import multiprocessing
import subprocess
import sys
import textwrap
from typing import Any

import numpy as np
import pytest

import stiffmap as sm

POSES = [[0.0, 0.05, 0.1], [0.1, -0.05, 0.2]]
LOAD = [300.0, 0, 0, 0, 0, 0]

JOB = """
    import os, signal, threading, time
    import numpy as np
    import stiffmap as sm
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background ignores it
    machine = sm.load_machine("orthoglide-revised")
    machine.solve(np.zeros((64, 3)), [300.0, 0, 0, 0, 0, 0])
    poses = np.broadcast_to([0.0, 0.05, 0.1], (400_000, 3))
    pressed = []
    def press():
        time.sleep(0.3)
        pressed.append(time.process_time())
        os.kill(os.getpid(), signal.SIGINT)
    threading.Thread(target=press).start()
    try:
        machine.solve(poses, [300.0, 0, 0, 0, 0, 0], method="METHOD", threads=2)
        print("finished")
    except KeyboardInterrupt:
        print(time.process_time() - pressed[0])
"""


@pytest.mark.parametrize("method", ["fast", "reference"])
def test_ctrl_c_ends_a_batch_at_once(method: str) -> None:
    """Within a second of processor time; the whole batch takes several."""
    code = textwrap.dedent(JOB).replace("METHOD", method)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() != "finished"
    assert float(done.stdout) < 1.0


def solved(_: int = 0) -> Any:
    return sm.load_machine("orthoglide-revised").solve(POSES, LOAD, threads=2).displacement


@pytest.mark.parametrize("how", ["fork", "spawn"])
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_other_processes_give_the_same_bits(how: str) -> None:
    here = solved()
    with multiprocessing.get_context(how).Pool(2) as pool:
        for there in pool.map(solved, range(2)):
            np.testing.assert_array_equal(there, here)
