"""Uncertainties that the machine file and the instrument's certificate give go before the defaults."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, load_experiment, save_experiment
from stiffmap.experiment.virtual.plans import plan_of_poses, random_poses
from stiffmap.identification.calibration import calibrate
from stiffmap.identification.numbers import Tolerances, Unknown, certified, unknowns
from stiffmap.identification.numbers.sensitivity import predicted

SHIPPED = Path(sm.__file__).parent / "model/machines" / "linear-delta.yaml"


@pytest.fixture(scope="module")
def delta(tmp_path_factory: pytest.TempPathFactory) -> sm.Machine:
    """The shipped delta with uncertainties beside some of its numbers."""
    text = SHIPPED.read_text(encoding="utf-8")
    for old, new in (
        (
            "{offset: length, translation: [500, 0, 0]}",
            "{offset: length, translation: [{value: 500, u: 0.05}, 0, 0]}",
        ),
        (
            "{offset: plate, translation: [50, 0, 0]}",
            "{offset: plate, translation: [{value: 50, u: 0.03}, 0, 0]}",
        ),
        ("{translation: [-303.108891324553,", "{translation: [{value: -303.108891324553, u: 0.02},"),
        ("home: 700", "home: {value: 700, u: 0.01}"),
        ("{body: rod, mass: 0.06,", "{body: rod, mass: {value: 0.06, u: 0.001},"),
    ):
        assert old in text
        text = text.replace(old, new)
    file = tmp_path_factory.mktemp("declared") / "delta.yaml"
    file.write_text(text, encoding="utf-8")
    return sm.load_machine(file)


def plan(machine: sm.Machine) -> Experiment:
    return plan_of_poses(machine, "position", random_poses(machine, 12, 1), np.zeros((1, 6)))


def by_name(machine: sm.Machine, e: Experiment, t: Tolerances | None = None) -> dict[str, Unknown]:
    return {u.name: u for u in unknowns(machine.description, e, t)}


def test_numbers_of_the_file_have_its_uncertainties(delta: sm.Machine) -> None:
    named = by_name(delta, replace(plan(delta), gravity=(0.0, 0.0, -9.81)))
    assert named["zero of a.carriage"].u == pytest.approx(1e-5)
    assert named["compliance of a.carriage"].u == pytest.approx(0.1)
    assert named["mass of a.right.rod"].u == pytest.approx(0.001 / 0.06)
    assert named["mass of a.left.rod"].u == pytest.approx(0.05)
    # two rods, each with its own 0.05 mm: their mean and their difference
    assert named["length of a.parallelogram.length"].u == pytest.approx(5e-5 / np.sqrt(2))
    assert named["difference of a.parallelogram.length between left and right"].u == pytest.approx(
        5e-5 * np.sqrt(2)
    )


def test_an_offset_is_uncertain_along_its_own_components(delta: sm.Machine) -> None:
    """Tower a: 0.02 mm along base x, given; 0.2 mm along base y, by default; its frame turned by 30 degrees."""
    named = by_name(delta, plan(delta))
    c, s = np.cos(np.radians(30.0)), np.sin(np.radians(30.0))
    along_x = np.sqrt((c * 2e-5) ** 2 + (s * 2e-4) ** 2)
    along_y = np.sqrt((s * 2e-5) ** 2 + (c * 2e-4) ** 2)
    assert named["shift of a.carriage along x"].u == pytest.approx(along_x)
    assert named["shift of a.carriage along y"].u == pytest.approx(along_y)


def test_offset_behind_the_last_joint(delta: sm.Machine) -> None:
    named = by_name(delta, plan(delta))
    turned = [named[f"shift of a.end along {a}"].u for a in "xyz"]  # axes of the base, plate of the tower's
    c, s = np.cos(np.radians(30.0)), np.sin(np.radians(30.0))
    assert turned[0] == pytest.approx(np.hypot(c * 3e-5, s * 2e-4))
    assert turned[2] == pytest.approx(2e-4)


def certificate(folder: Path, lines: str, frame: str = "known") -> Path:
    folder.mkdir()
    (folder / "experiment.yaml").write_text(
        "machine: linear-delta\nquantity: position\nunits: {length: mm, angle: deg}\nnoise: {dx: 0.01, dy: 0.01, dz: 0.01}\n"
        f"frame: {frame}\ncertificate: {lines}\n",
        encoding="utf-8",
    )
    (folder / "data.csv").write_text("x,y,z,dx,dy,dz\n0,0,300,0,0,0\n10,0,300,0,0,0\n", encoding="utf-8")
    return folder


def test_certificate_is_read_and_saved(tmp_path: Path) -> None:
    e = load_experiment(
        certificate(tmp_path / "a", "{scale: 5.0e-6, frame: 0.05, frame_direction: 0.01, tool: 0.2}")
    )
    t = certified(Tolerances(length=1e-3), e)
    assert (t.length, t.instrument, t.tool, t.frame) == pytest.approx((1e-3, 5e-6, 2e-4, 5e-5))
    assert t.frame_direction == pytest.approx(np.radians(0.01))
    save_experiment(e, tmp_path / "b")
    assert dict(load_experiment(tmp_path / "b").certificate) == pytest.approx(dict(e.certificate), rel=1e-5)


def test_certificate_of_a_frame_that_is_unknown_is_refused(tmp_path: Path) -> None:
    with pytest.raises(sm.StiffmapError, match="certificate: frame"):
        load_experiment(certificate(tmp_path / "a", "{frame: 0.05}", "unknown"))


def test_known_frame_is_found_within_its_uncertainty() -> None:
    """The frame stands 0.1 mm off and 0.3 mrad turned; a rigid motion must come out as that, by linear algebra."""
    machine = sm.load_machine("linear-delta")
    e = plan(machine)
    predictor = Predictor(machine, e)
    t = Tolerances(frame=1e-4, frame_direction=3e-4).scaled(0.01)
    names = unknowns(machine.description, e, t)
    frame = [u for u in names if "instrument's frame" in u.name]
    assert [u.name.rsplit(", ", 1)[1] for u in frame] == ["dx", "dy", "dz", "about x", "about y", "about z"]
    assert [u.u for u in frame] == [1e-4] * 3 + [3e-4] * 3  # the machine's tolerances alone were scaled
    shift, turn = np.array([1e-4, -5e-5, 8e-5]), np.array([2e-4, 3e-4, -1e-4])
    reading = e.reading.copy()
    reading[:, :3] = predictor()[:, :3] + shift + np.cross(turn, e.position)
    found = calibrate(machine, replace(e, reading=reading, joints=None), tolerances=t)
    value = {r.name: r.value for r in found.rows}
    got = np.array([value[u.name] for u in frame])
    assert got[:3] == pytest.approx(shift, abs=4e-6)
    assert got[3:] == pytest.approx(turn, abs=2e-5)
    one = predicted(predictor, frame, np.eye(6)[4]) - predictor()
    assert one[:, :3] == pytest.approx(np.cross([0.0, 3e-4, 0.0], e.position))


def test_a_set_up_has_its_own_zeros_and_the_numbers_of_all(delta: sm.Machine) -> None:
    """Rows of each set-up as of a plan of theirs alone, where both values of one number add up."""
    e = plan(delta)
    half = np.arange(len(e)) < len(e) // 2
    e = replace(e, setup=tuple(np.where(half, "a", "b")))
    p = Predictor(delta, e)
    shared = next(u for u in unknowns(delta.description, e) if u.group == "zeros")
    own = replace(shared, setup="a")
    found = predicted(p, [shared, own], np.array([1.0, 0.5]))
    for rows, value in ((half, 1.5), (~half, 1.0)):
        np.testing.assert_allclose(
            found[rows], predicted(p, [shared], np.array([value]))[rows], rtol=0, atol=1e-12
        )
    assert not np.allclose(found[half], predicted(p, [shared], np.array([1.0]))[half], rtol=0, atol=1e-8)
