"""What hands do to the model: drags that stop at limits, numbers by address, assembly modes, files that change."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import stiffmap as sm
from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.model.files.shipped import find
from stiffmap.solve.kinematics import assembly_modes
from stiffmap.ui.plot.skeleton import THICK, THIN, element_links, skeleton, thicknesses
from stiffmap.ui.view.model import ViewModel, addresses, changed
from stiffmap.ui.view.moment import moves, turns
from stiffmap.ui.view.panels import principal
from stiffmap.ui.view.scene import ellipsoid, polar_surface, sphere


@pytest.fixture(scope="module")
def machine() -> sm.Machine:
    return sm.load_machine("orthoglide-revised")


def test_a_drag_inside_goes_where_the_hand_goes(machine: sm.Machine) -> None:
    model = ViewModel(machine)
    model.drag(np.array([0.05, -0.1, 0.2]))
    assert model.state.position == (0.05, -0.1, 0.2) and model.message == ""


def test_a_drag_stops_at_the_limit_and_names_it(machine: sm.Machine) -> None:
    model = ViewModel(machine)
    model.drag(np.array([0.9, 0.0, 0.0]))
    x = model.state.position
    assert model.message == "stopped: x.actuator is at its limit, -390 mm"
    assert x[1:] == (0.0, 0.0) and 0.2 < x[0] < 0.9
    at = sm.inverse_kinematics(machine, x).actuators
    assert at[0] <= -0.39 + 1e-9
    further = sm.inverse_kinematics(machine, (x[0] + 0.003, 0, 0)).actuators
    assert further[0] > -0.39
    model.drag(np.array([0.1, 0.0, 0.0]))
    assert model.state.position == (0.1, 0.0, 0.0) and model.message == ""


def test_a_drag_out_of_reach_stops_before() -> None:
    machine = sm.load_machine("ur10")
    model = ViewModel(machine)
    model.drag(np.array([-3.0, 0.0, 0.3]))
    assert model.message == "stopped: the machine cannot reach further"
    assert bool(machine.solve(model.state.position).ok) and model.state.position[0] < -0.95


def test_coordinates_that_are_not_commanded_stay() -> None:
    model = ViewModel(sm.load_machine("five-bar"))
    model.drag(np.array([0.05, 0.45, 0.3]))
    assert model.state.position == (0.05, 0.45, 0.0)


def test_a_turn_of_the_gizmo_turns_the_tool() -> None:
    machine = sm.load_machine("hexapod")
    model = ViewModel(machine)
    home = machine.description.home
    turned = home.r @ Rotation.from_rotvec([0.05, 0.0, 0.0]).as_matrix()
    model.drag(home.p, turned)
    assert model.message == "" and model.state.rotation is not None
    np.testing.assert_allclose(Rotation.from_rotvec(model.state.rotation).as_matrix(), turned, atol=1e-12)
    model.drag(home.p, home.r @ Rotation.from_rotvec([2.5, 0.0, 0.0]).as_matrix())
    assert model.message.startswith("stopped: ")
    assert turns(machine) == (True, True, True)


@pytest.mark.parametrize(("name", "plane", "free"), [("five-bar", "z", (1, 1, 0)), ("swing-table", "z", (1, 0, 0)),
                                                     ("3-rps", "y", (0, 0, 1))])  # fmt: skip
def test_first_plane_shows_what_is_commanded(name: str, plane: str, free: tuple[int, ...]) -> None:
    machine = sm.load_machine(name)
    assert ViewModel(machine).state.plane == plane and moves(machine) == free
    assert turns(sm.load_machine("linear-delta")) == (False, False, False)


def test_a_number_changed_by_its_address_is_the_machine_so_built(machine: sm.Machine) -> None:
    model = ViewModel(machine)
    address = "x.foot/beam.EIx"
    value = addresses(machine.description)[address]
    model.change(address, 4 * value)
    soft = model.machine.solve((0.1, 0.1, 0.1), (300.0, 0, 0, 0, 0, 0)).displacement
    hard = machine.solve((0.1, 0.1, 0.1), (300.0, 0, 0, 0, 0, 0)).displacement
    assert np.linalg.norm(soft[:3]) != pytest.approx(np.linalg.norm(hard[:3]), rel=1e-3)
    assert addresses(model.machine.description)[address] == pytest.approx(4 * value)
    model.undo()
    assert model.machine == machine


def test_every_address_can_be_changed(machine: sm.Machine) -> None:
    for name in ("orthoglide-revised", "ur10"):
        m = sm.load_machine(name)
        listed = addresses(m.description)
        for address, value in list(listed.items())[::17]:
            new = addresses(changed(m, {address: value * 1.001 + 1e-12}).description)
            again = [v for a, v in new.items() if a.replace("actual.", "") == address]
            assert again == [] or again[0] == pytest.approx(value * 1.001 + 1e-12)


def test_effects_have_addresses_too(machine: sm.Machine) -> None:
    m = machine.with_effect("dead_zone", element="actuator", legs=["x"], half_width=1e-5)
    assert addresses(m.description)["effects/0/half_width"] == 1e-5
    model = ViewModel(m)
    model.change("effects/0/half_width", 5e-5)
    want = machine.with_effect("dead_zone", element="actuator", legs=["x"], half_width=5e-5)
    load = (300.0, 0, 0, 0, 0, 0)
    np.testing.assert_allclose(
        model.machine.solve((0, 0, 0), load).displacement,
        want.solve((0, 0, 0), load).displacement,
        rtol=1e-12,
    )
    with pytest.raises(StiffmapError, match="effects/3/size: expected effects/0/half_width"):
        model.change("effects/3/size", 1.0)


@pytest.mark.parametrize(
    "address", ["x.foot/compliance.c99x", "nothing/at.x", "x.foot", "", "x.frame/translation.q"]
)
def test_an_unknown_address_is_refused_and_nothing_changes(machine: sm.Machine, address: str) -> None:
    model = ViewModel(machine)
    before = model.state
    with pytest.raises(StiffmapError, match=r"has no number|expected"):
        model.change(address, 1.0)
    assert model.state == before


def test_numbers_that_cannot_be_are_refused_and_nothing_changes(machine: sm.Machine) -> None:
    model = ViewModel(machine)
    for deed in (
        lambda: model.put(position=(9.0, 0.0, 0.0)),
        lambda: model.put(force=(float("nan"), 0.0, 0.0)),
        lambda: model.change("x.foot/beam.EIx", float("inf")),
        lambda: model.drag(np.array([np.nan, 0, 0])),
    ):
        with pytest.raises(StiffmapError):
            deed()
        assert model.state == model.history.first


def test_assembly_modes_are_other_ways_to_the_same_pose() -> None:
    machine = sm.load_machine("five-bar")
    model = ViewModel(machine)
    modes = assembly_modes(machine, model.state.position)
    assert len(modes) == 4
    model.put(start=modes[1])
    s, home = model.moment.solve(), machine.solve(model.state.position, model.state.wrench)
    assert bool(s.ok)
    assert np.abs(s.coordinates - home.coordinates).max() > 0.1
    with pytest.raises(StiffmapError, match="assembly mode of home only"):
        model.moment.shares()


def test_a_file_that_is_edited_is_read_again_or_its_error_is_named(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    text = find("five-bar").read_text(encoding="utf-8")
    file.write_text(text, encoding="utf-8")
    model = ViewModel(sm.load_machine(file), file=file)
    file.write_text(text.replace("name: five-bar", "name: seven-bar"), encoding="utf-8")
    model.reload()
    assert model.machine.name == "seven-bar"
    file.write_text(text.replace("legs:", "lags:"), encoding="utf-8")
    with pytest.raises(FileError, match=r"mine.yaml, line \d+") as error:
        model.reload()
    assert error.value.line
    assert model.machine.name == "seven-bar"


def test_links_keep_their_place_and_have_the_thickness_of_their_springs(machine: sm.Machine) -> None:
    rest = ViewModel(machine).moment.rest()
    there = skeleton(machine, sm.inverse_kinematics(machine, (0.1, 0.1, 0.1)).coordinates)
    assert rest.legs == there.legs and rest.links.shape == there.links.shape
    thick = thicknesses(machine, rest)
    assert (thick >= THIN * rest.extent - 1e-12).all() and (thick <= THICK * rest.extent + 1e-12).all()
    assert len(np.unique(np.round(thick, 6))) > 1
    np.testing.assert_allclose(np.linalg.norm(rest.tcp - (0, 0, 0)), 0, atol=1e-12)


@pytest.mark.parametrize("name", sm.machine_names())
def test_a_drawing_has_the_same_pieces_wherever_the_machine_stands(name: str) -> None:
    """Also where joints that span a plate at home do not."""
    machine = sm.load_machine(name)
    low, high = machine.workspace
    p = np.random.default_rng(0).uniform(low, high, (60, 3))
    pieces = set()
    for s in (machine.solve(p), machine.solve(p, [300.0, 200.0, -500.0, 0, 0, 0])):
        for x in s.coordinates[s.status == sm.Status.CONVERGED]:
            d = skeleton(machine, x)
            pieces.add((d.legs, d.ends, len(d.links), len(d.plate)))
    assert len(pieces) == 1


def test_thickness_is_that_of_the_round_bar(tmp_path: Path) -> None:
    """A cantilever of 40 mm diameter in a machine file is drawn 40 mm thick."""
    file = tmp_path / "bar.yaml"
    file.write_text(BAR, encoding="utf-8")
    machine = sm.load_machine(file)
    rest = ViewModel(machine).moment.rest()
    lengths = np.linalg.norm(rest.links[:, 1] - rest.links[:, 0], axis=1)
    i = int(np.argmax(lengths))
    assert lengths[i] == pytest.approx(4.0)
    assert thicknesses(machine, rest)[i] == pytest.approx(0.04, rel=1e-6)


BAR = """
name: bar
units: {length: mm, force: N, angle: deg, mass: kg}
home: {translation: [4000, 0, 0]}
task: [z]
materials:
  steel: {E: 2.1e5, nu: 0.3}
