"""Design files, the search, resuming, and machines that are written."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from tests.python.model.addresses.test_numbers import guessed

import stiffmap as sm
import stiffmap.workspace.design
from stiffmap.common import python_file
from stiffmap.common.arithmetic import evaluate
from stiffmap.model.files.shipped import find
from stiffmap.workspace.design import load_design, optimize
from stiffmap.workspace.design.judging import judge
from stiffmap.workspace.design.search import Evaluations
from stiffmap.workspace.performance.motion.inertia import moving_mass

pytest.importorskip("pymoo")

FILE = """
name: small
machine: orthoglide-revised
variables:
  carriage: {low: 1, high: 9}
  diameter: {low: 1.0e-5, high: 2.0e-4}
derived: {bar: carriage / 2}
numbers:
  templates.leg.body[carriage].mass: carriage
  templates.leg.block[parallelogram].branches.low.body[bar].mass: bar
  templates.leg.actuator[actuator].compliance: diameter
objectives: [mass, frequency]
constraints: {mass: {at_most: 45 kg}}
search: {population: 8, generations: 3, seed: 4, nodes: 2}
"""


def write(tmp_path: Path, text: str = FILE) -> Path:
    path = tmp_path / "small.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_numbers_of_the_machine_file_change(tmp_path):
    design = load_design(write(tmp_path))
    machine = design.machine(np.array([4.0, 1e-4]))
    # three legs: carriage, low bar at half of it, high bar as declared; the platform
    assert moving_mass(machine) == pytest.approx(3 * (4 + 2 + 2.4) + 6)


def test_the_same_seed_finds_the_same_set_also_after_a_kill(tmp_path):
    path = write(tmp_path)
    whole = optimize(path, folder=tmp_path / "a", processes=1)
    lines = (tmp_path / "a/evaluations.jsonl").read_text(encoding="utf-8").splitlines()
    broken = tmp_path / "b"
    broken.mkdir()
    kept = lines[:11]
    row = json.loads(kept[4])
    kept[4] = json.dumps({**row, "f": [10**400]})  # more than a number holds
    kept[5] = json.dumps({**json.loads(kept[5]), "g": [0.0] * 9})  # not of this design
    # killed in the middle of writing a line of the second generation
    (broken / "evaluations.jsonl").write_text("\n".join(kept) + "\n" + lines[11][:20], encoding="utf-8")
    again = optimize(path, folder=broken, processes=1)
    np.testing.assert_array_equal(whole.x, again.x)
    assert whole.history == again.history
    assert len(lines) == 1 + 8 * 3 and "x" in json.loads(lines[1])


def test_no_design_of_the_set_is_bettered_and_all_hold(tmp_path):
    found = optimize(write(tmp_path), processes=1)
    f = np.array([j.objectives for j in found.judged])
    for i in range(len(f)):
        assert not ((f <= f[i]).all(axis=1) & (f < f[i]).any(axis=1)).any()
    assert all((j.violations <= 0).all() for j in found.judged)
    assert found.history[-1][2] >= found.history[0][2]


def test_an_infeasible_problem_says_what_is_missed_and_by_how_much(tmp_path):
    path = write(tmp_path, FILE.replace("at_most: 45 kg", "at_most: 10 kg"))
    with pytest.raises(
        sm.StiffmapError, match=r"none of 24 designs .* mass is .* kg where ≤ 10 is required \(.* % off\)"
    ):
        optimize(path, processes=1)


def test_a_design_that_cannot_be_is_infeasible_not_an_error(tmp_path):
    design = load_design(write(tmp_path))
    judged = judge(design, np.array([4.0, -1.0]))
    assert judged.reason and (judged.violations > 0).all()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "[mass, frequency]",
            "[mass, beauty]",
            r"unknown objective 'beauty' \(number 2\); known: .*frequency",
        ),
        ("low: 1, high: 9", "low: 9, high: 1", r"carriage: low \(9\) must be below high \(1\)"),
        (
            "body[carriage]",
            "body[cart]",
            r"expected one body named 'cart', found 0; here are: .*body\[carriage\]",
        ),
        ("carriage / 2", "cariage / 2", r"derived: unknown name 'cariage'; known: .*carriage"),
        ("].compliance: diameter", "].compliance: 1e-4", "line 6: variables.diameter: no expression uses"),
        ("at_most: 45 kg", "at_most: 45", r"constraints\.mass\.at_most: the unit is missing"),
        (
            "templates.leg.actuator[actuator].compliance",
            "templates.leg.actuator[actuator].complianse",
            r"no 'complianse' there",
        ),
    ],
)
def test_bad_design_files(tmp_path, old, new, words):
    with pytest.raises(sm.StiffmapError, match=words):
        load_design(write(tmp_path, FILE.replace(old, new)))


def test_expressions_run_arithmetic_only():
    assert evaluate("-(r + L)/2 + sqrt(4)*pi**0", {"r": 1.0, "L": 3.0}) == 0.0
    for text in ("__import__('os')", "a.b", "[1]", "1/0", "f(2)"):
        with pytest.raises(sm.StiffmapError):
            evaluate(text, {"a": 1.0})


def test_the_shipped_redesign_starts_from_a_sound_machine():
    design = load_design("redesign")
    low, high = design.bounds
    judged = judge(design, (low + high) / 2)
    assert not judged.reason and np.isfinite(judged.violations).all()


def test_a_search_asks_for_the_transmission_of_its_task(tmp_path):
    """The largest box about the centre: nearly a point where every factor has to be 1."""
    edges = []
    for most in ("1.02", "2.5"):
        task = tmp_path / f"task-{most}.yaml"
        box = "box: {x: 400 mm, y: 400 mm, z: 400 mm}"
        task.write_text(f"name: task\n{box}\nrequirements:\n  transmission_max: {{at_most: {most}}}\n")
        text = FILE.replace("objectives: [mass, frequency]", "objectives: [mass, largest_box]").replace(
            "nodes: 2", "nodes: 9"
        )
        design = load_design(write(tmp_path, text + f"requirements: {task.name}\n"))
        edges.append(judge(design, np.mean(design.bounds, axis=0)).values["largest_box"])
    assert edges[0] < 0.3 * edges[1]


def test_quick_judgement_is_that_of_the_full_measures():
    """At the same nodes: factors, speed and force alike; the deflection in its worst direction."""
    design = load_design("redesign")
    low, high = design.bounds
    x = (low + high) / 2
    quick = judge(design, x).values
    n = design.model.search.nodes
    full = sm.measures(
        design.machine(x), requirements=design.requirements, nodes=n, coarse=n,
        only=["velocity", "force", "transmission_min", "transmission_max", "mass", "footprint"],
    )  # fmt: skip
    for row in full.rows:
        assert quick[row.measure.name] == pytest.approx(row.found.worst, rel=1e-9), row.measure.name
    d = sm.worst_deflection(
        design.machine(x), box=[full.case.low, full.case.high], force=300.0, nodes=n, refine=False
    )
    assert quick["deflection"] == pytest.approx(d.value, rel=2e-3)


@pytest.mark.parametrize("line", ["", "[]", '{"x": 3}', "[" * 100_000])
def test_evaluations_of_an_unknown_design_are_refused(tmp_path, line):
    path = tmp_path / "evaluations.jsonl"
    path.write_text(line + "\n", encoding="utf-8")
    with pytest.raises(sm.StiffmapError, match=r"evaluations.jsonl, line 1: is damaged"):
        Evaluations(load_design(write(tmp_path)), path)


def test_a_search_that_is_killed_goes_on(tmp_path, monkeypatch):
    """SIGKILL in the middle: the same command ends with the set of a search that was left alone."""
    monkeypatch.setattr(
        python_file, "_RUN", {}
    )  # files of other tests in this process: part of a design's key
    path = write(tmp_path, FILE.replace("generations: 3", "generations: 6"))
    code = f"from stiffmap.workspace.design import optimize; optimize({str(path)!r}, folder={str(tmp_path / 'b')!r}, processes=1)"
    running = subprocess.Popen([sys.executable, "-c", code])
    kept = tmp_path / "b/evaluations.jsonl"
    until = time.monotonic() + 120
    while not (kept.exists() and kept.read_bytes().count(b"\n") > 9):
        assert running.poll() is None and time.monotonic() < until
        time.sleep(0.002)
    running.kill()
    running.wait()
    before = kept.read_bytes().count(b"\n")
    again, whole = optimize(path, folder=tmp_path / "b", processes=1), optimize(path, processes=1)
    np.testing.assert_array_equal(again.x, whole.x)
    assert again.history == whole.history and 9 < before <= 1 + 8 * 6


def test_masses_of_links_follow_their_sections(tmp_path):
    """A variable of a section changes the mass as well, by hand: three legs of one tube each."""
    text = Path(stiffmap.workspace.design.__file__).with_name("trimmer.yaml").read_text(encoding="utf-8")
    text = text.replace("nu: 0.3}", "nu: 0.3, density: 7.85e-6}")
    for _ in range(2):
        text = text.replace(
            "{body: bar, mass: 1.07, com: [387.5, 0, 0], inertia: [0, 53600, 53600]}", "{body: bar, of: bar}"
        )
    (tmp_path / "own.yaml").write_text(text, encoding="utf-8")
    path = tmp_path / "design.yaml"
    path.write_text(
        """
