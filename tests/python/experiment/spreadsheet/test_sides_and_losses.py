"""Differences next to what was commanded and measured, and rows in which a target was not seen."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.errors import StiffmapError

GRID = np.array([[x, y, z] for x in (-50, 0, 50) for y in (-50, 0, 50) for z in (-30, 30)], float)
ERRORS = np.round(0.08 * np.cos(np.arange(3 * len(GRID)).reshape(-1, 3) ** 2), 3)
"""mm."""
SIDES = "X {0};Y {0};Z {0};X {1};Y {1};Z {1};{2}"
COUNT = len(GRID)
JOINTS = np.round(1.2 * np.sin(np.arange(6 * COUNT).reshape(-1, 6) ** 2), 6)
ARM = ";".join(f"q{k} [rad]" for k in range(1, 7)) + ";"


def made(
    tmp_path: Path, head: str, *columns: np.ndarray, machine: str = "tripteron", **more: Any
) -> sm.FromTable:
    rows = (";".join(f"{v:.10g}" for v in row) for row in np.column_stack(columns).tolist())
    (tmp_path / "t.csv").write_text("\n".join([head, *rows, ""]), encoding="utf-8")
    usual = {"noise": {"dx": 0.05, "dy": 0.05, "dz": 0.05}, "overwrite": True, "quantity": "position"}
    return sm.experiment_from_table(machine, tmp_path / "t.csv", tmp_path / "out", **(usual | more))


def read(found: sm.FromTable) -> np.ndarray:
    """(n, 3) mm of places as they were written, else of differences."""
    table = np.genfromtxt(found.folder / "data.csv", delimiter=",", names=True)
    if "px" in (table.dtype.names or ()):
        return np.column_stack([table[f"p{a}"] for a in "xyz"])
    return 1e3 * found.experiment.reading[:, :3]


SWAPPED = {"difference": "target-minus-actual"}
MICRONS = {"units": {"length": "mm", "dx": "um", "dy": "um", "dz": "um"}}


@pytest.mark.parametrize(
    ("names", "factor", "said", "answer"),
    [
        (("Nominal", "Actual", "dX;dY;dZ"), -1, "--difference target-minus-actual", SWAPPED),
        (("soll", "ist", "Abweichung X;Abweichung Y;Abweichung Z"), (-1, -1, -1), "--difference", SWAPPED),
        (("Nom", "Meas", "Dev X;Dev Y;Dev Z"), (1, -1, 1), "--map dy='-Dev Y'$", {"columns": {"dy": "-Dev Y"}}),
        (("Cmd", "Meas", "dx;dy;dz"), 1e3, "--unit dx=um --unit dy=um --unit dz=um$", MICRONS),
        (("cmd", "act", "dx;dy;dz"), -1e3, "--unit dx=um .*--difference target-minus", MICRONS | SWAPPED),
        (("Target", "Actual", "dx;dy;dz"), (1, 1, 1e3), "--unit dz=um$", {"units": {"length": "mm", "dz": "um"}}),
    ],
)  # fmt: skip
@pytest.mark.parametrize("joints", [False, True])
def test_differences_of_another_sign_or_unit_are_refused_and_read_as_told(
    names: tuple[str, str, str], factor: Any, said: str, answer: dict[str, Any], joints: bool, tmp_path: Path
) -> None:
    sides = np.column_stack([GRID, GRID + ERRORS, np.asarray(factor) * ERRORS])
    head = SIDES.format(*names)
    more: dict[str, Any] = {"units": {"length": "mm"}}
    if joints:
        sides, head, more["machine"] = np.column_stack([JOINTS, sides]), ARM + head, "ur10"
    with pytest.raises(StiffmapError, match=f"line [2-4]: '{head.split(';')[-3][:-1]}.*less '.*say .*{said}"):
        made(tmp_path, head, sides, **more)
    np.testing.assert_allclose(
        read(made(tmp_path, head, sides, **(more | answer))), GRID + ERRORS if joints else ERRORS, atol=1e-9
    )


@pytest.mark.parametrize("digits", [2, 3])
def test_single_rows_that_differ_are_named(digits: int, tmp_path: Path) -> None:
    """A difference that was rounded is the same one; one of another row, or mistyped, is not."""
    said, once = np.round(ERRORS, digits), np.round(ERRORS, digits)
    once[3, 0] += 0.5
    head = SIDES.format("nom", "act", "dx;dy;dz")
    each = [
        made(tmp_path, head, GRID, GRID + ERRORS, d, units={"length": "mm"}).remarks
        for d in (said, once, np.roll(said, 1, axis=0))
    ]
    assert [[r[:15] for r in remarks] for remarks in each[:2]] == [[], ["line 5: 'dx' is"]]
    assert "further rows differ" in each[2][0]


def test_deflections_next_to_places_need_not_be_their_difference(tmp_path: Path) -> None:
    head = "X nom [mm];Y nom [mm];Z nom [mm];Fx [N];X act [mm];Y act [mm];Z act [mm];dx [mm];dy [mm];dz [mm]"
    own = 0.02 * np.abs(ERRORS)
    found = made(tmp_path, head, GRID, np.full(COUNT, 50.0), GRID + ERRORS, own, quantity="deflection")
    assert not found.remarks
    np.testing.assert_allclose(found.experiment.reading[:, :3], 1e-3 * own)


@pytest.mark.parametrize(
    ("reads", "factor", "agrees"),
    [
        ("dX;dY;dZ", 1, "actual-minus-target"),
        ("dX;dY;dZ", -1, "target-minus-actual"),
        ("X dev [um];Y dev [um];Z dev [um]", 1e3, "actual-minus-target"),
        ("dX;dY;dZ", 1e3, ""),
    ],
)
@pytest.mark.parametrize("difference", ["actual-minus-target", "target-minus-actual"])
def test_an_instrument_reads_actual_less_nominal_whatever_differences_stand_next_to_them(
    reads: str, factor: float, agrees: str, difference: str, tmp_path: Path
) -> None:
    """The sign of the file's differences turns those alone, and differences that contradict are named."""
    sides = np.column_stack([GRID, GRID + ERRORS, factor * ERRORS])
    head = SIDES.format("nom", "act", reads)
    found = made(tmp_path, head, sides, instrument="tracker", difference=difference)
    np.testing.assert_allclose(read(found), ERRORS, atol=1e-9)
    assert any("'X act' less 'X nom' is taken" in r for r in found.remarks) == (difference != agrees)


