"""The cutting force against textbook integrals, energy and limits."""

from __future__ import annotations

from dataclasses import replace
from math import acos, pi

import numpy as np
import pytest
from tests.python.machining.process.closed_form import by_quadrature, process, slot

import stiffmap as sm
from stiffmap.machining.process.description import (
    EndMill,
    Trimming,
    mean_force,
    tangential_force,
    widened,
)
from stiffmap.machining.process.force import force_uncertainty, revolution


@pytest.mark.parametrize("teeth", [1, 2, 3, 4])
@pytest.mark.parametrize("helix", ["0 deg", "30 deg", "45 deg"])
def test_slot(teeth: int, helix: str) -> None:
    given = process(teeth=teeth)
    given["tool"] = {"diameter": "25 mm", "teeth": teeth, "helix": helix}
    mean = sm.cutting_force(given).mean
    assert mean == pytest.approx(slot(teeth, 3e-3, 0.075e-3), rel=1e-12)


def test_the_shipped_slot() -> None:
    assert sm.cutting_force("slot").mean == pytest.approx([-65.338, 137.945, 75.600], abs=1e-3)


def test_runout_keeps_the_mean_while_all_teeth_cut() -> None:
    given = process()
    given["tool"] = {**given["tool"], "runout": {"offset": "0.1 um", "angle": "20 deg"}}  # type: ignore[dict-item]
    force = sm.cutting_force(given)
    # at both ends of a slot the chip vanishes: there any run-out lifts a tooth, by a share of (offset/chip)²
    assert force.mean == pytest.approx(slot(2, 3e-3, 0.075e-3), rel=1e-3)
    # away from the ends none leaves the cut
    side = process("climb", "5 mm")
    half = process("climb", "5 mm")
    half["tool"] = {**half["tool"], "runout": {"offset": "0.1 um"}}  # type: ignore[dict-item]
    assert sm.cutting_force(half).mean == pytest.approx(sm.cutting_force(side).mean, rel=2e-3)


def test_runout_that_lifts_a_tooth_is_one_tooth_with_twice_the_feed() -> None:
    """Two teeth 0.3 mm apart in radius at 0.075 mm per tooth: one of them never cuts."""
    given = process()
    given["tool"] = {**given["tool"], "helix": "0 deg", "runout": {"offset": "150 um"}}  # type: ignore[dict-item]
    force = sm.cutting_force(given)
    assert "leaves" in force.note or "lifts" in force.note
    assert force.mean == pytest.approx(slot(1, 3e-3, 0.15e-3), rel=2e-3)


@pytest.mark.parametrize(("side", "radial"), [("climb", 5.0), ("conventional", 5.0), ("climb", 20.0)])
def test_any_engagement(side: str, radial: float) -> None:
    arc = acos(1 - 2 * radial / 25)
    span = (pi - arc, pi) if side == "climb" else (0.0, arc)
    mean = sm.cutting_force(process(side, f"{radial} mm")).mean
    assert mean == pytest.approx(by_quadrature(2, 3e-3, 0.075e-3, *span), rel=1e-9)


def test_revolution_has_that_mean_and_the_tooth_passing_line() -> None:
    p = sm.load_process(process("climb", "10 mm", teeth=3))
    angle, force = revolution(p, 1440, 200)
    assert len(angle) == 1440
    assert force.mean(axis=0) == pytest.approx(mean_force(p, 10e-3, 3e-3), rel=1e-3)
    found = sm.cutting_force(p)
    assert found.order[np.argmax(found.amplitude[:, 1])] == 3
    assert found.frequency[2] == pytest.approx(300.0)
    assert found.amplitude[[0, 1]].max() < 1e-9 * found.amplitude[2].max() + 1e-9
    assert found.peak >= np.linalg.norm(found.mean)


def test_slopes_are_the_limit_of_central_differences() -> None:
    p = sm.load_process(process("climb", "6 mm"))
    by_width = sm.cutting_force(p).stiffness_side
    errors = []
    for h in (4e-4, 2e-4):
        errors.append(
            abs((mean_force(p, 6e-3 + h, 3e-3) - mean_force(p, 6e-3 - h, 3e-3))[1] / (2 * h) - by_width)
        )
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)
    blind = sm.cutting_force(replace(p, cut=replace(p.cut, through=False)))
    assert blind.stiffness_depth == pytest.approx(mean_force(p, 6e-3, 3e-3)[1] / 3e-3)
    assert sm.cutting_force("slot").stiffness_side == 0.0
    assert sm.cutting_force(process("climb", "25 mm")).stiffness_side == 0.0


def test_trimming_spends_the_energy_of_what_it_removes() -> None:
    p = sm.load_process("trimming")
    law = p.law
    assert isinstance(law, Trimming)
    dry = replace(p, law=replace(law, rubbing=0.0))
    force = sm.cutting_force(dry)
    removed = p.cut.radial * p.cut.axial * p.feed
    assert force.power == pytest.approx(law.specific_energy * removed, rel=1e-12)
    assert force.tangential == pytest.approx(law.specific_energy * removed / p.cutting_speed, rel=1e-12)
    rub = sm.cutting_force(p).tangential - force.tangential
    assert rub == pytest.approx(law.rubbing * p.cut.axial * p.arc * p.tool.diameter / 2, rel=1e-12)
    assert force.mean[2] == 0.0
    # a thin cut: the arc has no extent, the force is tangential and radial there
    thin = mean_force(dry, 1e-10, p.cut.axial)
    t = float(tangential_force(dry, 1e-10, p.cut.axial))
    assert thin[0] == pytest.approx(t, rel=1e-3)
    assert thin[1] == pytest.approx(law.radial * t, rel=1e-3)


def test_a_coated_tool_is_an_end_mill_with_endless_teeth() -> None:
    p = sm.load_process("trimming")
    law = p.law
    assert isinstance(law, Trimming)
    n = 10**6
    edge = law.rubbing * p.tool.diameter * pi / n  # the contact shared by the edges
    mill = replace(
        p,
        tool=replace(p.tool, teeth=n),
        law=EndMill(law.specific_energy, law.radial * law.specific_energy, 0.0, edge, law.radial * edge, 0.0),
    )
    assert mean_force(mill, 4e-3, 8e-3) == pytest.approx(mean_force(p, 4e-3, 8e-3), rel=1e-12)


def test_inside_corners_widen_the_cut_by_what_they_remove() -> None:
    p = sm.load_process("trimming")
    r, ae, rho = p.tool.diameter / 2, 4e-3, 30e-3
    area = ((rho + r) ** 2 - (rho + r - ae) ** 2) / 2 / rho  # swept per metre of the centre's path
    assert float(widened(p, ae, 1 / rho)) == pytest.approx(area, rel=1e-12)
    assert float(widened(p, ae, -1 / rho)) < ae
    assert float(widened(p, ae)) == ae


def test_kienzle_is_its_secant_and_says_so() -> None:
    given = process("climb", "5 mm")
    given["law"] = {"kienzle": {"kc11": "1800 N/mm2", "mc": 0.25, "radial": 0.4}}
    p = sm.load_process(given)
    force = sm.cutting_force(p)
    assert "secant" in force.note
    k = 1800e6 * (p.mean_chip / 1e-3) ** -0.25
    assert force.mean == pytest.approx(sm.cutting_force(replace(p, law=EndMill(k, 0.4 * k))).mean)


def test_uncertainty_of_the_force() -> None:
    p = replace(sm.load_process("slot"), uncertainty={"Ktc": 1e7})
    assert force_uncertainty(p) == pytest.approx([0.0, 2 * 3e-3 / 4 * 1e7 * 0.075e-3, 0.0])
