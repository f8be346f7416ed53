"""A saved machine loads back equal, floats exactly."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from tests.python.model.files.full_machine import full_machine

from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.model.addresses import number
from stiffmap.model.description import AppliedEffect, Body, Leg, MachineDescription, Point
from stiffmap.model.files import description_text, load_description, save_description
from stiffmap.model.files.shipped import machine_names


@pytest.mark.parametrize("name", machine_names())
def test_shipped_machines(name: str, tmp_path: Path) -> None:
    machine = load_description(name)
    save_description(machine, tmp_path / "m.yaml")
    assert load_description(tmp_path / "m.yaml") == machine


@pytest.mark.parametrize("seed", range(20))
def test_everything_a_description_can_hold(seed: int, tmp_path: Path) -> None:
    machine = full_machine(seed)
    save_description(machine, tmp_path / "m.yaml")
    back = load_description(str(tmp_path / "m.yaml"))
    assert back == machine
    assert back.legs == machine.legs


def test_legs_that_are_alike_share_a_template() -> None:
    text = description_text(load_description("tripteron"))
    assert text.count("actuator: actuator") == 1
    assert text.count("template: leg") == 3


def test_a_machine_that_a_file_cannot_hold_is_refused() -> None:
    odd = replace(full_machine(), extra=(("map", {"a": 1}),))
    with pytest.raises(StiffmapError, match="would not keep its extra"):
        description_text(odd)
    twice = replace(full_machine(), legs=(Leg("a", (Body("b", 1.0), Body("b", 1.0))),))
    with pytest.raises(StiffmapError, match="'b' is taken"):
        description_text(twice)


def test_unwritable(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="cannot be written"):
        save_description(load_description("tripteron"), tmp_path / "nowhere" / "m.yaml")


def heavier(description: MachineDescription, records: tuple[AppliedEffect, ...]) -> MachineDescription:
    """Stands for the effects module: one record adds a point on the platform."""
    points = tuple(Point(f"effect{i}", (r.parameters[0][1], 0.0, 0.0)) for i, r in enumerate(records))
    return replace(description, platform=description.platform + points, effects=records)


RECORD = AppliedEffect("dead_zone", "actuator", ("1", "2"), (("half_width", 1.2e-5),), (("where", "drive"),))


def test_effects_are_saved_beside_the_declared_machine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("stiffmap.model.files.load.apply_records", heavier)
    base = load_description("tripteron")
    changed = replace(heavier(base, (RECORD, RECORD)), declared=base)
    save_description(changed, tmp_path / "m.yaml")
    assert "effect0" not in (tmp_path / "m.yaml").read_text(encoding="utf-8")
    back = load_description(tmp_path / "m.yaml")
    assert back == changed
    assert back.declared == base
    assert back.effects == (RECORD, RECORD)


def test_effects_without_the_declared_machine_are_refused() -> None:
    with pytest.raises(StiffmapError, match="declared"):
        description_text(replace(load_description("tripteron"), effects=(RECORD,)))


@pytest.mark.parametrize(
    "section",
    ["round: {diameter: {value: 0.03, u: 0.0001}}", "tube: {outer: 0.03, inner: {value: 0.02, u: 0.001}}"],
)
def test_a_beam_is_saved_with_the_numbers_that_are_uncertain(section: str, tmp_path: Path) -> None:
    units = "{length: m, force: N, angle: rad}"
    beam = f"{{length: 0.3, along: y, {section}, material: {{E: {{value: 7.0e10, u: 1.0e9}}, nu: 0.3}}}}"
    joint = "{actuator: q, kind: revolute, axis: z, rigid: true}"
    text = f"name: a\nunits: {units}\nlegs:\n  arm:\n    elements:\n    - {joint}\n    - {{spring: s, beam: {beam}}}\n"
    (tmp_path / "a.yaml").write_text(text)
    machine = load_description(tmp_path / "a.yaml")
    save_description(machine, tmp_path / "b.yaml")
    again = load_description(tmp_path / "b.yaml")
    assert again == machine
    assert len(again.uncertainty) == 2
    assert all(number(again, address) == number(machine, address) for address, _ in machine.uncertainty)
