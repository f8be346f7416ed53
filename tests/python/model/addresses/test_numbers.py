"""A machine in memory: its numbers by address, machines of other numbers, machines from text and plain data."""

from __future__ import annotations

import re
from dataclasses import replace
from math import acos, atan2, hypot
from pathlib import Path

import numpy as np
import pytest
import yaml
from tests.python.model.files.full_machine import full_machine

import stiffmap as sm
from stiffmap.common.errors import HomeError, StiffmapError
from stiffmap.model.addresses import known_values, listed, moved, number, with_values
from stiffmap.model.addresses.setting import every_address
from stiffmap.model.files.shipped import find
from stiffmap.solve.starters import CLASSES, machine_text

FORCE = [100.0, 50.0, 0, 0, 0, 0]


@pytest.mark.parametrize("name", sm.machine_names())
def test_every_number_has_an_address_that_gives_and_takes_it(name: str) -> None:
    d = sm.load_machine(name).description
    rows = listed(d)
    assert len({r.address for r in rows}) == len(rows)
    for r in rows:
        assert known_values(d, r.address) == [r.value], r.address
    assert with_values(d, {r.address: r.value for r in rows}) == d
    for address in every_address(d):
        assert len(known_values(d, address)) == 1


def test_the_table_has_uncertainty_unit_and_note() -> None:
    t = sm.load_machine("linear-delta").numbers()
    row = t.loc["a.carriage/stiffness"]
    assert (row.value, row.unit, row.note) == (2.5e6, "N/m", "declared: belt and motor")
    assert row.u == pytest.approx(2.5e5)
    assert list(t.columns) == ["value", "unit", "u", "source", "note"]
    assert t.loc["a.carriage/friction.viscous"].unit == "N·s/m"
    text = (
        find("five-bar")
        .read_text(encoding="utf-8")
        .replace("- actuator: motor", "- actuator: motor\n        damping: 2", 1)
    )
    assert sm.load_machine(text).numbers().filter(like="/damping", axis=0).unit.item() == "N·m·s/rad"


def test_the_uncertainty_of_an_end_of_a_range_is_at_its_address() -> None:
    text = find("linear-delta").read_text(encoding="utf-8")
    ends = re.search(r"range: \[(\S+), (\S+)\]", text)
    assert ends
    uncertain = f"range: [{{value: {ends[1]}, u: 2}}, {{value: {ends[2]}, u: 3}}]"
    t = sm.load_machine(text.replace(ends[0], uncertain)).numbers()
    assert t.loc["a.carriage/range.low"].u == pytest.approx(2e-3)
    assert t.loc["a.carriage/range.high"].u == pytest.approx(3e-3)


def crank_angle(base: float, tip: tuple[float, float], arm: float, forearm: float, bend: int) -> float:
    """Of a five-bar's motor, by the law of cosines."""
    x, y = tip[0] - base, tip[1]
    r = hypot(x, y)
    return atan2(y, x) - bend * acos((arm**2 + r**2 - forearm**2) / (2 * arm * r))


@pytest.mark.parametrize("forearm", [0.36, 0.5, 0.65])
def test_a_bar_of_another_length_is_the_machine_of_a_file_with_it(forearm: float) -> None:
    """Geometry and stiffness, on the assembly branch that the machine has: law of cosines, and a file of its own."""
    machine = sm.load_machine(machine_text("five-bar", "m", {})).with_number("forearm/length", forearm)
    tip = (0.02, 0.43)
    angles = sm.inverse_kinematics(machine, [*tip, 0]).actuators
    by_hand = [crank_angle(x, tip, 0.3, forearm, b) for x, b in ((-0.15, -1), (0.15, 1))]
    assert angles == pytest.approx(by_hand, abs=1e-9)
    new = sm.load_machine(machine_text("five-bar", "m", {"forearm": 1e3 * forearm}))
    a, b = (m.solve([*tip, 0], FORCE) for m in (machine, new))
    assert a.displacement == pytest.approx(b.displacement, rel=1e-8, abs=1e-13)


def test_a_beam_alone_changes_its_compliance() -> None:
    machine = sm.load_machine(machine_text("gantry", "m", {}))
    wider = machine.with_numbers({"gantry.ram/beam.tube.outer": 0.2, "gantry.ram/beam.tube.inner": 0.17})
    file = sm.load_machine(machine_text("gantry", "m", {"tube": 200, "wall": 15}))
    home = machine.description.home.p
    assert wider.solve(home).compliance == pytest.approx(file.solve(home).compliance, rel=1e-12)
    assert "gantry.ram/compliance.k11" not in machine.numbers().index  # it follows from the beam
    with pytest.raises(StiffmapError, match="inner diameter must be smaller"):
        machine.with_number("ram/beam.tube.outer", 0.05)
    with pytest.raises(StiffmapError, match=r"above -1 and at most 0.5 .*; found -1"):
        machine.with_number("ram/beam.material.nu", -1.0)


