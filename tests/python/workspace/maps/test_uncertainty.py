"""Standard deviations of a map: against Monte Carlo with full solves, and from a part to a band."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import stiffmap as sm
from stiffmap.common.errors import StiffmapError
from stiffmap.model.addresses import moved, number
from stiffmap.model.description import MachineDescription
from stiffmap.model.files.shipped import find
from stiffmap.model.link import LinkFile, save_link
from stiffmap.solve.machine import Machine
from stiffmap.ui.cli import main
from stiffmap.workspace.maps.block import sensitivities
from stiffmap.workspace.maps.loading import Loading
from stiffmap.workspace.maps.uncertainty import UPPER, uncertain_numbers

EXAMPLES = Path(__file__).parents[4] / "examples"
GRID = {"x": [-0.05, 0.1], "y": [0.1], "z": [0.05]}
WRENCH = [200.0, 50.0, 100.0, 0, 0, 0]


def write_machine(folder: Path, *changes: tuple[str, str]) -> Path:
    """The original Orthoglide whose six bars come from one link file."""
    text = find("orthoglide-original").read_text(encoding="utf-8")
    text = re.sub(r"compliance: &bar\n(\s+k\d\d: .*\n)+", "link: bar-link.yaml\n", text)
    text = text.replace("compliance: *bar", "link: bar-link.yaml")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "machine.yaml").write_text(text, encoding="utf-8")
    return folder / "machine.yaml"


def write_link(folder: Path, correlation: float) -> np.ndarray:
    """A link file of the original bar: 2 % of error on what is not zero, correlated; returns (21, 21)."""
    m = sm.load_machine("orthoglide-original").description
    key = "x.low.bar/compliance.k{}{}"
    c = np.array([[number(m, key.format(i + 1, j + 1)) for j in range(6)] for i in range(6)], dtype=float)
    std = np.array([0.02 * abs(c[i, j]) for i, j in UPPER])
    small = np.outer(std, std) * (correlation + (1 - correlation) * np.eye(21))
    spread = np.zeros((36, 21))
    for n, (i, j) in enumerate(UPPER):
        spread[6 * i + j, n] = spread[6 * j + i, n] = 1
    link = LinkFile(c, spread @ small @ spread.T, np.array([0.31, 0, 0]), {}, "bar")
    save_link(link, folder / "bar-link.yaml")
    return small


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Machine:
    folder = tmp_path_factory.mktemp("machine")
    write_link(folder, 0.8)
    return sm.load_machine(
        write_machine(
            folder,
            ("{value: 1.4e-4, source", "{value: 1.4e-4, u: 3.0e-6, source"),
            ("translation: [31, 0, 0]", "translation: [{value: 31, u: 0.004}, 0, 0]"),
        )
    )


def drawn(d: MachineDescription, names: dict[str, tuple[str, ...]], values: np.ndarray) -> Machine:
    for keys, value in zip(names.values(), values, strict=True):
        for key in keys:
            changed = moved(d, key, float(value))
            assert changed is not None
            d = changed
    return Machine(d)


def test_standard_deviations_are_those_of_monte_carlo(machine: Machine) -> None:
    ds = sm.error_map(machine, **GRID, wrench=WRENCH, plane=None, uncertainty=True, threads=1)
    u = uncertain_numbers(machine)
    springs = dict(machine.description.extra)["link_covariance"][0][1]
    places = {
        n: tuple(f"{s}/compliance.{n.split()[1]}" for s in springs) if " " in n else (n,) for n in u.names
    }
    samples = 250
    draws = np.random.default_rng(5).multivariate_normal(np.zeros(len(u.names)), u.covariance, samples)
    positions = np.array([[x, 0.1, 0.05] for x in GRID["x"]])
    found = np.array(
        [drawn(machine.description, places, v).solve(positions, WRENCH).displacement for v in draws]
    )
    # the standard deviation of 250 draws has a standard error of 4.5 %
    assert ds.displacement_std.values[0, 0] == pytest.approx(found.std(axis=0), rel=0.14)
    sizes = np.linalg.norm(found[..., :3], axis=-1)
    assert ds.deflection_std.values[0, 0] == pytest.approx(sizes.std(axis=0), rel=0.14)
    assert np.all(ds.deflection_std > 0.01 * ds.deflection)


def test_derivatives_are_those_of_full_solves(machine: Machine) -> None:
    u = uncertain_numbers(machine)
    position, wrench = np.array([0.1, 0.1, 0.05]), np.array(WRENCH)
    _, j = sensitivities(Loading(machine), u, position, wrench)
    full = np.array([m.solve(position, wrench).displacement for m in u.machines])
    wanted = (full[1::2] - full[0::2]) / (2 * u.steps[:, None])
    std = np.sqrt(np.diag(u.covariance))[:, None]
    scale = np.abs(std * wanted)[:, :3].max()
    assert std * j[:, :3] == pytest.approx(std * wanted[:, :3], abs=1e-4 * scale)
    _, slow = sensitivities(Loading(machine, method="reference"), u, position, wrench)
    assert std * slow[:, :3] == pytest.approx(std * wanted[:, :3], abs=1e-4 * scale)


def test_shares_sum_to_one_and_rank_the_numbers(machine: Machine) -> None:
    ds = sm.error_map(machine, **GRID, wrench={"F": WRENCH}, uncertainty=True, threads=1)
    assert ds.variance_share.sum("parameter").values == pytest.approx(1.0)
    ranking = sm.uncertainty_ranking(ds)
    assert float(ranking.sum()) == pytest.approx(1.0)
    assert np.all(np.diff(ranking.values) <= 0)
    assert "bar-link.yaml k11" in ranking.parameter.values
    assert ds.deflection_std.attrs["units"] == "m"
    assert "one link file move together" in ds.attrs["uncertainty_method"]


def test_worst_direction_is_that_of_a_load_case_turned_there(machine: Machine) -> None:
    ds = sm.error_map(machine, x=0.1, y=0.1, z=0.05, wrench=[300.0, 0, 0, 0, 0, 0], uncertainty=True)
    a = float(ds.worst_direction_xy.squeeze())
    force = [300 * np.cos(a), 300 * np.sin(a), 0, 0, 0, 0]
    at = sm.error_map(machine, x=0.1, y=0.1, z=0.05, wrench=force, plane=None, uncertainty=True)
    assert float(ds.worst_deflection_xy_std.squeeze()) == pytest.approx(float(at.deflection_xy_std.squeeze()))


def test_covariance_survives_saving(machine: Machine, tmp_path: Path) -> None:
    machine.save(tmp_path / "saved.yaml")
    again = sm.load_machine(tmp_path / "saved.yaml")
    assert again == machine
    assert np.array_equal(uncertain_numbers(again).covariance, uncertain_numbers(machine).covariance)


def save_with_some_linked_again(machine: Machine, folder: Path) -> None:
    """The saved machine (all six compliances written out), whose template names the file again for three springs."""
    machine.save(folder / "saved.yaml")
    data = yaml.safe_load((folder / "saved.yaml").read_text(encoding="utf-8"))
    spring = _spring_of(next(iter(data["templates"].values())))
    del spring["compliance"]
    spring["link"] = "bar-link.yaml"
    (folder / "mixed.yaml").write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")


def _spring_of(elements: list[dict[str, Any]]) -> dict[str, Any]:
    block = next(e for e in elements if "block" in e)
    return next(e for e in block["branches"]["low"] if e.get("spring") == "bar")


def test_kept_and_new_links_are_merged(machine: Machine, tmp_path: Path) -> None:
    write_link(tmp_path, 0.8)
    save_with_some_linked_again(machine, tmp_path)
    again = sm.load_machine(tmp_path / "mixed.yaml")
    entries = dict(again.description.extra)["link_covariance"]
    assert [e[0] for e in entries] == ["bar-link.yaml"]
    kept = dict(machine.description.extra)["link_covariance"][0]
    assert sorted(entries[0][1]) == sorted(kept[1])
    assert len([k for k, _ in again.description.extra if k == "link_covariance"]) == 1
    assert uncertain_numbers(again).covariance == pytest.approx(uncertain_numbers(machine).covariance)


def test_a_link_file_that_changed_is_refused(machine: Machine, tmp_path: Path) -> None:
    write_link(tmp_path, 0.5)
    save_with_some_linked_again(machine, tmp_path)
    with pytest.raises(StiffmapError, match=r"bar-link.yaml has another covariance than the one kept here"):
        sm.load_machine(tmp_path / "mixed.yaml")


def test_a_broken_kept_covariance_is_refused(machine: Machine, tmp_path: Path) -> None:
    machine.save(tmp_path / "saved.yaml")
    data = yaml.safe_load((tmp_path / "saved.yaml").read_text(encoding="utf-8"))
    data["extra"]["link_covariance"][0][2] = [[1.0]]
    (tmp_path / "saved.yaml").write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    with pytest.raises(StiffmapError, match=r"expected \[file, \[springs\], 21 x 21 numbers\]"):
        sm.load_machine(tmp_path / "saved.yaml")


def test_map_json_holds_the_band_in_si(
    machine: Machine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_link(tmp_path, 0.8)
    write_machine(tmp_path)
    arguments = ["--points", "3", "--z", "0", "--force", "100", "--uncertainty", "--no-pictures", "--json"]
    assert main(["map", "machine.yaml", *arguments, "-o", "out"]) == 0
    band = json.loads(capsys.readouterr().out)["uncertainty"]
    at = np.linspace(-0.08, 0.12, 3)
    ds = sm.error_map(
        sm.load_machine("machine.yaml"), x=at, y=at, z=0.0, wrench=np.eye(6)[:3] * 100, uncertainty=True
    )
    worst = next(r for r in band["rows"] if r["force"] == "worst")
    assert worst["z"] == 0.0
    std = ds.worst_deflection_xy_std.values
    assert worst["max_std"] == pytest.approx(float(std.max()), rel=1e-6)  # m
    assert worst["median_std"] == pytest.approx(float(np.median(std)), rel=1e-6)
    relative = std / ds.worst_deflection_xy.values
    assert worst["max_relative"] == pytest.approx(float(relative.max()), rel=1e-6)
    assert sum(r["share"] for r in band["ranking"]) == pytest.approx(1.0)
    assert band["ranking"][0]["number"].startswith("bar-link.yaml k")
    assert "delta method" in band["method"]


def test_unreachable_poses_have_no_deviation(machine: Machine) -> None:
    ds = sm.error_map(machine, x=[0.0, 5.0], y=0, z=0, wrench=WRENCH, plane=None, uncertainty=True)
    assert np.isnan(ds.deflection_std.values.ravel()).tolist() == [False, True]
    assert np.isfinite(sm.uncertainty_ranking(ds)).all()


BEAM = """
name: cantilever
units: {length: mm, force: N, angle: deg}
home: {translation: [500, 0, 0]}
legs:
  arm:
    elements:
      - {actuator: drive, kind: prismatic, axis: x, rigid: true, home: %s}
      - {offset: length, translation: [500, 0, 0]}
      - {spring: bar, beam: {length: %s, %s, material: {E: %s, nu: 0.3}}}