POINTS = "x [mm];y [mm];z [mm];"
LINE = np.column_stack([np.repeat([0.0, 50.0, 100.0], 2), np.zeros((6, 2))])
BOTH = [1.0, -1.0]


@pytest.mark.parametrize(
    ("head", "cells", "more"),
    [
        ("approach_x;approach_y;approach_z", ("1;0;0", "-1;0;0"), {}),
        ("Approach", ("1", "-1"), {}),
        ("Anfahrrichtung", ("+", "-"), {}),
        ("Direction", ("forward", "reverse"), {}),
        ("Travel direction", ("+x", "-X"), {}),
        ("Seite", ("up", "down"), {"columns": {"approach_x": "Seite"}}),
    ],
)
def test_directions_of_travel_are_read(
    head: str, cells: tuple[str, str], more: dict[str, Any], tmp_path: Path
) -> None:
    rows = (f"{x:g};0;0;{cells[i % 2]};{i}" for i, x in enumerate(LINE[:, 0]))
    (tmp_path / "t.csv").write_text("\n".join([f"{POINTS}{head};dx [um]", *rows]), encoding="utf-8")
    usual = {"noise": {"dx": 1.0}, "quantity": "position"}
    found = sm.experiment_from_table("tripteron", tmp_path / "t.csv", tmp_path / "o", **usual, **more)  # type: ignore[arg-type]
    np.testing.assert_array_equal(found.experiment.approach, np.outer(BOTH * 3, [1.0, 0.0, 0.0]))


