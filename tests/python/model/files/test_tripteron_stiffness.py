"""The Tripteron file gives the published compliance, by a dense VJM that shares no code with the core."""

from __future__ import annotations

import numpy as np
import pytest

from stiffmap.model.description import Joint, Leg, Offset, Spring
from stiffmap.model.files import load_description


def leg_stiffness(leg: Leg, tip: np.ndarray) -> np.ndarray:
    """Cartesian stiffness (6, 6) at ``tip`` of a leg without blocks, in its home configuration."""
    p, r = np.zeros(3), np.eye(3)
    elastic, passive, compliance = [], [], []
    for element in leg.elements:
        if isinstance(element, Offset):
            p, r = p + r @ element.nominal.p, r @ element.nominal.r
        elif isinstance(element, Joint):
            axis = r @ np.array(element.axes[0])
            if element.kind == "prismatic":
                assert element.law is not None
                elastic.append((axis, np.zeros(3), p))
                compliance.append(np.array([[1.0 / element.law.stiffness]]))
                p = p + axis * element.home[0]
            else:
                passive.append((np.zeros(3), axis, p))
                c, s = np.cos(element.home[0]), np.sin(element.home[0])
                r = r @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        elif isinstance(element, Spring):
            elastic += [(r[:, i], np.zeros(3), p) for i in range(3)]
            elastic += [(np.zeros(3), r[:, i], p) for i in range(3)]
            compliance.append(np.array(element.compliance))
    columns = [
        np.array([np.concatenate([v + np.cross(w, tip - at), w]) for v, w, at in group]).T
        for group in (elastic, passive)
    ]
    whole = np.zeros((len(elastic), len(elastic)))
    start = 0
    for block in compliance:
        whole[start : start + len(block), start : start + len(block)] = block
        start += len(block)
    n = columns[1].shape[1]
    system = np.block([[columns[0] @ whole @ columns[0].T, columns[1]], [columns[1].T, np.zeros((n, n))]])
    stiffness: np.ndarray = np.linalg.inv(system)[:6, :6]
    return stiffness


def test_published_deflection_at_the_home_pose() -> None:
    machine = load_description("tripteron")
    total = sum(leg_stiffness(leg, machine.home.p) for leg in machine.legs)
    twist = np.linalg.solve(total, [0.0, 0.0, 100.0, 0.0, 0.0, 0.0])
    # values on which six independent programs agree, to the digits printed
    assert np.linalg.norm(twist[:3]) == pytest.approx(1.161353e-4, rel=5e-7)
    np.testing.assert_allclose(twist[:3], [7.4661e-7, 8.8957e-6, 1.1579e-4], rtol=5e-5)
    np.testing.assert_allclose(twist[3:], [2.1669e-5, 5.9744e-6, 1.5087e-6], rtol=5e-5)
