"""Arms that close in closed form: the joints that the reference path finds, on the branch of home."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import stiffmap as sm
from stiffmap.model.files import description_from_text, shipped_machines

LINKS = {  # of the UR10: translation (mm), turn about x behind it (deg)
    "link_1": ((0.0, 0.0, 127.3), 90.0),
    "link_2": ((-612.0, 0.0, 0.0), 0.0),
    "link_3": ((-572.3, 0.0, 0.0), 0.0),
    "link_4": ((0.0, 0.0, 163.941), 90.0),
    "link_5": ((0.0, 0.0, 115.7), -90.0),
    "link_6": ((0.0, 0.0, 92.2), 0.0),
}
HOME = (0.0, -60.0, 90.0, -120.0, -90.0, 0.0)


def slanted(turns: dict[str, float], elbow: float) -> sm.Machine:
    """The UR10 with other angles between its axes; `elbow`: -1 where the third axis points the other way."""
    text = next(m.path for m in shipped_machines() if m.name == "ur10").read_text()
    at, R = np.zeros(3), np.eye(3)
    for (link, (move, turn)), angle in zip(LINKS.items(), HOME, strict=True):
        R = R @ Rotation.from_euler("z", angle, degrees=True).as_matrix()
        at = at + R @ np.array(move)
        R = R @ Rotation.from_euler("x", turns.get(link, turn), degrees=True).as_matrix()
        if link in turns:
            text = text.replace(
                f"{{offset: {link}, translation: [{', '.join(f'{v:g}' for v in move)}], turns: [{{about: x, by: {turn:g}}}]}}",
                f"{{offset: {link}, translation: {list(move)}, turns: [{{about: x, by: {turns[link]}}}]}}",
            )
    before, _, rest = text.partition("home: {translation")
    text = f"{before}home: {{translation: {at.tolist()}, rotation: {R.tolist()}}}" + rest[rest.index("\n") :]
    if elbow < 0:
        head, _, tail = text.partition("- actuator: elbow")
        text = (
            head
            + "- actuator: elbow"
            + tail.replace("axis: z", "axis: -z", 1).replace("home: 90", "home: -90", 1)
        )
    return sm.Machine(description_from_text(text))


@pytest.mark.parametrize(
    ("turns", "elbow"),
    [({}, 1.0), ({"link_1": 75.0, "link_4": 80.0, "link_5": -65.0}, 1.0), ({"link_1": 110.0}, -1.0)],
    ids=["ur10", "slanted", "reversed"],
)
def test_joints_of_the_closed_form(turns: dict[str, float], elbow: float) -> None:
    machine = slanted(turns, elbow)
    rng = np.random.default_rng(61)
    home = machine.description.home
    position = np.asarray(home.translation) + rng.uniform(-0.15, 0.15, (60, 3))
    turned = Rotation.from_rotvec(rng.uniform(-0.8, 0.8, (60, 3))).as_matrix() @ np.asarray(home.rotation)
    fast = machine.solve(position, rotation=turned)
    reference = machine.solve(position, rotation=turned, method="reference")
    np.testing.assert_array_equal(fast.status, reference.status)
    np.testing.assert_array_equal(fast.flags & ~sm.Flag.REFERENCE_PATH, reference.flags)
    assert fast.reference_share < 0.05
    assert fast.ok.sum() > 50
    ok = fast.ok
    np.testing.assert_allclose(fast.coordinates[ok], reference.coordinates[ok], atol=1e-12)


def test_compliances_next_to_a_wrist_singularity() -> None:
    machine = sm.load_machine("ur10")
    joints = np.tile(np.radians(HOME), (6, 1))
    joints[:, 4] = [-1e-2, -3e-3, -1e-3, -1e-4, -1e-5, -1e-6]
    fast, reference = (machine.solve_joints(joints, np.zeros(6), method=m) for m in ("fast", "reference"))
    np.testing.assert_array_equal(fast.status, reference.status)
    size = np.sqrt(np.abs(np.diagonal(reference.compliance, axis1=1, axis2=2)))
    gap = np.abs(fast.compliance - reference.compliance) / (size[:, :, None] * size[:, None, :])
    assert gap.max() < 1e-10