@pytest.mark.parametrize(
    ("names", "runs"),
    [(f"{a};{b};{c};{d}", f"{a}|{b}|{c}|{d}") for a, b, c, d in (
        ("Run 1 +", "Run 1 -", "Run 2 +", "Run 2 -"), ("1 up", "1 down", "2 up", "2 down"), ("V1 forward", "V1 reverse", "V2 forward", "V2 reverse"),
    )],
)  # fmt: skip
def test_runs_in_both_directions_side_by_side_keep_them(names: str, runs: str, tmp_path: Path) -> None:
    """As in tables of ISO 230-2: they are no repeats of one another."""
    values = np.arange(12.0).reshape(3, 4)
    more: dict[str, Any] = {"constants": {"y": 0, "z": 0}, "units": {"dx": "um"}, "noise": {"dx": 1.0}}
    asked = partial(made, tmp_path, f"Target [mm];{names}", LINE[::2, 0], values, **more)
    with pytest.raises(StiffmapError, match=f"runs in both directions, say --map dx='{re.escape(runs)}'"):
        asked(columns={"x": "Target [mm]"})
    found = asked(columns={"x": "Target [mm]", "dx": runs}).experiment
    assert found.approach is not None
    np.testing.assert_array_equal(found.approach[:, 0], BOTH * 6)
    np.testing.assert_allclose(found.reading[:, 0], 1e-6 * values.ravel())


@pytest.mark.parametrize(
    ("names", "sides"),
    [("ref_pos(i,1);ref_pos(i,2)", None), ("1 pos;1 neg", (1.0, -1.0)), ("Pos 1;Pos 2", None), ("1 plus;2 plus", (1.0, 1.0))],
)  # fmt: skip
def test_positions_are_no_direction(names: str, sides: tuple[float, float] | None, tmp_path: Path) -> None:
    """``pos`` is a direction of travel where another run is ``neg``."""
    more: dict[str, Any] = {"constants": {"y": 0, "z": 0}, "units": {"dx": "um"}, "noise": {"dx": 1.0}}
    runs = {"columns": {"x": "Target [mm]", "dx": names.replace(";", "|")}}
    found = made(tmp_path, f"Target [mm];{names}", LINE[::2, 0], np.arange(6.0).reshape(3, 2), **runs, **more)
    approach = found.experiment.approach
    assert (approach is None) == (sides is None)
    if approach is not None:
        np.testing.assert_array_equal(approach[:2, 0], sides)


@pytest.mark.parametrize(
    "head",
    [
        "x;dx 1;dx 1;dx 2;dx 2\n;+;-;+;-\nmm;um;um;um;um",
        "Position x;Deviation x 1;;Deviation x 2;\n;↑;↓;↑;↓\n[mm];[µm];[µm];[µm];[µm]",
        ";→;←;→;←\nx;dx 1;dx 2;dx 3;dx 4\nmm;um;um;um;um",
        "Target x;1;;2;\n;up;down;up;down\nmm;um;um;um;um",
    ],
)
def test_directions_in_a_line_of_the_header(head: str, tmp_path: Path) -> None:
    """Above the names, or between names and units, as sheets of ISO 230-2 have them."""
    values = np.arange(12.0).reshape(3, 4)
    same = {"constants": {"y": 0, "z": 0}, "noise": {"dx": 1.0}}
    if "x;1;;2;" in head:
        same |= {"columns": {"dx": "1 up|1 down|2 up|2 down"}}
    found = made(tmp_path, f"ISO 230-2;Axis X;;;\n{head}", LINE[::2, 0], values, **same).experiment
    assert found.approach is not None
    np.testing.assert_array_equal(found.approach[:, 0], BOTH * 6)
    np.testing.assert_allclose(found.reading[:, 0], 1e-6 * values.ravel())