def test_a_leg_a_name_or_a_branch() -> None:
    machine = sm.load_machine("linear-delta")
    d = machine.with_number("a.rod/length", 0.51).description
    assert [known_values(d, f"{leg}.rod/length") for leg in "abc"] == [[0.51, 0.51], [0.5, 0.5], [0.5, 0.5]]
    assert known_values(machine.with_number("rod/length", 0.51).description, "rod/length") == [0.51] * 6
    left = machine.with_number("a.left.rod/beam.material.E", 1e11).description
    assert known_values(left, "a.rod/beam.material.E") == [1e11, 1.2e11]
    soft = machine.with_number("carriage/compliance", 1e-6)
    assert soft.numbers().loc["c.carriage/stiffness"].value == 1e6


def test_effects_are_added_again() -> None:
    machine = sm.load_machine("orthoglide-revised")
    both = machine.with_effect("dead_zone", element="actuator", legs=["y"], half_width=1e-5).with_number(
        "bar/length", 0.8
    )
    other = machine.with_number("bar/length", 0.8).with_effect(
        "dead_zone", element="actuator", legs=["y"], half_width=1e-5
    )
    assert both == other


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("x.bar/lenght", "did you mean 'x.bar/length'"),
        ("x.foot/complianc.k11", "did you mean 'x.foot/compliance.k11'"),
        ("actuater/stiffness", "the nearest is 'actuator/stiffness'"),
        ("bar", "expected the address of a number, such as 'x.bar/length'"),
        ("x.low.bars/mass", "the nearest is 'x.low.bar/mass'"),
    ],
)
def test_unknown_addresses_name_the_nearest(address: str, said: str) -> None:
    with pytest.raises(StiffmapError, match=said.replace(".", r"\.")):
        sm.load_machine("orthoglide-revised").with_number(address, 1.0)


def test_bad_values_are_refused() -> None:
    machine = sm.load_machine("five-bar")
    for address, value in (("forearm/length", -1.0), ("motor/stiffness", 0.0), ("arm/mass", float("nan"))):
        with pytest.raises(StiffmapError, match=address):
            machine.with_number(address, value)
    with pytest.raises(HomeError, match="of the change"):
        machine.with_number("forearm/length", 3.0)


@pytest.mark.parametrize(
    ("name", "address", "value"),
    [
        ("five-bar", "motor/force", -1.0),
        ("orthoglide-revised", "actuator/speed", -1.0),
        ("orthoglide-revised", "x.actuator/friction.coulomb", -1.0),
        ("orthoglide-revised", "platform.platform/inertia.xx", -1.0),
        ("every number", "hose/stiffness", -1.0),
        ("every number", "hose/length", -0.1),
        ("orthoglide-revised", "x.actuator/range.low", 5.0),
        ("hexapod", "strut/range.high", 0.5),
        ("ur10", "workspace/x.low", 1.0),
    ],
)
def test_bounds_of_a_file_hold_for_numbers_at_addresses(name: str, address: str, value: float) -> None:
    d = full_machine() if name == "every number" else sm.load_machine(name).description
    with pytest.raises(
        StiffmapError, match=f"^{address.rpartition('.')[0] or address}.*(not negative|is not below)"
    ):
        with_values(d, {address: value})


@pytest.mark.parametrize("component", [(-9810.0, 0, 0), (0, 0, 9810.0), (0, 1000.1, 0)])
def test_gravity_is_in_si_wherever_it_is_given(component: tuple[float, float, float]) -> None:
    machine = sm.load_machine("five-bar")
    machine = sm.Machine(replace(machine.description, gravity=(0.0, 0.0, -9.81)))
    axis = int(np.argmax(np.abs(component)))
    with pytest.raises(StiffmapError, match=f"^gravity/{'xyz'[axis]}: expected -1000 to 1000"):
        machine.with_number(f"gravity/{'xyz'[axis]}", component[axis])
    with pytest.raises(StiffmapError, match=r"^gravity: expected 3 finite numbers up to 1000"):
        machine.solve(machine.description.home.p, gravity=component)


SAME = [
    ("five-bar", {"forearm/length": 0.41, "left.forearm/length": 0.42, "right.forearm/length": 0.43}),
    ("five-bar", {"left.arm/length": 0.31, "arm/length": 0.32}),
    ("five-bar", {"arm_length/translation.x": 0.31, "arm_length/length": 0.32}),
    ("ur10", {"base/stiffness": 1e5, "arm.base/stiffness": 2e5}),
    ("ur10", {"arm.base/stiffness": 1e5, "arm.base/compliance": 1e-6}),
]


