"""Twins that are tapped, with one change each: what is named; and machines without any."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.python.identification.taps.twins import band, damped, declared, heavier, middle_poses, tap

import stiffmap as sm
from stiffmap.identification.taps import explain_taps, load_taps, predict_taps
from stiffmap.ui.cli import main

ARM = Path(__file__).parents[4] / "examples/taps/kr210.yaml"
MACHINES = {"kr210": ARM}
TURN = np.deg2rad(25)


def setting(name):
    machine = declared(sm.load_machine(MACHINES.get(name, name)))
    poses = middle_poses(machine, 3)
    return machine, poses, band(machine, poses)


def explained(name, change, folder, **how):
    machine, poses, f = setting(name)
    return explain_taps(machine, load_taps(tap(change(machine), poses, f, folder, **how), machine))


@pytest.mark.parametrize("name", ["kr210", "ur10", "five-bar", "orthoglide-revised", "linear-delta"])
def test_a_machine_as_declared_gets_no_cause(name, tmp_path):
    """Also where one hammer finds several modes as one, as on machines with legs alike."""
    found = explained(name, lambda m: m, tmp_path, seed=1)
    assert found.named == () and found.fits and "Nothing is missing" in found.sentence


@pytest.mark.parametrize(
    ("name", "body", "mass"),
    [
        ("kr210", "arm.link_3", 60.0),
        ("ur10", "arm.link_3", 2.5),
        ("travelling-column", "machine.ram", 252.0),
    ],
)
def test_a_heavier_link_is_named_or_listed(name, body, mass, tmp_path):
    found = explained(name, lambda m: heavier(m, body, mass), tmp_path)
    (named,) = found.named
    candidate = "link_mass of {1}, leg {0}".format(*body.split("."))
    own = next(e for e in (named, *named.alike) if e.candidate == candidate)
    assert own.value == pytest.approx(mass, abs=3 * own.u["mass"])
    assert "Nothing is missing" not in found.sentence


@pytest.mark.parametrize(
    ("name", "joint", "damping"),
    [("kr210", "arm.a2", 4000.0), ("ur10", "arm.shoulder", 85.0), ("ur10", "arm.elbow", 38.0)],
)
def test_a_damper_is_named(name, joint, damping, tmp_path):
    found = explained(name, lambda m: damped(m, joint, damping), tmp_path)
    (named,) = found.named
    assert named.candidate == f"damper of {joint[4:]}, leg arm"
    assert named.value == pytest.approx(damping, abs=3 * named.u["damping"])
    assert "times the declared" in found.sentence


@pytest.mark.parametrize(
    ("name", "how", "cause", "value"),
    [
        ("kr210", {"hammer": (np.sin(TURN), 0.0, np.cos(TURN))}, "hammer_direction of y", TURN),
        ("ur10", {"hammer": (np.sin(TURN), 0.0, np.cos(TURN))}, "hammer_direction of y", TURN),
        ("five-bar", {"hammer": (np.sin(TURN), 0.0, np.cos(TURN))}, "hammer_direction of y", TURN),
        ("travelling-column", {"lever": (0.2, 0.0, 0.0)}, "hammer_point of x", 0.2),
        ("ur10", {"lever": (0.2, 0.0, 0.0)}, "hammer_point of x", 0.2),
    ],
)
def test_a_hammer_that_was_held_otherwise_is_named(name, how, cause, value, tmp_path):
    found = explained(name, lambda m: m, tmp_path, **how)
    (named,) = found.named
    own = next(e for e in (named, *named.alike) if e.candidate == cause)
    (u,) = own.u.values()
    assert own.value == pytest.approx(value, abs=3 * u)


def test_typed_damping_is_compared(tmp_path, capsys):
    """Damping twice as large as declared: said, and no longer nothing."""
    machine = declared(sm.load_machine(ARM))
    p = middle_poses(machine, 3)
    path, file = tmp_path / "taps.csv", tmp_path / "arm.yaml"
    machine.save(file)
    f = sm.workspace.vibration.tip_modes(machine, p).frequency[:, :3]
    for percent, code in ((3.1, 0), (9.0, 1)):
        rows = [[*(1e3 * p[k]).tolist(), f[k, i], percent] for k in range(3) for i in range(3)]
        text = "\n".join(",".join(map(repr, r)) for r in np.array(rows).tolist())
        path.write_text(f"x_mm,y_mm,z_mm,frequency_Hz,damping_percent\n{text}\n")
        assert main(["taps", str(file), str(path)]) == code
        said = capsys.readouterr().out
        assert f"damping {percent:.2f} % measured, 3.00 before" in said and "times the declared" in said
        assert ("Nothing is missing" in said) is (code == 0)


@pytest.mark.parametrize("u_dir", ["", "0.4"])
def test_a_shape_that_is_noise_has_no_vote(u_dir, tmp_path):
    """A direction at right angles to all modes near, or no longer than three of its uncertainties, moves no row."""
    machine, p = sm.load_machine(ARM), np.array([1.98, -0.28, 1.225])
    modes = sm.workspace.vibration.tip_modes(machine, p)
    f, b = modes.frequency[0, :2], modes.tip[0, :3, :2]
    ways = b / np.linalg.norm(b, axis=0)
    wrong = [np.cross(*ways.T)] * 2 if not u_dir else ways.T[::-1]
    head = "x_mm,y_mm,z_mm,frequency_Hz,dir_x,dir_y,dir_z" + (",u_dir" if u_dir else "")
    rows = [",".join([*map(repr, [1980.0, -280.0, 1225.0, float(f[i]), *map(float, wrong[i])]), *[u_dir] * bool(u_dir)]) for i in (0, 1)]  # fmt: skip
    (tmp_path / "taps.csv").write_text("\n".join([head, *rows]) + "\n")
    taps = load_taps(tmp_path / "taps.csv")
    found = predict_taps(machine, taps)
    np.testing.assert_allclose(found.frequency, f)
    assert not found.voted.any() or not u_dir


GOOD = "x_mm,y_mm,z_mm,frequency_Hz,dir_x,dir_y,dir_z\n1980,-280,1225,8.5,0,0,1\n"


@pytest.mark.parametrize(
    ("row", "message"),
    [
        (
            "1.98,-0.28,1.225,8.5,0,0,1",
            r"line 3: x_mm, y_mm, z_mm: expected a pose in mm .*found 1.98.*metres",
        ),
        ("1980000,-280000,1225000,8.5,0,0,1", r"line 3: x_mm, y_mm, z_mm: .*which are micrometres"),
        ("1980,nan,1225,8.5,0,0,1", r"line 3: y_mm: expected a number, found an empty cell"),
        ("1980,,1225,8.5,0,0,1", r"line 3: y_mm: expected a number, found an empty cell"),
        ("1980,-280,1225,,0,0,1", r"line 3: frequency_Hz: expected a number, found an empty cell"),
        ("1980,-280,1225,8.5,0,,1", r"line 3: dir_y: expected a number, found an empty cell"),
    ],
)
def test_poses_in_metres_and_empty_cells_are_refused_by_row(row, message, tmp_path):
    path = tmp_path / "taps.csv"
    path.write_text(GOOD + row + "\n")
    with pytest.raises(sm.StiffmapError, match=message):
        load_taps(path, sm.load_machine(ARM))


@pytest.mark.parametrize("name", ["orthoglide-revised", "linear-delta", "five-bar"])
def test_metres_are_seen_where_the_workspace_holds_the_origin_and_elsewhere(name, tmp_path):
    machine = sm.load_machine(name)
    for scale, bad in ((1e3, False), (1.0, True)):
        rows = [",".join(repr(scale * v) for v in p) + ",20" for p in middle_poses(machine, 3).tolist()]
        (tmp_path / "taps.csv").write_text("\n".join(["x_mm,y_mm,z_mm,frequency_Hz", *rows]) + "\n")
        if bad:
            with pytest.raises(sm.StiffmapError, match=r"line 2: .*which are metres"):
                load_taps(tmp_path / "taps.csv", machine)
        else:
            assert len(load_taps(tmp_path / "taps.csv", machine)) == 3


@pytest.mark.parametrize(
    ("table", "file", "message"),
    [
        ("r.csv,,+z", "1,1,0\n2,1,0\n3,1,1", "line 2: along: expected one of .*found none"),
        ("r.csv,+z,up", "1,1,0\n2,1,0\n3,1,1", "line 2: hammer: expected one of .*found 'up'"),
        (
            "r.csv,+z,+z",
            "1,1,0\n2,nan,0\n3,1,1",
            "r.csv, line 3: column 'real_m/N': expected a finite number",
        ),
        (
            "r.csv,+x +z,+z",
            "1,1,0\n2,1,0\n3,1,1",
            r"along: expected an axis for each of 1 responses.*'\+x \+z'",
        ),
        ("no.csv,+z,+z", "1,1,0\n2,1,0\n3,1,1", "no.csv: no such file"),
    ],
)
def test_bad_responses_are_one_message(table, file, message, tmp_path):
    (tmp_path / "r.csv").write_text(f"frequency_Hz,real_m/N,imag_m/N\n{file}\n")
    (tmp_path / "taps.csv").write_text(f"x_mm,y_mm,z_mm,response,along,hammer\n1980,-280,1225,{table}\n")
    with pytest.raises(sm.StiffmapError, match=message):
        load_taps(tmp_path / "taps.csv")


def test_the_command_plans_taps(tmp_path, capsys):
    out = tmp_path / "plan.csv"
    assert main(["plan", str(ARM), "--taps", "2", "--poses", "8", "-o", str(out)]) == 0
    assert "2 poses to tap" in capsys.readouterr().out
    assert len(out.read_text().splitlines()) == 3 and out.read_text().startswith("x_mm,y_mm,z_mm")
    assert main(["plan", str(ARM)]) == 2 and "--taps" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("share", "taken"), [("0.02%", True), ("5 %", True), ("0.05", False), ("120%", False)]
)
def test_shares_of_masses_are_written_as_the_refusal_says(
    share: str, taken: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["taps", "ur10", "none.csv", "--mass-u", share]) == 2
    err = capsys.readouterr().err
    assert ("none.csv" if taken else "--mass-u: expected % above 0") in err
