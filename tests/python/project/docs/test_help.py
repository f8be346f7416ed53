"""Every example of every ``--help`` runs, in a folder that holds the files they speak of; with --json it obeys its schema."""

from __future__ import annotations

import importlib.util
import re
import shlex
import shutil
from inspect import getdoc
from pathlib import Path

import numpy as np
import pytest
from tests.python.project.docs.json_schemas import obeys
from tests.python.project.docs.reader_files import FORCES, ROBOT, force_signals, link_tables

import stiffmap as sm
from stiffmap.common.outputs import one_command, write_text
from stiffmap.ui.cli import main
from stiffmap.ui.cli.app import load
from stiffmap.ui.cli.commands import COMMANDS
from stiffmap.workspace.design.chosen import measured

ROOT = Path(__file__).parents[4]
SHIPPED = ROOT / "python/stiffmap"
SERVO = ROOT / "tests/data/experiments/A-servo"
MADE_SMALLER = {  # the last word counts
    "optimize my_design": ("--generations", "1", "--processes", "1"),
    "lobes": ("--points", "4,3"),
    "paper": ("--points", "5"),
    **{
        f"map orthoglide-revised --{more}": ("--points", "5", "--no-pictures")
        for more in ("force", "gravity", "points")
    },
    "map orthoglide-revised --toolpath": (),
    "map orthoglide": ("--points", "5"),
    "map my_machine": ("--points", "5", "--no-pictures"),
    "map tripteron": ("--points", "5", "--no-pictures"),
    "bench": ("--rounds", "1"),
    "measures orthoglide-revised --requirements": (
        *("--nodes", "3", "--coarse", "3"),
        *("--only", "velocity,force,deflection,transmission_min,transmission_max"),
    ),
    "measures": ("--nodes", "3", "--coarse", "3"),
    "link bar": ("--quick", "--size", "6"),
    "link bracket": ("--quick",),
}
RUN_ELSEWHERE = {
    "tcp://HOST": "a cluster of the reader's; tests/python/common/tasks has one",
    "optimize redesign": "my_design.yaml is this file with a smaller search",
}
OUTLINE = "G21 G90 G17 S18000 M3\nG0 X0 Y0 Z0\nG1 X60 F2000\nG3 X70 Y10 I0 J10\nG1 Y40\nM5\nM2\n"
MORE_CLOCKS = (
    "x [mm];y [mm];Fx [N];Fy [N];dx [mm];dy [mm]\n0;416;100;0;0,3515;0,01\n50;416;0;-100;0,02;-0,3499\n"
)
TRACKER = """Point ID;X Nominal;Y Nominal;Z Nominal;X [mm];Y [mm];Z [mm];Temp
A1;0,0;0,0;700,0;0,012;-0,020;700,004;20,1
A2;50,0;20,0;700,0;50,031;19,991;699,998;20,2
"""


def examples(function: object) -> list[str]:
    """The command lines of a docstring, without the formatting of ``--help``."""
    return re.findall(
        r"\[cyan\]((?:\w+=\w+ )?stiffmap .*?)\[/cyan\]", " ".join((getdoc(function) or "").split())
    )


