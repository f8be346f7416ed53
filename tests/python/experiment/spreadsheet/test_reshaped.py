"""Sheets in another shape than a row for each reading: what is read is that of the plain table, or refused in one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.python.experiment.spreadsheet.test_columns_together import made

import stiffmap as sm

POSES = [(-50.0, 40.0, -30.0), (60.0, 0.0, 10.0), (20.0, -70.0, 50.0)]
LOADS = (50.0, 100.0, 150.0)
READ = np.array([[21.4, 43.6, 65.1], [23.0, 46.2, 70.9], [19.8, 40.1, 61.3]])
"""µm against the load, of a pose and a load."""
NOISE = ("--noise", "dz=0.002")
DOWN, LENGTH = ("--map", "fz=-Load [N]"), ("--unit", "length=mm")


def table(*head: str, comma: bool = False, zero: float | None = None) -> str:
    """Poses below one another and loads side by side; `zero`: what the gauge shows without a load, in a column before."""
    rows = ["Pose;X [mm];Y [mm];Z [mm];" + ";".join(head)]
    for i, (pose, read) in enumerate(zip(POSES, READ, strict=True)):
        values = [*([] if zero is None else [zero]), *(-1e-3 * read + (zero or 0.0))]
        rows.append(";".join([f"P{i + 1}", *map(str, pose), *(f"{v:.4f}" for v in values)]))
    text = "\n".join(rows) + "\n"
    return text.replace(".", ",") if comma else text


def is_plain(e: sm.Experiment | None, scale: float = 1.0) -> None:
    """Nine rows: every load at every pose, in this order."""
    assert e is not None
    assert np.allclose(e.position, 1e-3 * np.repeat(POSES, 3, axis=0))
    assert np.allclose(e.wrench, np.outer(np.tile(LOADS, 3), [0, 0, -scale, 0, 0, 0]))
    assert np.allclose(e.reading[:, 2], -1e-6 * READ.ravel(), atol=1e-12)


@pytest.mark.parametrize(
    ("text", "more"),
    [
        (table(*(f"dz @ Fz=-{f:g} N [mm]" for f in LOADS)), ()),
        (table(*(f"Fz = −{f:g} N dz (mm)" for f in LOADS)), ()),
        (table(*(f"dz_{f:g}N" for f in LOADS)), (*DOWN, *LENGTH)),
        (table(*(f"dz [{f:g} N]" for f in LOADS)), (*DOWN, *LENGTH)),
        (table(*(f"Uhr Z bei {f:g} N [mm]" for f in LOADS), comma=True), DOWN),
        (table(*(f"{f:g} N" for f in LOADS)), (*DOWN, *LENGTH, "--map", "dz=reading")),
        (table("unloaded [mm]", *(f"{f:g} N [mm]" for f in LOADS), zero=0.37), (*DOWN, "--map", "dz=reading")),
        (table("dz unloaded [mm]", *(f"dz {f:g} N [mm]" for f in LOADS), zero=0.37), DOWN),
    ],
)  # fmt: skip
def test_columns_of_several_loads_are_rows(tmp_path: Path, text: str, more: tuple[str, ...]) -> None:
    is_plain(made(tmp_path, text, *NOISE, *more, machine="orthoglide-revised"))


@pytest.mark.parametrize(
    "head",
    [";;;;Fx = 100 N;Fy = 100 N;Fz = -100 N\nPose;X [mm];Y [mm];Z [mm];dz [mm];dz [mm];dz [mm]",
     "Pose;X [mm];Y [mm];Z [mm];dz @ 100 N +X [mm];dz @ 100 N along y [mm];dz @ 100 N in -Z [mm]"],
)  # fmt: skip
def test_loads_along_several_axes_side_by_side(tmp_path: Path, head: str) -> None:
    e = made(tmp_path, head + "\n" + table().partition("\n")[2], *NOISE, machine="orthoglide-revised")
    assert e is not None
    assert np.allclose(e.wrench[:, :3], 100.0 * np.tile(np.diag([1.0, 1.0, -1.0]), (3, 1)))
    assert np.allclose(e.reading[:, 2], -1e-6 * READ.ravel())


def test_loads_up_and_down_side_by_side(tmp_path: Path) -> None:
    text = table("dz 50 N (loading) [mm]", "dz 100 N [mm]", "dz 50 N (unloading) [mm]")
    e = made(tmp_path, text, *NOISE, *DOWN, machine="orthoglide-revised")
    assert e is not None
    assert np.allclose(e.wrench[:, 2], np.tile([-50.0, -100.0, -50.0], 3))
    assert e.branch == ("loading", "", "unloading") * 3


def test_poses_and_loads_may_be_exchanged(tmp_path: Path) -> None:
    """Names of the poses above, of positions and readings to the left."""
    rows = [line.split(";") for line in table(*(f"dz @ Fz=-{f:g} N [mm]" for f in LOADS)).splitlines()]
    text = "\n".join(";".join(column) for column in zip(*rows, strict=True)) + "\n"
    is_plain(made(tmp_path, text, *NOISE, machine="orthoglide-revised"))


def test_masses_side_by_side_hang(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = table(*(f"dz ({f:g} kg) [mm]" for f in LOADS))
    is_plain(made(tmp_path, text, *NOISE, machine="orthoglide-revised"), 9.80665)
    assert (
        "columns of several loads are rows, one below the other: Mass 50 kg, Mass 100 kg, Mass 150 kg"
        in capsys.readouterr().out
    )


@pytest.mark.parametrize(
    "head", [("dz 50 N [mm]", "dz 100 kg [mm]", "dz 9 N [mm]"), ("dz 50 N [mm]",) * 2 + ("dz 9 N [mm]",)]
)
def test_loads_that_are_no_series_are_refused(tmp_path: Path, head: tuple[str, ...]) -> None:
    assert made(tmp_path, table(*head), *NOISE, machine="orthoglide-revised") is None


@pytest.mark.parametrize(("size", "comma"), [("2,5", False), ("2.5", True), ("2,5", True)])
def test_sizes_of_loads_have_either_decimal_sign(tmp_path: Path, size: str, comma: bool) -> None:
    text = table("dz 1 kg [mm]", "dz 2 kg [mm]", "dz 2kg5 [mm]", comma=comma).replace("2kg5", f"{size} kg")
    e = made(tmp_path, text, *NOISE, machine="orthoglide-revised")
    assert e is not None
    assert np.allclose(e.wrench[:, 2], -9.80665 * np.tile([1.0, 2.0, 2.5], 3))


@pytest.mark.parametrize("head", [("Load [N]", "dz 50 N [mm]", "dz 100 N [mm]"), ("dz [mm]", "dz 50 N [mm]", "dz 100 N [mm]"),
                                  ("u", "dz 50 N [mm]", "dz Fz=-100 N [mm]")])  # fmt: skip
def test_nothing_of_a_sheet_is_written_over(
    tmp_path: Path, head: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert made(tmp_path, table(*head), *NOISE, machine="orthoglide-revised") is None
    assert all(f"'{h}'" in capsys.readouterr().err for h in head[:1])


def test_a_column_that_a_person_chooses_stays(tmp_path: Path) -> None:
    text = table(*(f"dz {f:g} N [mm]" for f in LOADS))
    e = made(
        tmp_path, text, *NOISE, "--map", "dz=dz 100 N [mm]", "--set", "fz=-100", machine="orthoglide-revised"
    )
    assert e is not None
    assert np.allclose(e.reading[:, 2], -1e-6 * READ[:, 1])


def blocks(title: str, again: bool = True, comma: bool = False, separator: str = ";") -> str:
    """A title above the rows of each pose; `again`: and the header."""
    out = []
    for i, (pose, read) in enumerate(zip(POSES, READ, strict=True)):
        out.append(title.format(i + 1, *pose))
        out += ["Fz [N];dz [mm]"] if again or not i else []
        out += [f"{-f:g};{-1e-3 * r:.4f}" for f, r in zip(LOADS, read, strict=True)]
    text = "\n".join(out) + "\n"
    return text.replace(".", ",") if comma else text.replace(";", separator)


@pytest.mark.parametrize(
    "text",
    [
        blocks("Pose {}: X = {} mm, Y = {} mm, Z = {} mm"),
        blocks("X: {1} mm   Y: {2} mm   Z: {3} mm", comma=True),
        blocks("# P{}  X={} Y={} Z={}", separator="\t"),
        blocks("Position {} (x={}, y={}, z={})", again=False),
        blocks("Point {}, x [mm] = {}, y [mm] = {}, z [mm] = {}", separator=","),
        blocks("Pose;{}\nX =;{};mm;Y =;{};mm;Z =;{};mm"),  # as in cells of their own
    ],
)
def test_poses_in_titles_are_columns(tmp_path: Path, text: str) -> None:
    is_plain(made(tmp_path, text, *NOISE, *LENGTH, machine="orthoglide-revised"))


@pytest.mark.parametrize("comma", [False, True])
def test_titles_may_have_another_decimal_sign_than_the_rows(tmp_path: Path, comma: bool) -> None:
    titles = [f"X = {x} mm / Y = {y} mm / Z = {z} mm" for x, y, z in POSES]
    text = blocks("Pose {}", comma=comma)
    for k, title in enumerate(titles, 1):
        text = text.replace(f"Pose {k}", title if comma else title.replace(".", ","))
    is_plain(made(tmp_path, text, *NOISE, machine="orthoglide-revised"))


def test_joints_in_titles_are_columns(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    poses = [(10, -90, 80, 5, 40, 0), (20, -80, 70, 10, 45, 30), (-30, -70, 60, 15, 50, 90)]
    titles = ["Config: " + ", ".join(f"J{k} = {v}°" for k, v in enumerate(p, 1)) for p in poses]
    text = "".join(f"{title}\nMass [kg];dz [mm]\n2;-0.04\n5;-0.1\n" for title in titles)
    e = made(tmp_path / "good", text, *NOISE, machine="ur10")
    assert e is not None and e.command is not None
    assert np.allclose(np.degrees(e.command), np.repeat(poses, 2, axis=0))
    assert made(tmp_path / "bad", text.replace("J4 = 15°, ", ""), *NOISE, machine="ur10") is None
    assert "no title above this row says 'J4 [°]'" in capsys.readouterr().err


def test_what_was_computed_is_no_reading_and_what_is_used_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = "X [mm];Y [mm];Z [mm];kz [N/mm]\n0;0;0;1900\n50;0;0;1800\n"
    assert made(tmp_path / "k", text, *NOISE, machine="orthoglide-revised") is None
    assert "'kz [N/mm]' is computed: expected the load and the deflection" in capsys.readouterr().err
    text = "X [mm];Y [mm];Z [mm];Load [N];By;dz [mm]\n0;0;0;100;me;-0.05\n50;0;0;100;me;-0.06\n"
    assert made(tmp_path / "u", text, *NOISE, *DOWN, machine="orthoglide-revised") is not None
    out = capsys.readouterr().out
    assert "'Load [N]': other columns are made of it" in out and "'By': kept in notes.csv" in out


def test_a_load_in_titles_or_above_all(tmp_path: Path) -> None:
    rows = [f"{x};{y};{z};" for x, y, z in POSES]
    head = "X [mm];Y [mm];Z [mm];dz [mm]\n"
    parts = [
        f"Load direction: -Z, Load: {f:g} N\n"
        + head
        + "".join(f"{r}{-1e-3 * v:.4f}\n" for r, v in zip(rows, read, strict=True))
        for f, read in zip(LOADS, READ.T, strict=True)
    ]
    e = made(tmp_path / "many", "".join(parts), *NOISE, machine="orthoglide-revised")
    assert e is not None
    assert np.allclose(e.wrench[:, 2], -np.repeat(LOADS, 3))
    assert np.allclose(e.reading[:, 2], -1e-6 * READ.T.ravel())
    one = "Fz = -50 N\n" + parts[0].partition("\n")[2]
    e = made(tmp_path / "one", one, *NOISE, machine="orthoglide-revised")
    assert e is not None
    assert np.allclose(e.wrench[:, 2], -50.0)


@pytest.mark.parametrize("again", [True, False])
def test_a_title_that_lacks_what_others_say_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], again: bool
) -> None:
    text = blocks("Pose {}: X = {} mm, Y = {} mm, Z = {} mm", again)
    for lost in ("Pose 2: X = 60.0 mm, Y = 0.0 mm, Z = 10.0 mm\n",)[:again] + ("X = 60.0 mm, ",):
        assert made(tmp_path, text.replace(lost, ""), *NOISE, machine="orthoglide-revised") is None
        assert "no title above this row says 'X [mm]', as those of other rows do" in capsys.readouterr().err


WAYS = (("+X", 0, 1.0), ("y", 1, 1.0), ("-Z", 2, -1.0))


def along(sign: float, name: str = "Deflection [µm]") -> str:
    """A load along each axis, and one reading; `sign`: of what is read where the load is against the axis."""
    out = [f"X [mm];Y [mm];Z [mm];Direction;Load [N];{name}"]
    for pose, read in zip(POSES, READ, strict=True):
        at = ";".join(map(str, pose))
        out += [
            f"{at};{way};100;{v if s > 0 else sign * v}" for (way, _, s), v in zip(WAYS, read, strict=True)
        ]
    return "\n".join(out) + "\n"


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_reading_without_an_axis_is_along_the_load(tmp_path: Path, sign: float) -> None:
    e = made(
        tmp_path, along(sign), *NOISE, "--noise", "dx=2", "--noise", "dy=2", machine="orthoglide-revised"
    )
    assert e is not None
    signs = np.diag([s for _, _, s in WAYS])
    assert np.allclose(e.wrench[:, :3], 100.0 * np.tile(signs, (3, 1)))
    wanted = np.where(signs, signs, np.nan)[None] * 1e-6 * READ[:, :, None]
    assert np.allclose(e.reading[:, :3], wanted.reshape(-1, 3), equal_nan=True)


def test_a_length_of_a_deflection_is_none_along_the_load(tmp_path: Path) -> None:
    assert made(tmp_path, along(1.0, "|d| [µm]"), *NOISE, machine="orthoglide-revised") is None


def test_rows_of_one_axis_each_with_their_pose(tmp_path: Path) -> None:
    out = ["X [mm];Y [mm];Z [mm];Load direction;Load [N];Axis;Deflection [µm]"]
    for pose, read in zip(POSES, READ, strict=True):
        at = ";".join(map(str, pose))
        out += [f"{at};-Z;100;{axis};{v}" for axis, v in zip("XYZ", read, strict=True)]
    e = made(
        tmp_path,
        "\n".join(out) + "\n",
        *NOISE,
        "--noise",
        "dx=2",
        "--noise",
        "dy=2",
        machine="orthoglide-revised",
    )
    assert e is not None
    assert np.allclose(e.position, 1e-3 * np.array(POSES))
    assert np.allclose(e.wrench[:, :3], [0.0, 0.0, -100.0])
    assert np.allclose(e.reading[:, :3], 1e-6 * READ)


@pytest.mark.parametrize(
    ("titles", "more"),
    [(("Unloaded", "Loaded, Fz = -100 N"), ()), (("Fz = 0 N", "Fz = -100 N"), ()), (("Without load", "With load 100 N"), DOWN),
     (("# Messung ohne Last", "# Messung mit 10 kg"), ("--map", "fz=-Mass [kg]")), (("Load case 1: 0 N", "Load case 2: 100 N"), DOWN)],
)  # fmt: skip
def test_tables_of_several_loads_below_one_another(
    tmp_path: Path, titles: tuple[str, str], more: tuple[str, ...]
) -> None:
    rows = [f"{x};{y};{z};{{}}\n" for x, y, z in POSES]
    parts = [
        title
        + "\nX [mm];Y [mm];Z [mm];gauge z [mm]\n"
        + "".join(r.format(0.3 + v) for r, v in zip(rows, read, strict=True))
        for title, read in zip(titles, ((0.0,) * 3, -1e-3 * READ[:, 1]), strict=True)
    ]
    e = made(tmp_path, "\n".join(parts), *NOISE, *more, machine="orthoglide-revised")
    assert e is not None
    assert np.allclose(e.wrench[:, 2], np.repeat([0.0, -10 * 9.80665 if "kg" in titles[1] else -100.0], 3))
    assert np.allclose(e.reading[:, 2], np.r_[[3e-4] * 3, 3e-4 - 1e-6 * READ[:, 1]])


@pytest.mark.parametrize(
    "above",
    [
        "Force sensor 500 N",
        "Payload: 6 kg",
        "Load cell 500 N, gain 2",
        "# max. load 900 N",
        "Robot mass = 335 kg",
    ],
)
def test_what_is_no_load_of_the_rows_is_none(tmp_path: Path, above: str) -> None:
    e = made(tmp_path, above + "\n" + table("Fz [N]", "dz [mm]", "u"), *NOISE, machine="orthoglide-revised")
    assert e is not None
    assert np.allclose(e.wrench[:, 2], -1e-3 * READ[:, 0])
