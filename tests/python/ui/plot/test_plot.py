"""Pictures: what is drawn, checked on the figures' own contents."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import PolyQuadMesh, QuadMesh
from matplotlib.contour import QuadContourSet
from matplotlib.figure import Figure

import stiffmap as sm
from stiffmap import plot
from stiffmap.ui.plot.paths import toolpath_figure
from stiffmap.ui.plot.skeleton import skeleton


@pytest.fixture(scope="module")
def machine() -> sm.Machine:
    return sm.load_machine("orthoglide-revised")


def legend(figure: Figure) -> set[str]:
    return {t.get_text() for lines in figure.legends for t in lines.get_texts()}


def test_map_draws_values_in_mm_and_the_tolerance(machine: sm.Machine) -> None:
    x = np.linspace(-0.2, 0.3, 5)
    ds = sm.error_map(machine, x=x, y=x, z=[0.0, 0.3], wrench=[300.0, 0, 0, 0, 0, 0])
    figure = plot.map_figure(ds)
    first, second = figure.axes[:2]
    for ax, z in ((first, 0.0), (second, 0.3)):
        mesh = next(c for c in ax.collections if isinstance(c, QuadMesh))
        np.testing.assert_array_equal(mesh.get_array(), 1e3 * ds.worst_deflection_xy.sel(z=z))
        assert ax.get_aspect() == 1.0
        assert ax.get_xlabel() == "x, mm"
    lines = [
        [c for c in ax.collections if isinstance(c, QuadContourSet) and not c.filled]
        for ax in (first, second)
    ]
    at = [[c for c in found if c.levels.tolist() == [0.25]] for found in lines]
    assert [len(c) for c in at] == [1, 0]  # z = 300 mm is nowhere within the tolerance
    assert {"tolerance 0.25 mm", "beyond 0.25 mm"} <= legend(figure)
    assert second.get_title().endswith("100 % beyond 0.25 mm")


def test_failed_cells_are_hatched_not_coloured(machine: sm.Machine) -> None:
    x = np.linspace(-0.9, 0.9, 5)
    ds = sm.error_map(machine, x=x, y=x, z=0.0, wrench=[300.0, 0, 0, 0, 0, 0])
    figure = plot.map_figure(ds)
    missing = int(np.isnan(ds.worst_deflection_xy).sum())
    assert missing > 0
    hatched = [c for c in figure.axes[0].collections if isinstance(c, PolyQuadMesh)]
    assert sum(len(c.get_paths()) for c in hatched) == missing
    mesh = next(c for c in figure.axes[0].collections if isinstance(c, QuadMesh))
    assert int(np.ma.getmaskarray(mesh.get_array()).sum()) == missing
    assert "unreachable" in legend(figure)


def test_map_refuses_what_is_not_there(machine: sm.Machine) -> None:
    ds = sm.error_map(machine, x=0.0, y=0.0, z=0.0, wrench={"a": [1.0, 0, 0, 0, 0, 0]}, plane=None)
    with pytest.raises(sm.StiffmapError, match="no deflection 'worst_deflection_xy'"):
        plot.map_figure(ds, "worst_deflection_xy")
    with pytest.raises(sm.StiffmapError, match="case: expected one of a"):
        plot.map_figure(ds, "deflection", case="b")
    assert "fx = 1 N" in plot.map_figure(ds, "deflection", case="a").get_suptitle()


def test_polar_and_ellipse_close_their_curves(machine: sm.Machine) -> None:
    pol = sm.polar(machine, [-0.2, -0.2, -0.2], directions=16)
    line = plot.polar_figure(pol).axes[0].lines[0]
    np.testing.assert_array_equal(line.get_ydata()[:-1], 1e3 * pol.deflection_xy)
    assert line.get_ydata()[0] == line.get_ydata()[-1]
    figure = plot.ellipse_figure([pol, pol])
    curve = figure.axes[1].lines[0]
    np.testing.assert_array_equal(curve.get_xdata()[:-1], 1e3 * pol.displacement.sel(component="dx"))
    assert figure.axes[0].get_xlabel() == "dx, mm"


def test_sweep_shows_unstable_equilibria_apart(machine: sm.Machine) -> None:
    swp = sm.sweep(machine, np.zeros(3), [1.0, 0, 0], np.linspace(0, 6000, 4))
    figure = plot.sweep_figure({"Fx": swp})
    assert "Fx: unstable" in legend(figure)
    stable = np.asarray(figure.axes[0].lines[0].get_ydata())
    assert np.isfinite(stable).sum() == int((swp.status == 0).sum()) < 4
    alone = plot.sweep_figure(swp).axes[0].lines[0].get_ydata()
    np.testing.assert_array_equal(np.asarray(alone), stable)


def test_skeleton_has_the_bars_at_their_length(machine: sm.Machine) -> None:
    k = sm.inverse_kinematics(machine, [0.1, -0.1, 0.2])
    s = skeleton(machine, k.coordinates)
    lengths = np.array([np.linalg.norm(ends[1] - ends[0]) for _, ends in s.bars])
    assert int(np.isclose(lengths, 0.775).sum()) == 6
    assert len(s.guides) == 3
    for ends in s.guides:
        assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(0.67)  # drive range -1060 … -390 mm
    np.testing.assert_allclose(s.tcp, [0.1, -0.1, 0.2], atol=1e-12)
    assert len(s.actuators) == 3
    assert len(s.passive) == 18


def test_machine_figure(machine: sm.Machine) -> None:
    figure = plot.machine_figure(machine, [0.1, 0.1, 0.1])
    assert {"leg x", "leg y", "leg z", "TCP", "workspace", "actuator"} <= legend(figure)
    with pytest.raises(sm.StiffmapError, match=r"cannot be drawn at \(5000, 0, 0\) mm: UNREACHABLE"):
        plot.machine_figure(machine, [5.0, 0, 0])


def test_saving(machine: sm.Machine, tmp_path: Path) -> None:
    figure = plot.polar_figure(sm.polar(machine, np.zeros(3), directions=8))
    assert (
        plot.save(figure, tmp_path / "a.png").read_bytes()
        == plot.save(figure, tmp_path / "b.png").read_bytes()
    )
    with pytest.raises(sm.StiffmapError, match="cannot be written"):
        plot.save(figure, tmp_path / "nowhere" / "a.png")
    with pytest.raises(sm.StiffmapError, match="not supported"):
        plot.save(figure, tmp_path / "a.xyz")


def test_a_toolpath_is_drawn_over_its_way_in_mm(machine: sm.Machine) -> None:
    way = np.array([0.0, 0.1, 0.2])
    position = way[:, None] * [1.0, 0.0, 0.0]
    solved = machine.solve(position, [300.0, 0, 0, 0, 0, 0])
    ax = toolpath_figure(solved.to_xarray(("way",), {"way": ("way", way)}), "it").axes[0]
    np.testing.assert_allclose(ax.lines[0].get_xdata(), [0.0, 100.0, 200.0])
    assert ax.get_xlabel() == "way along the path, mm"


def test_every_figure_shows_in_a_notebook_without_pyplot(monkeypatch: pytest.MonkeyPatch) -> None:
    """A notebook draws a matplotlib Figure by itself only once pyplot is loaded."""
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)  # who imports it fails
    monkeypatch.delattr("matplotlib.pyplot", raising=False)
    m = sm.load_machine("five-bar")
    p, w = (0, 0.416, 0), (10, 0, 0, 0, 0, 0)
    ds = sm.error_map(m, x=[0, 0.05], y=[0.4, 0.42], z=0.0, wrench=w, progress=False)
    polar, sweep = sm.polar(m, p, directions=8), sm.sweep(m, p, (1, 0, 0), [10.0, 20.0])
    for f in (plot.machine_figure(m), plot.loaded_figure(m, p, w), plot.polar_figure(polar),
              plot.map_figure(ds), plot.sweep_figure({"x": sweep})):  # fmt: skip
        assert f._repr_png_()[:4] == b"\x89PNG", f