@pytest.mark.parametrize(("name", "values"), SAME, ids=lambda v: v if isinstance(v, str) else " ".join(v))
def test_a_number_has_one_value(name: str, values: dict[str, float]) -> None:
    machine = sm.load_machine(name)
    first = next(iter(values))
    with pytest.raises(StiffmapError, match=f"^{first}: another address sets this number to "):
        machine.with_numbers(values)
    with pytest.raises(StiffmapError, match=f"^{first}: another address sets this number to "):
        sm.design_sweep(machine, {a: [v, 1.01 * v] for a, v in values.items()})
    with pytest.raises(StiffmapError, match=": another address sets this number to "):
        sm.design_sweep(machine, {a: [0.3, 0.31] for a in values})
    part = machine.with_numbers(dict(list(values.items())[-1:]))
    assert part != machine


def test_both_ends_of_a_range_change_together() -> None:
    changed = sm.load_machine("ur10").with_numbers({"workspace/x.low": 1.0, "workspace/x.high": 2.0})
    np.testing.assert_array_equal(changed.workspace[:, 0], [1.0, 2.0])


@pytest.mark.parametrize("name", ["linear-delta", "ur10", "every number"])
def test_moved_as_built_moves_that_number_by_as_much(name: str) -> None:
    """Every number that a machine as built can have otherwise; external springs among them."""
    d = full_machine() if name == "every number" else sm.load_machine(name).description
    changed = [r.address for r in listed(d) if number(d, r.address) is not None]
    assert len(changed) > 5
    for address in changed:
        built = moved(d, address, 1e-4)
        assert built is not None
        before, after = number(d, address), number(built, address)
        assert before is not None and (after is None or after == pytest.approx(before + 1e-4, abs=1e-15))
        assert built != d


def test_moved_as_built_leaves_the_controller() -> None:
    d = sm.load_machine("five-bar").description
    key = "left.arm_length/translation.x"
    built = moved(d, key, 1e-4)
    assert built is not None and number(built, "left.arm_length/actual.translation.x") == pytest.approx(
        0.3001
    )
    changed = with_values(d, {key: 0.3001})
    assert number(changed, key) == 0.3001 and number(changed, "left.arm_length/actual.translation.x") is None
    # a number of the design moves an error that is there along
    assert number(with_values(built, {key: 0.31}), "left.arm_length/actual.translation.x") == pytest.approx(
        0.3101
    )


def test_machines_from_text_and_plain_data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = find("five-bar").read_text(encoding="utf-8")
    machine = sm.load_machine("five-bar")
    data = yaml.safe_load(text)  # YAML 1.1 takes 7.0e4 for text
    assert sm.load_machine(text) == machine == sm.load_machine(data)
    data["platform"][0]["mass"] = np.float64(2.0)
    assert known_values(sm.load_machine(data).description, "platform.tool/mass") == [2.0]
    data["home"]["translaton"] = [0, 0, 0]
    with pytest.raises(StiffmapError, match=r"home: unknown key 'translaton' \(did you mean 'translation'"):
        sm.load_machine(data)
    with pytest.raises(StiffmapError, match="source: expected text or a path or a mapping, got"):
        sm.load_machine(3)  # type: ignore[arg-type]
    assert (
        sm.error_map(data | {"home": {"translation": [0, 416, 0]}}, force=100, x=[0.0], y=[0.4]).sizes["z"]
        == 1
    )


def test_design_sweep_is_the_machines_one_by_one() -> None:
    machine = sm.load_machine("five-bar")
    lengths, widths = [0.35, 0.4, 3.0], [0.04, 0.05]
    ds = sm.design_sweep(
        machine,
        {"forearm/length": lengths, "arm/beam.hollow.width": widths},
        wrench=FORCE,
        evaluate=lambda m: {"stiff": float(m.solve(m.description.home.p).stiffness[0, 0])},
    )
    assert ds.displacement.dims == ("forearm.length", "arm.beam.hollow.width", "component")
    one = machine.with_numbers({"forearm/length": 0.4, "arm/beam.hollow.width": 0.05})
    s = one.solve(one.description.home.p, FORCE)
    at = ds.sel({"forearm.length": 0.4, "arm.beam.hollow.width": 0.05})
    assert np.array_equal(at.displacement, s.displacement)
    assert float(at.stiff) == one.solve(one.description.home.p).stiffness[0, 0]
    lost = ds.sel({"forearm.length": 3.0})
    assert np.isnan(lost.deflection).all() and (lost.status == sm.Status.UNREACHABLE).all()
    assert "does not close" in str(lost.problem.values[0]) and at.problem == ""
    assert ds["forearm.length"].attrs == {"address": "forearm/length", "units": "m"}


