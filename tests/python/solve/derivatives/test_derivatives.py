"""Derivatives against differences of the reference path, with their observed order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import stiffmap as sm
from stiffmap import _core
from stiffmap.model.effects import get, kinds
from stiffmap.solve.derivatives.prepared import Neighbours, central, with_requests, within

MACHINE = sm.load_machine("orthoglide-revised")
POSES = np.array([[0.02, 0.05, 0.1], [-0.1, 0.2, 0.15], [0.25, -0.12, 0.0]])
FORCE = np.array([120.0, -80.0, 300.0, 2.0, -1.0, 3.0])
QUANTITIES = ("displacement", "stiffness", "compliance")
EFFECTS: list[tuple[str, dict[str, Any]]] = [
    ("zero_offset", {"element": "actuator", "legs": ["x"], "error": 2e-5}),
    ("length", {"element": "bar", "legs": ["y"], "error": 0.0}),
    ("tilt", {"element": "actuator", "legs": ["z"], "angle_x": 1e-3, "angle_y": 0.0}),
    ("compliance", {"element": "actuator", "legs": ["x", "z"], "scale": 1.3}),
    ("hardening", {"element": "actuator", "legs": ["y"], "cubic": 1e14}),
    ("lead_error", {"element": "actuator", "legs": ["y"], "slope": 0.0}),
    ("gravity", {"scale": 0.5}),
]
OF = {
    "displacement": "derivatives",
    "stiffness": "stiffness_derivatives",
    "compliance": "compliance_derivatives",
}


def slopes(s: sm.Solution, quantity: str) -> dict[str, np.ndarray]:
    return dict(getattr(s, OF[quantity]))


def richardson(f: Callable[[float], np.ndarray], h: float) -> np.ndarray:
    """Fourth-order difference."""

    def d(step: float) -> np.ndarray:
        return (f(step) - f(-step)) / (2 * step)

    return (4 * d(h) - d(2 * h)) / 3


def off(found: np.ndarray, true: np.ndarray) -> float:
    """Largest error over the quantity's size, per pose; linear and angular parts in the machine's length."""
    unit = np.array([1, 1, 1, *[MACHINE.compiled.length] * 3])
    if true.ndim == 3:
        stiff = np.abs(true).max() > 1e3
        scale = np.outer(1 / unit, 1 / unit) if stiff else np.outer(unit, unit)
    else:
        scale = unit
    return float(np.abs((found - true) * scale).max() / np.abs(true * scale).max())


def moved_effect(i: int, name: str, value: float) -> list[tuple[str, dict[str, Any]]]:
    return [(k, {**a, name: value} if j == i else a) for j, (k, a) in enumerate(EFFECTS)]


@pytest.mark.parametrize("of", [("displacement",), QUANTITIES])
def test_effect_parameters(of: tuple[str, ...]) -> None:
    """Differences over whole machines, each described, compiled and solved anew by the reference path."""
    s = MACHINE.solve(POSES, FORCE, derivatives=EFFECTS, derivatives_of=of)
    wanted = [(i, p) for i, (kind, a) in enumerate(EFFECTS) for p in get(kind).parameters if p.name in a]
    assert len(slopes(s, "displacement")) == len(wanted)
    for (i, p), name in zip(wanted, slopes(s, "displacement"), strict=True):

        def machine(h: float, i: int = i, p: Any = p) -> sm.Machine:
            return sm.Machine(
                with_requests(MACHINE.description, moved_effect(i, p.name, float(EFFECTS[i][1][p.name]) + h))
            )

        def solved(h: float, machine: Any = machine) -> sm.Solution:
            return machine(h).solve(POSES, FORCE, method="reference")

        for q in of:
            true = richardson(lambda h, q=q, solved=solved: getattr(solved(h), q), 0.2 * p.scale)
            assert off(slopes(s, q)[name], true) < 2e-5, (q, name)


def test_gravity_of_a_variant_counts() -> None:
    """Displacements under gravity come from the kernels: a variant must not take the weight of the base."""
    wanted = [("gravity", {"scale": 1.0})]
    s = MACHINE.solve(POSES, derivatives=wanted, stiffness=False)
    heavy, light = (MACHINE.with_effect("gravity", scale=v).solve(POSES).displacement for v in (1.01, 0.99))
    assert off(s.derivatives["gravity scale"], (heavy - light) / 0.02) < 1e-5


@pytest.mark.parametrize("name", ["position", "rotation"])
def test_inputs(name: str) -> None:
    from stiffmap.solve.derivatives.differentiate import _moved, _step
    from stiffmap.solve.machine import solve_with
    from stiffmap.solve.solving import Call

    machine = sm.load_machine("hexapod") if name == "rotation" else MACHINE  # the Orthoglide never turns
    poses = POSES if machine is MACHINE else machine.description.home.p + 0.2 * POSES
    s = machine.solve(poses, FORCE, derivatives=[name], derivatives_of=QUANTITIES)
    assert len(slopes(s, "stiffness")) == 3
    for i, variable in enumerate(slopes(s, "stiffness")):

        def solved(h: float, i: int = i) -> sm.Solution:
            call = _moved(machine.compiled, Call(poses, FORCE), name, i, h)
            return solve_with(machine, call.position, call.wrench, replace(call.options, method="reference"))

        for q in QUANTITIES:
            true = richardson(
                lambda h, q=q, solved=solved: getattr(solved(h), q), 30 * _step(machine.compiled, name)
            )
            assert off(slopes(s, q)[variable], true) < 1e-5, (q, variable)


@pytest.mark.parametrize("load_type", ["dead", "follower", "semitangential"])
def test_slopes_by_the_wrench_of_a_drive_that_hardens(load_type: str) -> None:
    """A drive whose stiffness doubles within 100 N·m: differences of such a size say nothing of the slope."""
    machine = sm.load_machine("ur10").with_effect("hardening", element="base", cubic=1e12)
    p = np.array(machine.description.home.p)
    load = np.array([60.0, -40.0, 30.0, 4.0, -6.0, 5.0])
    given: dict[str, Any] = {"load_type": load_type}
    s = machine.solve(p, load, derivatives=["wrench"], derivatives_of=QUANTITIES, **given)
    alone = machine.solve(p, load, derivatives=["wrench"], **given)
    for i, (name, slope) in enumerate(s.derivatives.items()):
        np.testing.assert_array_equal(alone.derivatives[name], slope)
        for q in QUANTITIES:

            def value(h: float, i: int = i, q: str = q) -> np.ndarray:
                moved = load + h * np.eye(6)[i]
                return np.asarray(getattr(machine.solve(p, moved, method="reference", **given), q))

            true = richardson(value, 1.0 if i < 3 else 0.5)
            found = slopes(s, q)[name]
            assert (
                np.abs(found - true).max() < (2e-8 if q == "displacement" else 1e-6) * np.abs(true).max()
            ), (name, q)


def left_jacobian(phi: np.ndarray) -> np.ndarray:
    """d(rotation) by d(rotation vector), series to third order: angles here are below 1e-2."""
    s = np.array([[0, -phi[2], phi[1]], [phi[2], 0, -phi[0]], [-phi[1], phi[0], 0]])
    return np.eye(3) + s / 2 + s @ s / 6 + s @ s @ s / 24


def test_slope_of_the_displacement_along_the_load_is_the_compliance() -> None:
    """Exact identity: the twist by the compliance, the rotation vector by the left Jacobian's inverse."""
    s = MACHINE.solve(POSES, FORCE, derivatives=["wrench"])
    slope = np.stack(list(s.derivatives.values()), axis=-1)
    for i, phi in enumerate(s.displacement[:, 3:]):
        turn = np.linalg.solve(left_jacobian(phi), s.compliance[i, 3:])
        true = np.vstack([s.compliance[i, :3], turn])
        assert off(slope[i : i + 1], true[None]) < 1e-7