"""
ROUND, MODULUS = "round: {diameter: 40}", "2.1e5"
PARTS = {
    "diameter": ("0", "500", "round: {diameter: {value: 40, u: 0.1}}", MODULUS, 4 * 0.1 / 40),
    "height": ("0", "500", "rectangle: {width: 50, height: {value: 30, u: 0.1}}", MODULUS, 3 * 0.1 / 30),
    "E": ("0", "500", ROUND, "{value: 2.1e5, u: 4e3}", 4e3 / 2.1e5),
    "beam length": ("0", "{value: 500, u: 1}", ROUND, MODULUS, 3 * 1 / 500),
}


@pytest.mark.parametrize("part", PARTS)
def test_numbers_of_a_beam_count(part: str) -> None:
    """The bending F L³ / 3 E I of a cantilever: its relative deviation in closed form."""
    *numbers, relative = PARTS[part]
    ds = sm.error_map(BEAM % tuple(numbers), x=0.5, y=0.0, z=0.0, wrench=[0, 0, 100, 0, 0, 0],
                      plane=None, uncertainty=True)  # fmt: skip
    assert ds.deflection_std.item() == pytest.approx(relative * ds.deflection.item(), rel=1e-4)
    assert ds.attrs["uncertainty_left_out"] == ""


def test_bad_requests() -> None:
    with pytest.raises(StiffmapError, match=r"'cantilever' have none that a map.*arm\.drive/home"):
        uncertain_numbers(sm.load_machine(BEAM % ("{value: 0, u: 1}", "500", ROUND, MODULUS)))
    exact = sm.load_machine("tripteron")
    with pytest.raises(StiffmapError, match=r"uncertainty: the numbers of machine 'tripteron' have none"):
        sm.error_map(exact, x=0.5, y=0.5, z=0.5, wrench=[0, 0, 1.0, 0, 0, 0], uncertainty=True)
    plain = sm.error_map(exact, x=0.5, y=0.5, z=0.5, wrench=[0, 0, 1.0, 0, 0, 0])
    with pytest.raises(StiffmapError, match="the map has none; it needs error_map"):
        sm.uncertainty_ranking(plain)


def test_the_examples_go_from_a_part_to_a_band(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("gmsh", reason="needs the extra [fea]", exc_type=(ImportError, OSError))
    pytest.importorskip("skfem", reason="needs the extra [fea]")
    monkeypatch.chdir(tmp_path)
    for name in ("link_bar.yaml", "orthoglide-links.yaml"):
        shutil.copy(EXAMPLES / name, tmp_path)
    made = main(
        ["link", "link_bar.yaml", "--quick", "--size", "12", "--solver", "skfem", "--out", "bar-link.yaml"]
    )
    assert made == 0
    capsys.readouterr()
    arguments = ["--points", "2", "--z", "0", "--force", "100", "--uncertainty", "--no-pictures"]
    assert main(["map", "orthoglide-links.yaml", *arguments, "-o", "out"]) == 0
    out = capsys.readouterr().out
    assert "standard deviation" in out
    assert "bar-link.yaml k" in out
