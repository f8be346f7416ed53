"""Every column may have its own unit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm

PLAIN = """machine: orthoglide-revised
quantity: deflection
units: {length: mm, force: N, angle: deg}
noise: {dx: 0.003, rx: 0.01}
"""
MIXED = """machine: orthoglide-revised
quantity: deflection
units: {length: mm, force: N, temperature: degC, dx: um, x: cm, fx: kN, mz: N*m, rx: mrad}
noise: {dx: 3, rx: 0.17453292519943295}
"""
ROWS = "x,y,z,fx,fy,fz,mz,temperature,u_dx,dx,rx\n10,20,30,100,0,5,2000,20.5,0.004,0.101,0.02\n"
OTHER = "x,y,z,fx,fy,fz,mz,temperature,u_dx,dx,rx\n1,20,30,0.1,0,5,2,20.5,4,101,0.3490658503988659\n"


def load(folder: Path, head: str, rows: str) -> sm.Experiment:
    folder.mkdir()
    (folder / "experiment.yaml").write_text(head)
    (folder / "data.csv").write_text(rows)
    return sm.load_experiment(folder)


def test_units_of_single_columns(tmp_path: Path) -> None:
    one, other = load(tmp_path / "a", PLAIN, ROWS), load(tmp_path / "b", MIXED, OTHER)
    for name in ("position", "wrench", "reading", "sigma"):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), rtol=1e-12)
    assert other.temperature is not None and other.temperature[0] == 20.5


def test_a_wrong_unit_names_its_column(tmp_path: Path) -> None:
    with pytest.raises(sm.StiffmapError, match=r"units\.dx"):
        load(tmp_path / "c", MIXED.replace("dx: um", "dx: N"), OTHER)
    with pytest.raises(sm.StiffmapError, match="did you mean"):
        load(tmp_path / "d", MIXED.replace("dx: um", "dxx: um"), OTHER)


@pytest.mark.parametrize("header", [" [mm]", '"a\nb"', "zz [mm]"])
def test_a_column_without_a_meaning_is_refused_by_its_name(header: str, tmp_path: Path) -> None:
    with pytest.raises(sm.StiffmapError, match="unknown column"):
        load(tmp_path / "e", PLAIN, ROWS.replace("temperature", header))


def test_a_second_command_has_the_unit_of_its_header(tmp_path: Path) -> None:
    head = "machine: ur10\nquantity: position\nunits: {length: mm}\ncommand:\n"
    head += "".join(f"  q{k}: {{actuator: arm.joint_{k}, unit: deg}}\n" for k in range(1, 7))
    names = [f"q{k}" for k in range(1, 7)]
    said = {unit: ",".join([*names, *(f"{n}2{unit}" for n in names), "dd"]) for unit in ("", " [mrad]")}
    first, second = "10,-80,70,20,30,40", (20.0, -70.0, 60.0, 30.0, 20.0, 10.0)
    cells = {"": second, " [mrad]": tuple(1e3 * np.radians(second))}
    plain, other = (
        load(
            tmp_path / f"f{len(u)}",
            head,
            f"{said[u]}\n{first},{','.join(map(repr, map(float, cells[u])))},0.1\n",
        )
        for u in said
    )
    assert plain.other_command is not None and other.other_command is not None
    np.testing.assert_allclose(other.other_command, plain.other_command, rtol=1e-12)