@pytest.mark.parametrize(
    ("signs", "way", "said"),
    [
        (BOTH * 9, {}, "along which axis is 'Approach'. Say --map approach_x='Approach'"),
        ([0.0, 1.0] * 9, {}, "column 'Approach': expected directions of travel as 1 and -1"),
        (BOTH * 9, {"machine": "ur10"}, "joints are commanded"),
    ],
)
def test_a_direction_of_travel_that_is_not_clear_is_no_note_in_silence(
    signs: list[float], way: dict[str, Any], said: str, tmp_path: Path
) -> None:
    if way:
        head = f"{ARM}px [mm];py [mm];pz [mm];Approach"
        assert said in " ".join(made(tmp_path, head, JOINTS, GRID, np.array(signs), **way).remarks)
        return
    with pytest.raises(StiffmapError, match=said):
        made(tmp_path, f"{POINTS}dx [mm];dy [mm];dz [mm];Approach", GRID, ERRORS, np.array(signs))


KEPT = np.setdiff1d(np.arange(COUNT), [4, 9])


def losing(seen: np.ndarray, what: Any) -> np.ndarray:
    out = seen.copy()
    out[[4, 9]] = out[[3, 8]] if what == "held" else what
    return out


FORMS = ("px", "tracker", "joints", "joints meas", "sides")


@pytest.mark.parametrize(
    ("form", "what"),
    [
        *((form, what) for form in FORMS for what in (0.0, -999.0, 999.99, -1.0, 1e6, "held")),
        *(("differences", what) for what in (0.0, -999.0, 9999.0)),
    ],
)
def test_rows_of_a_target_that_was_not_seen_are_left_out(form: str, what: Any, tmp_path: Path) -> None:
    seen, more = losing(GRID + ERRORS, what), dict[str, Any]()
    head = "x [mm];y [mm];z [mm];px [mm];py [mm];pz [mm]"
    columns = [GRID, seen]
    if form == "tracker":
        head, more = SIDES.format("nominal", "actual", "")[:-1], {"instrument": "tracker"}
    elif form.startswith("joints"):
        head = ARM + (
            "px [mm];py [mm];pz [mm]" if form == "joints" else "X meas [mm];Y meas [mm];Z meas [mm]"
        )
        columns, more = [JOINTS, seen], {"machine": "ur10"}
    elif form == "sides":
        head, more = SIDES.format("nom", "act", "dx;dy;dz"), {"units": {"length": "mm"}}
        columns = [GRID, seen, np.round(seen - GRID, 3)]
    elif form == "differences":
        head = "x [mm];y [mm];z [mm];dx [um];dy [um];dz [um]"
        columns = [GRID, 1e3 * (seen - GRID) if what == 0.0 else losing(1e3 * ERRORS, what)]
    found = made(tmp_path, head, *columns, **more)
    assert [r[:22] for r in found.remarks if "not seen" in r][:1] == ["left out: lines 6, 11:"]
    assert len(found.experiment) == COUNT - 2
    places = form in ("px", "joints", "joints meas")
    np.testing.assert_allclose(read(found), (GRID * places + ERRORS)[KEPT], atol=1e-9)


def test_a_command_of_nines_is_no_lost_target(tmp_path: Path) -> None:
    found = made(tmp_path, "x [mm];y [mm];z [mm];dx [um];dy [um];dz [um]", losing(GRID, 9999.0), 1e3 * ERRORS)
    assert len(found.experiment) == COUNT
    np.testing.assert_allclose(found.experiment.position[4], 9.999)
    assert not any("not seen" in r for r in found.remarks)


def test_places_that_are_called_differences_keep_their_rows(tmp_path: Path) -> None:
    """Some of them are as large as their commands, as where a target was not seen."""
    seen = GRID + ERRORS
    mapped = {"dx": "Xm", "dy": "Ym", "dz": "Zm"}
    found = made(tmp_path, "X;Y;Z;Xm;Ym;Zm", GRID, seen, columns=mapped, units={"length": "mm"})
    np.testing.assert_allclose(read(found), seen, atol=1e-6)
    assert "--map px=" in found.warnings[0]