def test_slope_of_the_compliance_is_that_of_an_inverse() -> None:
    """dC = -C dK C for every variable."""
    s = MACHINE.solve(POSES, FORCE, derivatives=[*EFFECTS, "position"], derivatives_of=QUANTITIES)
    for name, dk in s.stiffness_derivatives.items():
        dc = s.compliance_derivatives[name]
        assert off(dc, -s.compliance @ dk @ s.compliance) < 1e-6, name


def test_the_stencils_are_of_second_order() -> None:
    """At steps where truncation rules, half the step leaves a quarter of the error: on the machine's stiffness."""

    def stiffness(h: float) -> np.ndarray:
        return MACHINE.solve(POSES[0] + np.array([h, 0, 0]), FORCE).stiffness

    true = richardson(stiffness, 1e-3)
    for sides in ((-1.0, 1.0), (0.0, 1.0), (-1.0, 0.0)):
        errors = []
        for h in (0.04, 0.02, 0.01):
            lower, upper = (side * 10 * h for side in sides)
            stencil = within(0.0, h, lower, upper)
            slope = stencil.combine(stiffness(0.0), [stiffness(a) for a in stencil.offsets])
            errors.append(off(slope[None], true[None]))
        orders = np.log2(np.array(errors[:-1]) / errors[1:])
        assert abs(orders[-1] - 2.0) < 0.15, (sides, orders)
    assert within(0.0, 1.0, -5.0, 5.0) == central(1.0)


