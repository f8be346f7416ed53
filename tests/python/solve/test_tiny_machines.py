"""Machines of no, one or two coordinates, without springs, drives or joints: every call answers with an honest status
or refuses in words. Each runs in a process of its own kind, since the first of them died."""

from __future__ import annotations

import atexit
import json
import select
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, example, given, settings, strategies as st

WORKER = Path(__file__).with_name("everything.py")
PATIENCE = 120.0
"""s, for all calls of one machine."""


class Worker:
    """A process that is asked machine by machine, begun again when it has died."""

    def __init__(self) -> None:
        self.process: subprocess.Popen[str] | None = None

    def ask(self, spec: dict[str, Any]) -> str:
        if self.process is None:
            self.process = subprocess.Popen(
                [sys.executable, "-X", "faulthandler", str(WORKER)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
            atexit.register(self.process.kill)
            assert self._line() == "ready"
        assert self.process.stdin
        self.process.stdin.write(json.dumps(spec) + "\n")
        self.process.stdin.flush()
        answer = self._line()
        if answer is None:
            process, self.process = self.process, None
            process.kill()
            return f"no answer: the process ended with {process.wait()}"
        return str(json.loads(answer))

    def _line(self) -> str | None:
        assert self.process and self.process.stdout
        ready, _, _ = select.select([self.process.stdout], [], [], PATIENCE)
        return self.process.stdout.readline().strip() or None if ready else None


WORKERS = Worker()
PLAIN: dict[str, Any] = {
    "base": [], "platform": [], "box": True, "cord": False, "gravity": False,
    "task": ["x", "y", "z", "rx", "ry", "rz"],
}  # fmt: skip
TASKS = [PLAIN["task"], ["x", "y", "z"], ["x"], ["x", "y", "rz"], ["z", "rx"]]
RIGID = st.sampled_from(["o", "b", "p"])
STIFF = st.sampled_from(["s", "r", "f", "B"])
JOINTS = st.sampled_from(["tx", "tz", "dy", "ex", "Tz", "Dx", "Rz", "Sy", "u", "k"])


@st.composite
def chains(draw: st.DrawFn) -> list[str]:
    """Up to two elements that move, among rigid ones."""
    moving = draw(st.lists(st.one_of(STIFF, JOINTS), max_size=2))
    return draw(st.permutations(moving + draw(st.lists(RIGID, max_size=2))))


@st.composite
def specs(draw: st.DrawFn) -> dict[str, Any]:
    few = st.lists(st.one_of(RIGID, STIFF), max_size=1)
    return {
        "legs": draw(st.lists(chains(), max_size=3)),
        "base": draw(few),
        "platform": draw(few),
        "box": draw(st.booleans()),
        "cord": draw(st.booleans()),
        "gravity": draw(st.booleans()),
        "task": draw(st.sampled_from(TASKS)),
    }


@pytest.mark.parametrize(
    "legs",
    [
        [["o", "s"]],
        [["o"]],
        [[]],
        [],
        [["s"], ["s"]],
        [["o", "Tz"]],
        [["o", "Rz"]],
        [["Sy"]],
        [["tz", "o"]],
        [["Dx", "tz", "o"]],
        [["s", "Dx"], ["s", "Dx"]],
        [["o", "b"], ["o", "b"]],
    ],
    ids=lambda legs: "-".join("".join(leg) or "nothing" for leg in legs) or "no legs",
)
def test_small_machines_answer(legs: list[list[str]]) -> None:
    assert not WORKERS.ask({**PLAIN, "legs": legs, "gravity": True})


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow], derandomize=True)
@example({**PLAIN, "legs": [["o", "s"]]})
@given(specs())
def test_any_tiny_machine_answers(spec: dict[str, Any]) -> None:
    assert not WORKERS.ask(spec)
