"""Internal wrenches against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.python.solve import builders as b

import stiffmap as sm
from stiffmap.model.description import Law, Offset, Pose, Spring

L, A, B, EA = 0.4, 0.15, 0.1, 2.1e11 * 0.030 * 0.012


def with_long_bar(leg: str, longer: float) -> sm.Machine:
    """The swing table with one bar built longer than drawn."""
    description = sm.load_machine("swing-table").description

    def built(e: object) -> object:
        if isinstance(e, Offset) and e.name == "length":
            return replace(e, actual=Pose.of((0, 0, L + longer)))
        return e

    legs = tuple(
        replace(g, elements=tuple(built(e) for e in g.elements)) if g.name == leg else g
        for g in description.legs
    )
    return sm.Machine(replace(description, legs=legs))  # type: ignore[arg-type]


def test_one_long_bar_of_four() -> None:
    """The error splits into heave, two tilts and a warp. Only the warp has no rigid motion to go to: the
    axial springs take it whole, a quarter of the error each. Tilt about x is also resisted by the bars'
    own bending, tilt about y by nothing (pins)."""
    longer = 1e-5
    machine = with_long_bar("back_right", longer)
    stress = sm.assembly_wrenches(machine, [0, 0, L])
    assert int(stress.status) == sm.Status.CONVERGED
    axial = EA / L
    about_x = 2.1e11 * 0.030 * 0.012**3 / 12
    # at the table: tilt stiffness 4 (axial B^2 + own bending); side sway y is free to follow
    bending = 4 * about_x / L - (6 * about_x / L**2) ** 2 / (12 * about_x / L**3)
    tilt_share = 1 - axial * B**2 / (axial * B**2 + bending)
    signs = {"front_left": (1, 1), "front_right": (1, -1), "back_left": (-1, 1), "back_right": (-1, -1)}
    for name, (sx, sy) in signs.items():
        # pattern of a unit error at (-1, -1): (1 - sx - sy + sx sy) / 4, of which heave and tilt y relax
        misfit = longer / 4 * (sx * sy - sy * tilt_share)
        assert stress.springs[f"{name}.bar"][2] == pytest.approx(-axial * misfit, rel=2e-4)
    total = sum(stress.legs.values())
    np.testing.assert_allclose(total[:3], 0, atol=1e-6 * axial * longer)
    assert stress.largest()[0].endswith(".bar")
    assert stress.displacement[2] == pytest.approx(longer / 4, rel=1e-3)


def test_three_legs_that_just_do_carry_nothing() -> None:
    """A statically determinate hexapod takes a wrong strut without any stress."""
    description = sm.load_machine("hexapod").description
    first, *others = description.legs
    frame = first.elements[0]
    assert isinstance(frame, Offset)
    moved = replace(frame, actual=Pose.of(frame.nominal.p + [1e-3, 2e-3, -1e-3]))
    wrong = (moved, *first.elements[1:])
    machine = sm.Machine(replace(description, legs=(replace(first, elements=wrong), *others)))
    stress = sm.assembly_wrenches(machine, [0.05, 0, 0.7])
    assert np.linalg.norm(stress.displacement[:3]) > 1e-4
    for w in stress.springs.values():
        np.testing.assert_allclose(w, 0, atol=1e-5)


def test_preload_of_springs_in_line() -> None:
    """Two springs between fixed ends, one with a rest deflection u: force k1 k2 u / (k1 + k2)."""
    k1, k2, u = 3e5, 5e5, 2e-4
    rest = (u, 0.0, 0.0, 0.0, 0.0, 0.0)
    left = Spring("spring", stiffness=b.matrix(np.diag([k1] + [1e6] * 5)), rest=rest)
    right = Spring("spring", stiffness=b.matrix(np.diag([k2] + [1e6] * 5)))
    machine = b.parallel((left,), (right,))
    stress = sm.assembly_wrenches(machine, [0, 0, 0])
    force = k1 * k2 * u / (k1 + k2)
    np.testing.assert_allclose(stress.springs["leg1.spring"], [-force, 0, 0, 0, 0, 0], rtol=1e-10, atol=1e-9)
    np.testing.assert_allclose(stress.springs["leg2.spring"], [force, 0, 0, 0, 0, 0], rtol=1e-10, atol=1e-9)
    assert stress.displacement[0] == pytest.approx(k1 * u / (k1 + k2), rel=1e-10)


def test_a_drive_carries_what_hangs_on_it() -> None:
    machine = b.serial(b.motor("drive", law=Law(1e6)), b.shift("arm", (0.5, 0, 0)), home=Pose.of((0.5, 0, 0)))
    stress = sm.assembly_wrenches(machine, (0.5, 0, 0), wrench=[0, 100, 0, 0, 0, 0])
    assert stress.joints[machine.actuators[0]] == pytest.approx(50, rel=1e-4)


def test_unreachable_is_nan() -> None:
    stress = sm.assembly_wrenches(sm.load_machine("swing-table"), [1, 0, 0.4])
    assert int(stress.status) == sm.Status.UNREACHABLE
    assert all(np.isnan(w).all() for w in stress.springs.values())
