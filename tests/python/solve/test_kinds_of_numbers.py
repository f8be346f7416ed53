"""What numpy would turn into a float without a word is refused with the argument's name."""

from __future__ import annotations

import datetime
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.broadcasting import real_array, real_number, whole_number
from stiffmap.workspace.maps import sweep

MACHINE = sm.load_machine("orthoglide-revised")
P3, W6 = [0.0, 0.0, 0.0], [1.0, 0, 0, 0, 0, 0]


def masked(values: Any) -> Any:
    out = np.ma.array(values, dtype=float)
    out[..., -1] = np.ma.masked
    return out


BAD: dict[str, tuple[Callable[[Any], Any], str]] = {
    "masked": (masked, "1 masked values"),
    "masked in a list": (lambda v: [np.ma.masked, *v[1:]], "masked element"),
    "complex": (lambda v: np.array(v) + 1j, "complex numbers"),
    "truth values": (lambda v: np.array(v) > 0, "truth values"),
    "a truth value in a list": (lambda v: [True, *v[1:]], "truth values"),
    "text": (lambda v: [str(x) for x in v], "text"),
    "bytes": (lambda v: np.array([b"1"] * len(v)), "bytes"),
    "dates": (lambda v: np.array(["2026-01-01"] * len(v), dtype="M8[D]"), "dates"),
    "Python's dates": (lambda v: [datetime.datetime(2026, 1, 1)] * len(v), "datetime among them"),
    "spans": (lambda v: np.ones(len(v), "m8[s]"), "spans of time"),
    "None": (lambda v: [None, *v[1:]], "NoneType among them"),
    "ragged": (lambda v: [[1.0], *v[1:]], "list"),
    "objects": (lambda v: [object(), *v[1:]], "object among them"),
}
CALLS: dict[str, Callable[[Any], Any]] = {
    "position": lambda make: MACHINE.solve(make(P3), W6),
    "wrench": lambda make: MACHINE.solve(P3, make(W6)),
    "rotation": lambda make: MACHINE.solve(P3, W6, rotation=make(np.eye(3).ravel().tolist())),
    "gravity": lambda make: MACHINE.solve(P3, W6, gravity=make(P3)),
    "wrenches['tcp']": lambda make: MACHINE.solve(P3, wrenches={"tcp": make(W6)}),
    "start['x.actuator']": lambda make: MACHINE.solve(P3, start={"x.actuator": make(P3)}),
    "actuators": lambda make: MACHINE.solve_joints(make(P3)),
    "x": lambda make: sm.error_map(MACHINE, x=make([0.0, 0.1]), y=[0.0], z=[0.0], wrench=W6, plane=None),
    "wrench['a']": lambda make: sm.error_map(MACHINE, x=[0.0], y=[0.0], z=[0.0], wrench={"a": make(W6)}, plane=None),
    "forces": lambda make: sweep(MACHINE, P3, [1.0, 0, 0], make([1.0, 2.0])),
    "direction": lambda make: sweep(MACHINE, P3, make([1.0, 0, 0]), [1.0]),
    "box": lambda make: sm.measures(MACHINE, box=make(P3)),
}  # fmt: skip


@pytest.mark.parametrize("kind", BAD)
@pytest.mark.parametrize(
    "name", ["position", "wrench", "gravity", "actuators", "x", "wrench['a']", "forces", "direction"]
)
def test_what_is_no_real_number_is_refused_by_name(name: str, kind: str) -> None:
    make, words = BAD[kind]
    with pytest.raises(sm.StiffmapError) as error:
        CALLS[name](make)
    assert str(error.value).startswith(f"{name}: expected")
    assert words in str(error.value)


@pytest.mark.parametrize("name", ["rotation", "wrenches['tcp']", "start['x.actuator']", "box"])
def test_other_arguments_ask_the_same_owner(name: str) -> None:
    with pytest.raises(sm.StiffmapError) as error:
        CALLS[name](BAD["complex"][0])
    assert str(error.value).startswith(f"{name}: expected") and "complex numbers" in str(error.value)


@pytest.mark.parametrize(
    "good",
    [
        [0, 0, 0], (0.0, 0, 0), np.zeros(3, np.float32), np.zeros(3, np.int8), [Fraction(1, 8), Decimal(0), 0],
        np.ma.array([0.0, 0.1, 0.0], mask=False), [np.float64(0), np.int64(0), 0.0],
    ],
)  # fmt: skip
def test_real_numbers_of_any_type_are_welcome(good: Any) -> None:
    wanted = MACHINE.solve(np.array([float(v) for v in good]), W6).displacement
    np.testing.assert_array_equal(MACHINE.solve(good, W6).displacement, wanted)


def test_an_array_of_floats_is_not_copied() -> None:
    a = np.ones(3)
    assert real_array(a, "a") is a


@pytest.mark.parametrize("bad", [1.5, 2.0, True, "2", None, 0, -1, np.float64(3), 10**9, np.array([1, 2])])
def test_threads_are_a_whole_number(bad: Any) -> None:
    if bad is None:
        return
    with pytest.raises(sm.StiffmapError, match=r"^threads: expected .*, got"):
        MACHINE.solve(P3, W6, rotation=np.eye(3), threads=bad)
    assert MACHINE.solve(P3, W6, rotation=np.eye(3), threads=np.int64(1)).status == 0


@pytest.mark.parametrize("name", ["chunk", "directions", "load_steps"])
@pytest.mark.parametrize("bad", [1.5, True, 0, -3])
def test_counts_are_whole_numbers(name: str, bad: Any) -> None:
    with pytest.raises(sm.StiffmapError, match=rf"^{name}: expected"):
        sm.error_map(MACHINE, x=[0.0], y=[0.0], z=[0.0], wrench=W6, **{name: bad})


def test_single_numbers() -> None:
    assert (real_number(np.int8(3), "a"), whole_number(np.uint8(3), "n", 1)) == (3.0, 3)
    with pytest.raises(sm.StiffmapError, match=r"^a: expected a number, got an array of shape \(1,\)"):
        real_number([1.0], "a")
    with pytest.raises(sm.StiffmapError, match=r"^n: expected at most 4, got 5"):
        whole_number(5, "n", 1, 4)
    with pytest.raises(sm.StiffmapError, match=r"^force: expected a number, got .300."):
        sm.error_map(MACHINE, x=[0.0], y=[0.0], z=[0.0], wrench=W6, force="300")  # type: ignore[arg-type]
