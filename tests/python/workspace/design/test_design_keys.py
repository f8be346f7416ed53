"""A search takes up evaluations of the same problem only: whatever an answer depends on is in its key."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import stiffmap as sm
from stiffmap.common import fingerprints, python_file
from stiffmap.model.files.shipped import find
from stiffmap.workspace.design import load_design
from stiffmap.workspace.design.judging import judge
from stiffmap.workspace.design.search import Evaluations

DESIGN = """
name: linked
machine: machine.yaml
requirements: task.yaml
toolpath: path.csv
beside: [other.yaml]
variables: {mass: {low: 1, high: 9}}
numbers: {"templates.leg.body[carriage].mass": mass}
objectives: [frequency]
search: {population: 4, generations: 1, nodes: 2}
"""


def link(size: float) -> str:
    rows = [[size * (i == k) for k in range(6)] for i in range(6)]
    return (
        "kind: stiffmap-link\nname: bar\nunits: {length: m, force: N, angle: rad}\nreference: [0.0, 0.0, 0.0]\n"
        f"compliance: {rows}\nstandard_error: {rows}\nprovenance: {{nodes: 12}}\n"
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    machine = find("orthoglide-revised").read_text(encoding="utf-8")
    head, _, tail = machine.partition("- spring: bar\n")
    assert tail
    lines = tail.splitlines(keepends=True)
    while "branches" not in lines[0] and not lines[0].lstrip().startswith(("-", "high")):
        lines.pop(0)
    text = f"{head}- {{spring: bar, link: bar-link.yaml}}\n{''.join(lines)}".replace(
        "compliance: *bar", "link: bar-link.yaml"
    )
    (tmp_path / "machine.yaml").write_text(text, encoding="utf-8")
    (tmp_path / "other.yaml").write_text(machine, encoding="utf-8")
    (tmp_path / "bar-link.yaml").write_text(link(1e-7))
    (tmp_path / "task.yaml").write_text("name: task\nrequirements: {frequency: {at_least: 1 Hz}}\n")
    (tmp_path / "path.csv").write_text("x [mm],y [mm],z [mm]\n0,0,0\n10,0,0\n20,0,0\n30,0,0\n40,0,0\n")
    (tmp_path / "design.yaml").write_text(DESIGN)
    return tmp_path


def changed(name: str, old: str, new: str) -> Callable[[Path, pytest.MonkeyPatch], None]:
    def change(folder: Path, _: pytest.MonkeyPatch) -> None:
        path = folder / name
        text = path.read_text(encoding="utf-8")
        assert old in text
        path.write_text(text.replace(old, new, 1), encoding="utf-8")

    return change


def other_link(folder: Path, _: pytest.MonkeyPatch) -> None:
    (folder / "bar-link.yaml").write_text(link(2e-7))


def other_version(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fingerprints, "__version__", "9.9")


def other_code(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(python_file, "_RUN", {})
    (folder / "effect.py").write_text("EFFECT = None")
    python_file.run_python_file(folder / "effect.py", "effect", "an effect")


@pytest.mark.parametrize(
    "change",
    [
        other_link,
        other_version,
        other_code,
        changed("task.yaml", "1 Hz", "2 Hz"),
        changed("path.csv", "40,0,0", "41,0,0"),
        changed("other.yaml", "name:", "# a note\nname:"),
        changed("design.yaml", "high: 9", "high: 8"),
        changed("machine.yaml", "mass: ", "mass: 1"),
    ],
)
def test_evaluations_of_a_changed_problem_are_not_taken_up(
    change: Callable[[Path, pytest.MonkeyPatch], None], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    design = load_design(folder / "design.yaml")
    x = sum(design.bounds)[None] / 2  # type: ignore[index]
    kept = Evaluations(design, folder / "evaluations.jsonl")
    kept.add(x, [judge(design, x[0])])
    assert kept.get(x[0]).reason == ""
    again = Evaluations(load_design(folder / "design.yaml"), folder / "evaluations.jsonl")
    assert not again.missing(x)
    change(folder, monkeypatch)
    with pytest.raises(sm.StiffmapError, match="another design"):
        Evaluations(load_design(folder / "design.yaml"), folder / "evaluations.jsonl")


def test_a_map_is_not_taken_up_with_another_link_file(folder: Path) -> None:
    first, _ = (sm.load_machine(folder / "machine.yaml"), other_link(folder, None))  # type: ignore[arg-type]
    from stiffmap.workspace.maps.loading import machine_digest

    assert machine_digest(first) != machine_digest(sm.load_machine(folder / "machine.yaml"))