def test_neighbours_are_what_the_effects_build() -> None:
    """The short way, by the legs that change, gives the very description that the long way gives."""
    checked = 0
    for name in ("orthoglide-revised", "tripteron", "hexapod", "rotary-delta"):
        description = sm.load_machine(name).description
        for kind in kinds():
            effect = get(kind)
            if effect.measurement:
                continue
            for element, legs in effect.places(description)[:6]:
                first = next(p for p in effect.parameters_at(description, element, legs) if p.fitted)
                arguments: dict[str, Any] = {
                    first.name: first.null if first.null is not None else first.lower
                }
                arguments |= {
                    p.name: p.default if p.default is not None else p.scale
                    for p in effect.parameters
                    if p.name not in (first.name, *effect.one_of, *effect.vector)
                }
                request = (kind, {"element": element, "legs": list(legs) or None, **arguments})
                other = ("tcp_offset", {"error_x": 1e-4})
                near = Neighbours(description, [other, request])
                value = min(first.upper, max(first.lower, arguments[first.name] + first.scale / 10))
                long = with_requests(description, [other, (kind, {**request[1], first.name: value})])
                assert near.moved(1, first.name, value) == long, (name, kind, element, legs)
                checked += 1
    assert checked > 150


@pytest.mark.parametrize("level", _core.kernel_levels())
def test_the_order_of_the_variants_leaves_no_trace(level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A variant of one leg is evaluated in that leg alone, on what the one before it left in the others."""
    monkeypatch.setenv("STIFFMAP_ISA", level)
    poses = np.array([0.02, 0.05, 0.1]) + np.linspace(-0.1, 0.1, 11)[:, None]
    there = MACHINE.solve(poses, FORCE, derivatives=EFFECTS)
    back = MACHINE.solve(poses, FORCE, derivatives=EFFECTS[::-1])
    for i, effect in enumerate(EFFECTS):
        others = [e for e in EFFECTS if e is not effect]
        last = MACHINE.solve(poses, FORCE, derivatives=[*others, effect])
        for name in [n for n in there.derivatives if n.startswith(effect[0])]:
            for s in (back, last):
                assert off(s.derivatives[name][..., None], there.derivatives[name][..., None]) < 1e-7, (
                    i,
                    name,
                )


def test_the_machines_are_kept() -> None:
    """The same request compiles once; another one does not get its machines."""
    machine = sm.load_machine("orthoglide-revised")
    a = machine.solve(POSES, FORCE, derivatives=EFFECTS[:2])
    kept = machine._derivable._values.copy()
    b = machine.solve(POSES, FORCE, derivatives=EFFECTS[:2])
    assert list(machine._derivable._values) == list(kept) and len(kept) == 1
    for name in a.derivatives:
        np.testing.assert_array_equal(a.derivatives[name], b.derivatives[name])
    machine.solve(POSES, FORCE, derivatives=moved_effect(0, "error", 5e-5)[:2])
    assert len(machine._derivable._values) == 2


@pytest.mark.parametrize(
    ("derivatives", "of", "message"),
    [
        (["pose"], ("displacement",), "expected an effect or one of position, rotation, wrench"),
        ([("length",)], ("displacement",), "expected \\(kind"),
        ([3], ("displacement",), "expected \\(kind"),
        ([], ("stiffness",), "derivatives_of: expected derivatives as well"),
        ([], ("energy",), "derivatives_of: expected one of displacement, stiffness"),
        (["wrench"], ("energy",), "derivatives_of: expected one of displacement, stiffness"),
        ([("length", {"element": "bra", "error": 0.0})], ("stiffness",), "did you mean 'bar'"),
    ],
)
def test_bad_requests(derivatives: Any, of: Any, message: str) -> None:
    with pytest.raises(sm.StiffmapError, match=message):
        MACHINE.solve(POSES, FORCE, derivatives=derivatives, derivatives_of=of)


def test_failed_poses_have_no_slope() -> None:
    poses = np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]])
    for of in (("displacement",), QUANTITIES):
        s = MACHINE.solve(poses, FORCE, derivatives=[*EFFECTS[:2], "position"], derivatives_of=of)
        for q in of:
            for slope in slopes(s, q).values():
                assert np.isfinite(slope[0]).all() and np.isnan(slope[1]).all()


@pytest.mark.parametrize("gravity", [None, (0.0, 0.0, -9.81)], ids=["weightless", "heavy"])
@pytest.mark.parametrize(
    ("name", "kind", "element"),
    [
        ("linear-delta", "parallelogram_width", "parallelogram"),
        ("linear-delta", "parallelogram_parallelism", "parallelogram"),
        ("rotary-delta", "length_difference", "parallelogram"),
        ("orthoglide-revised", "parallelogram_width", "parallelogram"),
        ("hybrid", "length", "rod"),
    ],
)
def test_branches_that_end_apart(
    name: str, kind: str, element: str, gravity: tuple[float, ...] | None
) -> None:
    """At the coordinates of the machine the branches of a neighbour's block do not meet, and they share a load."""
    machine = sm.load_machine(name)
    low, high = machine.workspace
    poses = np.random.default_rng(8).uniform(low, high, (4, 3))
    force = np.array([60.0, -40.0, 50.0, 0.5, -0.2, 0.3])
    leg = machine.legs[0]
    for p in get(kind).parameters:
        null = float(p.null or 0.0)
        given = {q.name: float(q.null or 0.0) for q in get(kind).parameters}
        where = {"element": element, "legs": [leg]}
        s = machine.solve(poses, force, gravity=gravity, derivatives=[(kind, {**where, **given})])
        found = next(v for k, v in s.derivatives.items() if k.endswith(f" {p.name}"))

        def moved(
            h: float, p: Any = p, where: Any = where, given: Any = given, null: float = null
        ) -> np.ndarray:
            other = machine.with_effect(kind, **where, **{**given, p.name: null + h})
            return np.asarray(other.solve(poses, force, gravity=gravity, method="reference").displacement)

        true = richardson(moved, 0.02 * p.scale)
        if np.abs(true).max() * p.scale > 1e-9:  # else it moves nothing, but for round-off
            assert off(found, true) < 1e-5