TAPS = Path(__file__).parents[4] / "examples/taps"


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files of the examples."""
    return make_workshop(tmp_path_factory.mktemp("workshop"))


def make_workshop(at: Path) -> Path:
    """The files, in this folder."""

    def simulate(machine: str, name: str, *more: str) -> None:
        assert main(["simulate", machine, "--poses", "6", *more, "-o", str(at / name)]) == 0

    assert main(["new", str(at / "my_machine.yaml")]) == 0
    machine = sm.load_machine("orthoglide-revised").with_effect(
        "length", element="bar", legs=["x"], error=1e-4
    )
    with one_command():  # as earlier commands wrote them, so that the examples may replace them
        for name in ("corrected.yaml", "result/machine.yaml", "my.yaml"):
            (at / name).parent.mkdir(exist_ok=True)
            machine.save(at / name)
        write_text(at / "arm.urdf", ROBOT)
        sm.import_urdf(at / "arm.urdf").save(at / "calibrated_arm.yaml")
    for name in ("experiments/servo", "dial_gauges"):
        simulate("orthoglide-revised", name, "--effect", "compliance actuator z scale=2")
    shutil.copytree(SERVO.parent, at / "measured")
    simulate("linear-delta", "experiments/heights", "--quantity", "position")
    simulate("ur10", "experiments/tracker", "--quantity", "position")
    shutil.copytree(at / "experiments/tracker", at / "tracker")
    simulate(
        "orthoglide-revised", "held_out", "--quantity", "position", "--effect", "length bar x error=0.1mm"
    )
    for month, seed in (("january", "1"), ("june", "2")):
        simulate(
            "orthoglide-revised", month, "--seed", seed, "--effect", "dead_zone actuator y half_width=10um"
        )
    assert (
        main(["map", "orthoglide-revised", "--points", "5", "--no-pictures", "-o", str(at / "results")]) == 0
    )
    (at / "poses.csv").write_text("x [mm],y [mm],z [mm]\n0,0,0\n100,-50,80\n", encoding="utf-8")
    (at / "my_poses.csv").write_text("x,y,z,fx\n0,0,0,100\n100,-50,80,200\n", encoding="utf-8")
    p = np.array(sm.load_machine("ur10").description.home.p) * 1e3
    path = [p, p + [20, 30, -10], p + [40, 0, 0]]
    rows = "\n".join(",".join(f"{v:.3f}" for v in q) for q in path)
    (at / "path_small.csv").write_text("x [mm],y [mm],z [mm]\n0,0,0\n50,0,0\n", encoding="utf-8")
    (at / "path_flat.csv").write_text(
        "x [mm],y [mm],z [mm],fx [N]\n0,400,0,0\n50,420,0,90\n", encoding="utf-8"
    )
    (at / "path.csv").write_text(f"x [mm],y [mm],z [mm]\n{rows}\n", encoding="utf-8")
    (at / "cut.yaml").write_text(
        "name: cut\nline: {start: [-100 mm, 0 mm, 0 mm], end: [150 mm, 100 mm, -100 mm]}\nduration: 2 s\n",
        encoding="utf-8",
    )
    clocks = "x [mm];y [mm];Fx [N];Uhr 1 [µm];Uhr 2 [µm]\n0;416;100;351,5;352,1\n50;416;-100;-350,2;-349,9\n"
    (at / "clocks.csv").write_text(clocks, encoding="utf-8")
    (at / "more_clocks.csv").write_text(MORE_CLOCKS, encoding="utf-8")
    shutil.copy(SHIPPED / "machining/process/library/trimming.yaml", at)
    shutil.copytree(TAPS, at / "examples/taps")
    (at / "forces.csv").write_text(FORCES, encoding="utf-8")
    (at / "signals.csv").write_text(force_signals(), encoding="utf-8")
    (at / "outline.ngc").write_text(OUTLINE, encoding="utf-8")
    (at / "points.csv").write_text(TRACKER, encoding="utf-8")
    _workbook(at / "readings.xlsx")
    dh = "theta [deg],d [mm],a [mm],alpha [deg]\n0,89,0,90\n0,0,-425,0\n0,0,-392,0\n0,109,0,90\n0,95,0,-90\n0,82,0,0\n"
    (at / "arm_dh.csv").write_text(dh, encoding="utf-8")
    rows = "".join(f"{k},{-60 + 5 * k},90,-120,-90,{3 * k},{400 + k},{2 * k},{300 - k}\n" for k in range(8))
    head = "q1,q2,q3,q4,q5,q6,px [mm],py [mm],pz [mm]\n"
    (at / "joints.csv").write_text(head + rows, encoding="utf-8")
    (at / "delta.urdf").write_text(ROBOT.replace('"arm"', '"delta"'), encoding="utf-8")
    (at / "robot.yaml").write_text(
        "actuators:\n  q1: {stiffness: 4.0e4}\n  q2: {stiffness: 3.0e4}\n", encoding="utf-8"
    )
    _parts(at)
    design = (SHIPPED / "workspace/design/redesign.yaml").read_text(encoding="utf-8")
    design = re.sub(
        r"search: \{.*?\}",
        "search: {method: nsga2, population: 4, generations: 1, seed: 1, nodes: 3}",
        design,
    )
    design = design.replace("objectives: [mass, footprint]", "objectives: [mass]")
    design = design.replace("beside: [orthoglide-revised]\n", "")
    shutil.copy(SHIPPED / "workspace/design/trimmer.yaml", at)
    (at / "my_design.yaml").write_text(design, encoding="utf-8")
    return at


def _parts(at: Path) -> None:
    """A bar, a block with a hole (its faces are numbered 1 to 7), and a displacement field of an end face."""
    (at / "bar.yaml").write_text(
        "units: {length: mm, stress: GPa}\npart: {shape: bar, length: 60, width: 10, height: 20}\n"
        "material: {young: 210, poisson: 0.3}\n",
        encoding="utf-8",
    )
    field, cases = link_tables()
    (at / "field.csv").write_text(field, encoding="utf-8")
    (at / "cases.csv").write_text(cases, encoding="utf-8")
    if importlib.util.find_spec("gmsh") is None:
        return
    from stiffmap.model.link.gmshmesh import gmsh_session

    with gmsh_session() as gmsh:
        block = gmsh.model.occ.addBox(0, 0, 0, 40, 20, 20)
        hole = gmsh.model.occ.addCylinder(30, -1, 10, 0, 22, 0, 4)
        gmsh.model.occ.cut([(3, block)], [(3, hole)])
        gmsh.model.occ.synchronize()
        gmsh.write(str(at / "bracket.step"))


def _workbook(path: Path) -> None:
    book = pytest.importorskip("openpyxl").Workbook()
    book.active.append(["x [mm]", "y [mm]", "z [mm]", "Fx [N]", "dx [µm]", "dy [µm]"])
    book.active.append([0, 416, 0, 100, 351.5, 12.0])
    book.active.append([50, 416, 0, -100, -349.5, -11.0])
    book.save(path)


def diagnosed(experiment: Path, folder: Path) -> None:
    """A diagnosis as `stiffmap diagnose` leaves it, without its pictures."""
    found = sm.diagnose("orthoglide-revised", experiment, cross_validate=False)
    (folder / "diagnosis.json").write_text(found.to_json(), encoding="utf-8")


@pytest.mark.parametrize("name", [c.name for c in COMMANDS])
def test_examples_run(
    name: str, workshop: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if name == "link":
        pytest.importorskip("gmsh", reason="needs the extra [fea]", exc_type=(ImportError, OSError))
    if name == "compensate":  # goes on from a map, which the examples of `map` replace
        main(["map", "orthoglide-revised", "--points", "5", "--no-pictures", "-o", str(workshop / "results")])
    if name == "monitor":  # goes on from a diagnosis
        diagnosed(workshop / "january", workshop / "january")
    if name == "bench":
        for size in ("GRID", "REFERENCE_GRID", "MANY"):
            monkeypatch.setattr(f"stiffmap.ui.cli.bench.{size}", 3)
    if (
        name == "optimize"
    ):  # what refines and measures a design takes as many rounds, draws and nodes as it is given
        for number, few in {"ROUNDS": 1, "RADII": (0.1,)}.items():
            monkeypatch.setattr(f"stiffmap.workspace.design.judging.{number}", few)
        monkeypatch.setattr(measured, "__defaults__", (3, 2))
    if name == "view":  # serves until it is interrupted
        opening = pytest.importorskip("stiffmap.ui.view.open", reason="needs the extra [view]")
        monkeypatch.setattr(opening.View, "wait", opening.View.close)
        monkeypatch.setattr("webbrowser.open", lambda *_: True)
        diagnosed(workshop / "experiments/servo", workshop / "result")
    if name == "diagnose":  # into a folder that the example of `view` may have filled
        shutil.rmtree(workshop / "result", ignore_errors=True)
    (workshop / name).mkdir(exist_ok=True)
    monkeypatch.chdir(workshop / name if name == "new" else workshop)
    command = next(c for c in COMMANDS if c.name == name)
    lines = examples(load(command))
    assert lines, f"stiffmap {name} --help has no example"
    lines = [line for line in lines if not any(part in line for part in RUN_ELSEWHERE)]
    capsys.readouterr()
    for line in lines:
        words = shlex.split(line)
        while "=" in words[0]:
            key, _, value = words.pop(0).partition("=")
            monkeypatch.setenv(key, value)
        smaller = next(
            (more for start, more in MADE_SMALLER.items() if line.startswith(f"stiffmap {start}")), ()
        )
        code = main([*words[1:], *smaller, "--json"])
        out = capsys.readouterr()
        assert code in (0, 1), f"{line}: {code}: {out.err}"
        obeys(name, out.out)