name: sections
machine: own.yaml
variables: {outer: {low: 28, high: 40}}
numbers:
  templates.leg.block[parallelogram].branches.low.spring[bar].beam.tube.outer: outer
  templates.leg.block[parallelogram].branches.high.spring[bar].beam.tube.outer: outer
objectives: [mass]
""",
        encoding="utf-8",
    )
    design = load_design(path)
    for outer in (30.0, 36.0):
        bar = 7.85e-6 * np.pi / 4 * (outer**2 - 26**2) * 775
        assert judge(design, np.array([outer])).values["mass"] == pytest.approx(
            3 * (5 + 2 * bar) + 6, rel=1e-9
        )


@pytest.mark.parametrize(("seed", "bar", "value"), [(2, "forearm", 300.0), (11, "arm", 270.0)])
def test_a_home_that_is_searched_for_keeps_its_branch(seed, bar, value, tmp_path):
    """As `with_number` keeps it, which goes over in small steps (model/addresses/test_numbers.py)."""
    text = guessed(find("five-bar").read_text("utf-8"), seed)
    (tmp_path / "machine.yaml").write_text(text, encoding="utf-8")
    places = [f"legs.{leg}.elements.offset[{bar}_length].translation[0]" for leg in ("left", "right")]
    given = {
        "name": "d",
        "machine": "machine.yaml",
        "variables": {"a": {"low": 200, "high": 500}},
        "numbers": dict.fromkeys(places, "a"),
        "objectives": ["mass"],
    }
    (tmp_path / "design.yaml").write_text(json.dumps(given), encoding="utf-8")
    design = load_design(tmp_path / "design.yaml")
    machine = sm.load_machine(tmp_path / "machine.yaml")
    wanted = machine.with_number(f"{bar}_length/length", value / 1e3).compiled.home_coordinates()
    made = design.machine(np.array([value]))
    np.testing.assert_allclose(made.compiled.home_coordinates(), wanted, atol=1e-7)