def test_design_sweep_refuses_results_that_are_no_numbers() -> None:
    results = iter(({"a": 1.0}, {"a": [1.0, 2.0]}))
    for evaluate, words in (
        (lambda m: "3.5", "evaluate: value: expected a number, got text"),
        (lambda m: {"a": None}, "evaluate: a: expected a number, got NoneType"),
        (lambda m: next(results), "evaluate: expected results of the same names and shapes"),
    ):
        with pytest.raises(StiffmapError, match=words):
            sm.design_sweep("five-bar", {"arm/length": [0.3, 0.31]}, evaluate=evaluate, progress=False)
    flags = sm.design_sweep("five-bar", {"arm/length": [0.3]}, evaluate=lambda m: True, progress=False)
    assert flags["value"].item() == 1.0


def test_design_sweep_can_be_saved(tmp_path: Path) -> None:
    ds = sm.design_sweep(
        "ur10", {"elbow/stiffness": [1e4, 2e4]}, position=[[-0.9, -0.16, 0.28]], wrench=FORCE
    )
    ds.to_netcdf(tmp_path / "sweep.nc")
    assert (
        ds.deflection.dims == ("elbow.stiffness", "pose")
        and ds["elbow.stiffness"].attrs["units"] == "N·m/rad"
    )
    with pytest.raises(StiffmapError, match="nearest is 'elbow/stiffness'"):
        sm.design_sweep("ur10", {"elbo/stiffness": [1e4]})


def test_solution_as_a_dataset() -> None:
    s = sm.load_machine("orthoglide-revised").solve(np.zeros((2, 3, 3)), FORCE)
    ds = s.to_xarray(("row", "column"))
    assert ds.displacement.dims == ("row", "column", "component")
    assert np.array_equal(ds.compliance.sel(component="dx", wrench_component="fy"), s.compliance[..., 0, 1])
    assert ds.actuator_effort.sel(actuator="x.actuator").shape == (2, 3)
    with pytest.raises(StiffmapError, match="expected 2 different names"):
        s.to_xarray(("pose",))


def test_classes_are_a_dozen() -> None:
    assert len(CLASSES) >= 12


def guessed(text: str, seed: int) -> str:
    """The machine file with its home searched for from guesses at random."""
    random = np.random.default_rng(seed)
    text = re.sub(r"(home: \{translation: \[[^]]*\])(, solve: true)?", r"\1, solve: true", text, count=1)
    assert "solve: true" in text
    guess = r"(?<![\w.])(home|motor|elbow|pin): (-?\d+(\.\d+)?)(?=[,}\s])"
    return re.sub(guess, lambda found: f"{found[1]}: {random.uniform(-170, 170):.1f}", text)


@pytest.mark.parametrize(
    ("name", "seed", "address", "value"),
    [
        ("five-bar", 1, "arm_length/length", 0.33),
        ("five-bar", 2, "forearm_length/length", 0.3),
        ("five-bar", 11, "arm_length/length", 0.27),
        ("five-bar", 11, "forearm_length/length", 0.44),
        ("3-rrr", 3, "arm_length/length", 0.27),
        ("3-rrr", 4, "arm_length/length", 0.33),
    ],
)
def test_a_home_that_was_searched_for_keeps_its_branch(name, seed, address, value, tmp_path):
    file = tmp_path / "machine.yaml"
    text = find(name).read_text("utf-8") if name in sm.machine_names() else machine_text(name, "m", {})
    m = sm.load_machine(guessed(text, seed))
    before, size = (
        m.compiled.home_coordinates(),
        float(m.numbers().value[f"{m.legs[0]}.{address}".replace("/length", "/translation.x")]),
    )
    small = m
    for share in np.linspace(0.0, 1.0, 41)[1:]:  # in small steps, which cannot hop
        small = small.with_number(address, size + share * (value - size))
    for at_once in (
        m.with_number(address, value),
        m.with_effect("length", element=address.split("_")[0], error=1e-5).with_number(address, value),
    ):
        np.testing.assert_allclose(
            at_once.compiled.home_coordinates(), small.compiled.home_coordinates(), atol=1e-7
        )
    assert np.abs(small.compiled.home_coordinates() - before).max() < 1.2
    wrench = [50, 0, 0, 0, 0, 0]
    swept = sm.design_sweep(m, {address: [size, value]}, wrench=wrench, progress=False)
    assert (swept.status == 0).all()
    assert float(swept.deflection[-1]) == pytest.approx(
        float(np.linalg.norm(small.solve(small.description.home.p, wrench).displacement[:3])), rel=1e-6
    )
    small.save(file)
    np.testing.assert_allclose(
        sm.load_machine(file).compiled.home_coordinates(), small.compiled.home_coordinates(), atol=1e-9
    )