legs:
  only:
    elements:
      - actuator: lift
        kind: prismatic
        axis: z
        compliance: 1.0e-6
      - {offset: along, translation: [4000, 0, 0]}
      - spring: beam
        beam: {length: 4000, along: x, round: {diameter: 40}, material: steel}
"""


def test_an_element_of_a_leg_lights_a_link_of_this_leg(machine: sm.Machine) -> None:
    rest = ViewModel(machine).moment.rest()
    for leg in "xyz":
        lit = element_links(machine, f"{leg}.foot")
        assert [rest.legs[i] for i in lit] == [leg]
    assert element_links(machine, "no.such") == []


def test_surfaces_reach_as_far_as_the_compliance_says(machine: sm.Machine) -> None:
    c = machine.solve((0.25, 0.25, 0.25), (1.0, 0, 0, 0, 0, 0)).compliance[:3, :3]
    top = float(np.linalg.svd(c, compute_uv=False)[0])
    for make in (polar_surface, ellipsoid):
        around, most = make(c, 0.1)
        assert most == pytest.approx(top, rel=5e-3) and most <= top * (1 + 1e-12)
        assert np.linalg.norm(around, axis=1).max() == pytest.approx(0.1)
        assert around.shape == sphere()[0].shape
    assert polar_surface(np.zeros((3, 3)), 0.1)[1] == 0.0
    values, directions = principal(c)
    np.testing.assert_allclose(c @ directions[0], values[0] * directions[0], rtol=1e-6, atol=1e-12)
