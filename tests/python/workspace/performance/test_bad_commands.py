"""Bad input of `measures`, `efforts` and `optimize` on the command line: one message, exit code 2."""

from __future__ import annotations

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.ui.cli.app import main
from stiffmap.workspace.design import load_design

DESIGN = """
name: d
machine: orthoglide-revised
variables: {c: {low: 1, high: 2}}
numbers: {"templates.leg.body[carriage].mass": c}
objectives: [OBJECTIVE]
constraints: {mass: {at_most: 3 kg}}
search: {population: 4, generations: 1, nodes: 2}
"""
PLACE = 1e3 * 0.775 / np.sqrt(6)  # on the diagonal, where the Orthoglide is singular
FILES = {
    "no_unit.yaml": "name: r\nrequirements: {velocity: {at_least: 60}}\n",
    "crossed.yaml": "name: r\nrequirements: {deflection: {at_least: 3 mm, at_most: 2 mm}}\n",
    "through.yaml": "name: out\nline: {start: [0 mm, 0 mm, 0 mm], end: [-450 mm, -450 mm, -450 mm]}\nduration: 1 s\n",
    "unknown.yaml": DESIGN.replace("OBJECTIVE", "beauty"),
    "doubled.yaml": DESIGN.replace("OBJECTIVE", "mass, mass"),
    "infeasible.yaml": DESIGN.replace("OBJECTIVE", "mass"),
}


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("measures orthoglide-revised --requirements no_unit.yaml", ["line 2", "unit is missing"]),
        (
            "measures orthoglide-revised --requirements crossed.yaml",
            ["at_least (3 mm) is above at_most (2 mm)"],
        ),
        ("measures orthoglide-revised --only beauty", ["unknown measure 'beauty'", "workspace"]),
        ("measures five-bar --only mass,mass", ["only: expected different names", "'mass' twice"]),
        ("optimize doubled.yaml -o out", ["objectives", "expected different names, got 'mass' twice"]),
        ("efforts tripteron through.yaml", ["needs masses", "legs 1, 2, 3"]),
        ("efforts orthoglide-revised through.yaml", ["passes a singularity", f"-{PLACE:.1f}", "t = 0.59"]),
        ("optimize unknown.yaml -o out", ["unknown objective 'beauty'", "path_compliance"]),
        ("optimize infeasible.yaml -o out --processes 1", ["mass is", "≤ 3 is required", "% off"]),
    ],
)
def test_one_message_and_exit_code_two(tmp_path, monkeypatch, capsys, command, words):
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    code = main(command.split())
    said = " ".join(capsys.readouterr().err.split())
    assert code == 2 and all(w in said for w in words), said


def test_a_box_wholly_outside_the_reach_is_refused(capsys):
    box = "--box=2000,2100,2000,2100,2000,2100"
    assert main(["measures", "orthoglide-revised", box, "--only", "velocity", "--nodes", "3"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "box is not within reach: 125 of 125 nodes" in said and "orthoglide-revised" in said


def test_a_box_outside_the_reach_says_where(capsys):
    box = "--box=-2000,300,-200,300,-200,300"
    main(["measures", "orthoglide-revised", box, "--only", "velocity", "--nodes", "3"])
    said = capsys.readouterr().out
    assert "not within reach" in said and "-2000.0" in said


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("templates.leg.body[carriage].mass", "templates.leg[2].mass"),
        ("templates.leg[2].mass", "templates.leg.body[carriage].mass"),
        ("workspace.x[0]", "workspace[x][0]"),
    ],
)
def test_a_number_of_a_design_has_one_place(tmp_path, one, other):
    path = tmp_path / "design.yaml"
    text = DESIGN.replace("OBJECTIVE", "mass").replace(
        '"templates.leg.body[carriage].mass": c', f'"{one}": c'
    )
    path.write_text(text, encoding="utf-8")
    load_design(path)
    path.write_text(text.replace(": c}", f': c, "{other}": 2}}'), encoding="utf-8")
    with pytest.raises(sm.StiffmapError, match=r"numbers.*another place above is the same number"):
        load_design(path)
