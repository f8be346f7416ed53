"""The answer of a pose is the same to the last bit, whatever is solved with it and by how many threads."""

from __future__ import annotations

import numpy as np
import pytest
from tests.python.solve.compiled.agreement import draw

import stiffmap as sm
from stiffmap import _core

FIELDS = (
    "displacement",
    "stiffness",
    "compliance",
    "actuator_effort",
    "leg_wrench",
    "status",
    "flags",
    "iterations",
)


def same_bits(a: sm.Solution, b: sm.Solution) -> bool:
    return all(getattr(a, f).tobytes() == getattr(b, f).tobytes() for f in FIELDS)


@pytest.fixture(params=["orthoglide-revised", "tripteron", "ur10"])
def case(request: pytest.FixtureRequest) -> tuple[sm.Machine, np.ndarray, np.ndarray]:
    machine = sm.load_machine(request.param)
    # the margin reaches out of the workspace: some lanes fall back beside others that do not
    position, wrench = draw(machine, 1100, seed=31, margin=-0.05)
    wrench[::7] = 0.0  # these lanes are done before the others
    return machine, position, wrench


@pytest.mark.parametrize("level", _core.kernel_levels())
def test_one_thread_or_seven(case, level: str, monkeypatch: pytest.MonkeyPatch) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.setenv("STIFFMAP_ISA", level)
    machine, position, wrench = case
    assert same_bits(*(machine.solve(position, wrench, threads=n) for n in (1, 7)))


@pytest.mark.parametrize("chunk", [1, 5, 8, 300])
def test_any_chunking(case, chunk: int) -> None:  # type: ignore[no-untyped-def]
    machine, position, wrench = case
    n = 60 if chunk < 8 else 1100
    whole = machine.solve(position[:n], wrench[:n], threads=1)
    parts = [
        machine.solve(position[i : i + chunk], wrench[i : i + chunk], threads=1) for i in range(0, n, chunk)
    ]
    for field in FIELDS:
        joined = np.concatenate([getattr(p, field) for p in parts])[:n]
        assert joined.tobytes() == getattr(whole, field)[:n].tobytes(), field


def test_order_leaves_no_trace(case) -> None:  # type: ignore[no-untyped-def]
    machine, position, wrench = case
    order = np.random.default_rng(1).permutation(len(position))
    straight, shuffled = machine.solve(position, wrench), machine.solve(position[order], wrench[order])
    for field in FIELDS:
        assert getattr(straight, field)[order].tobytes() == getattr(shuffled, field).tobytes(), field


def test_an_answer_keeps_its_memory() -> None:
    """The memory of an answer is used again, but only when nothing refers to it."""
    machine = sm.load_machine("ur10")
    position, wrench = draw(machine, 2000, seed=32)
    kept = machine.solve(position, wrench).stiffness
    before = kept.copy()
    others = [machine.solve(position, k * wrench).stiffness for k in (0.0, 2.0, 3.0)]
    assert kept.tobytes() == before.tobytes()
    assert not any(np.shares_memory(a, b) for a, b in zip(others, [kept, *others], strict=False))


@pytest.mark.parametrize("name", ["orthoglide-revised", "ur10", "hexapod"])
def test_bits_of_the_levels(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """What docs/big_maps.md promises of clusters: AVX2 and AVX-512 give the same bits, the base level nearly so."""
    machine = sm.load_machine(name)
    position = np.random.default_rng(6).uniform(*machine.workspace, (100, 3))
    answers = {}
    for level in _core.kernel_levels():
        monkeypatch.setenv("STIFFMAP_ISA", level)
        answers[level] = machine.solve(position, [100, 50, -200, 0, 0, 0])
    if "v3" in answers and "v4" in answers:
        assert same_bits(answers["v3"], answers["v4"])
    for other in answers.values():
        np.testing.assert_allclose(other.displacement, answers["base"].displacement, rtol=0, atol=1e-12)
