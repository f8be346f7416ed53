"""Tables of joints where nothing was measured: a ball stood in sockets, or a probe on a datum sphere."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

import stiffmap as sm
from stiffmap.experiment import Predictor, load_experiment
from stiffmap.ui.cli import main

SPOT = np.array([0.03, -0.02, 0.08])
NOISE = ["--noise", "dx=0.1", "--noise", "dy=0.1", "--noise", "dz=0.1"]


@pytest.fixture(scope="module")
def rows() -> list[list[str]]:
    """Place, socket and joints (rad) at which a ball on the flange of a UR10 stands in one of two sockets 50 mm apart."""
    arm, rng = sm.load_machine("ur10"), np.random.default_rng(2)
    out = []
    for place, first in (("front", [-0.7, -0.3, 0.2]), ("left", [-0.5, -0.6, 0.3])):
        turn = Rotation.random(random_state=len(place))
        for i in range(16):
            goal = np.array(first) + turn.apply([0.05 * (i % 2), 0.0, 0.0])
            start = np.radians([0, -60, 90, -120, -90, 0]) + rng.uniform(-0.5, 0.5, 6)

            def apart(q: np.ndarray, goal: np.ndarray = goal, start: np.ndarray = start) -> np.ndarray:
                at = sm.forward_kinematics(arm, q[None])
                left = at.position[0] + at.rotation[0] @ SPOT - goal
                return np.append(left, 1e-9 * (q - start))

            q = least_squares(apart, start, xtol=1e-15, ftol=1e-15, gtol=1e-15).x
            out.append([place, f"{i % 2}", *map(repr, map(float, q))])
    return out


def make(folder: Path, head: str, rows: list[list[str]], *more: str) -> tuple[int, Path]:
    names = [*head.split(), *(f"joint_{k}_rad" for k in range(1, 7))]
    text = "\n".join(map(",".join, [names, *rows])) + "\n"
    (folder / "balls.csv").write_text(text, encoding="utf-8")
    call = ["experiment", "new", str(folder / "balls.csv"), "--machine", "ur10", *NOISE, *more]
    return main([*call, "-o", str(folder / "out")]), folder / "out"


def test_sockets_are_known_points_in_a_frame_for_each_place(
    rows: list[list[str]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, _ = make(tmp_path, "position socket", rows)
    assert code == 2
    said = capsys.readouterr().err
    assert "how far is it from one 'socket' to the next (0, 1)? Say --set socket=NUMBER (mm)" in said
    code, out = make(tmp_path, "position socket", rows, "--set", "socket=50")
    assert code == 0
    assert "'socket' 0, 1, 50 mm apart; a frame for each 'position'" in capsys.readouterr().out
    e = load_experiment(out)
    assert (set(e.setup), len(set(e.target)), e.frame) == ({"front", "left"}, 1, "unknown")
    assert e.seen is not None
    assert e.seen[:2] == pytest.approx(np.array([[0, 0, 0], [0.05, 0, 0]]))
    told = Predictor(sm.load_machine("ur10"), e).experiment
    (spot,) = (at for name, _, at in told.registration if name.startswith("target"))
    assert spot == pytest.approx(SPOT, abs=1e-5)
    assert np.nanmax(np.abs(told.reading)) < 1e-5


def test_a_datum_sphere_is_one_point(rows: list[list[str]], tmp_path: Path) -> None:
    one = [["A", *r[2:]] for r in rows if r[:2] == ["front", "0"]]
    code, out = make(tmp_path, "sphere", one)
    assert code == 0
    e = load_experiment(out)
    assert e.seen is not None and not e.seen.any()
    code, out = make(tmp_path, "note", one, *(w for a in "xyz" for w in ("--set", f"p{a}=0")), "--overwrite")
    assert code == 0
    assert load_experiment(out).seen == pytest.approx(e.seen)


def test_a_row_without_a_socket_is_named(
    rows: list[list[str]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out = make(tmp_path, "position socket", [rows[0], ["front", "", *rows[1][2:]], *rows[2:]])
    assert code == 2 and not out.exists()
    assert (
        "balls.csv, line 3: column 'socket': expected the name or number of a socket"
        in capsys.readouterr().err
    )


def test_a_dialogue_asks_how_far_sockets_are_apart_and_remembers(
    rows: list[list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    asked, answers = [], iter(["far", "50"])

    def reply(text: str = "") -> str:
        asked.append(capsys.readouterr().out + text)
        return next(answers)

    monkeypatch.setattr("builtins.input", reply)
    code, out = make(tmp_path, "position socket", rows, "--dialogue")
    assert code == 0 and len(asked) == 2 and "How far is it from one socket to the next, in mm?" in asked[0]
    seen = load_experiment(out).seen
    assert seen is not None and seen[1] == pytest.approx([0.05, 0, 0])
    code, out = make(tmp_path, "position socket", rows, "--overwrite")
    again = load_experiment(out).seen
    assert code == 0 and again is not None and again == pytest.approx(seen)
