"""Lengths from an anchor that nobody knows, of an arm whose zeros are off."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, load_experiment, save_experiment
from stiffmap.ui.cli import main

JOINTS = ("base", "shoulder", "elbow", "wrist_1", "wrist_2", "wrist_3")
ANCHORS = np.array([[1.2, -0.9, -0.3], [-0.4, 1.5, 0.6]])
ZEROS = np.array([0.012, -0.3])
SPOT = np.array([0.03, -0.02, 0.08])


@pytest.fixture(scope="module")
def arm() -> sm.Machine:
    return sm.load_machine("ur10")


def drawn(arm: sm.Machine, rows: int, off: np.ndarray, noise: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """(n, 6) rad commanded and (n, 2) m lengths from either anchor, by products that know no reading."""
    rng = np.random.default_rng(1)
    q = np.radians([0, -60, 90, -120, -90, 0]) + rng.uniform(-0.7, 0.7, (rows, 6))
    there = sm.forward_kinematics(arm, q + off)
    at = there.position + there.rotation @ SPOT
    length = np.linalg.norm(at[:, None] - ANCHORS, axis=2) + ZEROS
    return q, length + noise * rng.standard_normal(length.shape)


def write(folder: Path, q: np.ndarray, length: np.ndarray, head: str = "tool: offset_unknown\n") -> Path:
    """All rows from the first anchor, or half of them from each, in a set-up of its own."""
    folder.mkdir(exist_ok=True)
    command = "".join(f"  c{i}: {{actuator: arm.{j}, unit: rad}}\n" for i, j in enumerate(JOINTS))
    (folder / "experiment.yaml").write_text(
        f"machine: ur10\nquantity: position\nunits: {{length: mm}}\nnoise: {{ll: 0.05}}\n{head}command:\n{command}"
    )
    body = [
        [
            f"S{i % length.shape[1]}",
            *map(repr, map(float, row)),
            repr(1e3 * float(length[i, i % length.shape[1]])),
        ]
        for i, row in enumerate(q)
    ]
    lines = [["setup", *(f"c{i}" for i in range(6)), "length"], *body]
    (folder / "data.csv").write_text("\n".join(map(",".join, lines)) + "\n")
    return folder


def found(e: Experiment) -> dict[str, np.ndarray]:
    return {name: at for name, _, at in e.registration}


def test_anchors_zeros_and_the_place_on_the_tool_are_found(arm: sm.Machine, tmp_path: Path) -> None:
    head = "tool: offset_unknown\n"
    e = load_experiment(write(tmp_path / "two", *drawn(arm, 60, np.zeros(6)), head))
    told = Predictor(arm, e).experiment
    for k in range(2):
        assert found(told)[f"anchor S{k}"] == pytest.approx(ANCHORS[k], abs=3e-5)
        assert found(told)[f"zero of anchor S{k}"][0] == pytest.approx(ZEROS[k], abs=3e-5)
        assert found(told)[f"target S{k}"] == pytest.approx(SPOT, abs=3e-5)
    assert np.abs(told.reading[told.read]).max() < 1e-6


def test_an_anchor_to_either_side_of_a_plane_is_found(tmp_path: Path) -> None:
    """A five-bar moves in a plane: lengths are the same from a mirrored anchor."""
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(-100, 100, 6), np.linspace(350, 430, 5)))
    length = np.linalg.norm(np.column_stack([x - 300, y + 50, np.full(len(x), 120.0)]), axis=1)
    rows = "\n".join(f"{a},{b},0,{s!r}" for a, b, s in zip(x, y, map(float, length), strict=True))
    (tmp_path / "data.csv").write_text(f"x,y,z,length\n{rows}\n")
    head = "machine: five-bar\nquantity: position\nunits: {length: mm}\nnoise: {ll: 0.05}\n"
    (tmp_path / "experiment.yaml").write_text(head)
    told = Predictor(sm.load_machine("five-bar"), load_experiment(tmp_path)).experiment
    at = found(told)["anchor 1"]
    assert np.append(at[:2], abs(at[2])) == pytest.approx([0.3, -0.05, 0.12], abs=1e-5)


def test_a_known_anchor_is_used(arm: sm.Machine, tmp_path: Path) -> None:
    q, length = drawn(arm, 40, np.zeros(6))
    head = "tool: offset_unknown\nanchor: [1200, -900, -300]\n"
    e = load_experiment(write(tmp_path / "known", q, length[:, :1], head))
    r = sm.residual(arm, e)
    assert r.nuisances == 4  # zero and place on the tool
    assert found(r.experiment)["zero of anchor S0"][0] == pytest.approx(ZEROS[0], abs=1e-6)
    assert r.summary.rms < 1e-8
    save_experiment(e, tmp_path / "again")
    assert load_experiment(tmp_path / "again").anchor == pytest.approx(e.anchor)


def test_the_motion_of_the_tool_shows_along_the_wire(arm: sm.Machine, tmp_path: Path) -> None:
    off = np.array([0.0, 0.002, -0.003, 0.0015, 0.0025, 0.0])
    q, exact = drawn(arm, 50, np.zeros(6))
    p = Predictor(arm, load_experiment(write(tmp_path / "e", q, exact[:, :1])))
    moved = drawn(arm, 50, off)[1][:, 0] - exact[:, 0]
    for joint, error in zip(JOINTS, off, strict=True):
        arm = arm.with_effect("zero_offset", element=joint, error=float(error))
    assert p(arm.description.effects)[:, 6] == pytest.approx(moved, abs=1e-7)


def test_what_was_resolved_is_written_as_lengths(arm: sm.Machine, tmp_path: Path) -> None:
    q, length = drawn(arm, 40, np.zeros(6))
    e = load_experiment(write(tmp_path / "e", q, length[:, :1]))
    save_experiment(sm.simulate(arm, e, seed=1), tmp_path / "twin")
    again = load_experiment(tmp_path / "twin")
    assert again.absolute["ll"] == pytest.approx(e.absolute["ll"], abs=2e-3)
    assert sm.residual(arm, again).lack_of_fit > 1e-3


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda rows: [*rows[:5], f"{rows[5].rpartition(',')[0]},-3", *rows[6:]],
         r"data\.csv, line 6: column 'length': expected a length from an anchor above zero; found -0\.003 m"),
        (lambda rows: rows[:4], "too few lengths to find the anchor of set-up S0"),
        (lambda rows: [rows[0].replace("length", "ll"), *rows[1:]], "'ll' needs 'anchor' in experiment.yaml"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(change: object, said: str, arm: sm.Machine, tmp_path: Path) -> None:
    q, length = drawn(arm, 20, np.zeros(6))
    folder = write(tmp_path / "e", q, length[:, :1])
    rows = (folder / "data.csv").read_text().splitlines()
    (folder / "data.csv").write_text("\n".join(change(rows)) + "\n")  # type: ignore[operator]
    with pytest.raises(sm.StiffmapError, match=said):
        Predictor(arm, load_experiment(folder))()


@pytest.mark.parametrize("name", ["L", "length", "wire", "Länge", "distance"])
def test_a_sheet_of_joints_and_lengths(
    name: str, arm: sm.Machine, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Controller's places, joints in degrees, lengths in mm, no unit anywhere, and one row with a wrong sign."""
    q, length = drawn(arm, 30, np.zeros(6))
    length[7] *= -1.0
    body = np.hstack([1e3 * sm.forward_kinematics(arm, q).position, np.degrees(q), 1e3 * length[:, :1]])
    lines = [
        ["x", "y", "z", *(f"q{i}" for i in range(1, 7)), name],
        *([repr(float(v)) for v in r] for r in body),
    ]
    (tmp_path / "wire.csv").write_text("\n".join(map(",".join, lines)) + "\n", encoding="utf-8")
    out = tmp_path / "out"
    call = ["experiment", "new", str(tmp_path / "wire.csv"), "--machine", "ur10", "--noise", "length=0.05"]
    assert main([*call, "-o", str(out)]) == 0
    said = capsys.readouterr().out
    assert f"'{name}': expected lengths above zero; left out: line 9 (-" in said
    e = load_experiment(out)
    assert (len(e), e.quantity, e.tool) == (29, "position", "offset_unknown")
    assert e.sigma[0, 6] == pytest.approx(5e-5)
    assert sm.residual(arm, e).summary.rms < 1e-6


def test_a_length_next_to_gauges_is_a_note(tmp_path: Path) -> None:
    (tmp_path / "g.csv").write_text(
        "x [mm],y [mm],z [mm],fx [N],dx [mm],L\n0,390,0,80,0.02,500\n10,390,0,80,0.03,500\n"
    )
    out = tmp_path / "out"
    assert main(["experiment", "new", str(tmp_path / "g.csv"), "--machine", "five-bar", "-o", str(out)]) == 0
    assert load_experiment(out).axes == ("dx",)
