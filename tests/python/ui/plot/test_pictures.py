"""Nothing of a picture is cut, and each answers for what it was asked."""

from __future__ import annotations

from collections.abc import Iterator
from io import BytesIO

import numpy as np
import pytest
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from matplotlib.text import Text

import stiffmap as sm
from stiffmap import plot
from stiffmap.ui.cli.map import planes as in_metres
from stiffmap.ui.plot.error_maps import shares
from stiffmap.ui.plot.style import Picture

FORCE = {"Fx": [300.0, 0, 0, 0, 0, 0]}


def cut(figure: Figure) -> list[str]:
    """Texts of a figure that reach beyond its edge."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer, box = canvas.get_renderer(), figure.bbox
    found, unseen = [], set(_beyond_the_axes(figure))
    for text in figure.findobj(Text):
        if not isinstance(text, Text) or not text.get_text().strip() or not text.get_visible():
            continue
        if text in unseen:
            continue
        e = text.get_window_extent(renderer)
        if e.x0 < box.x0 - 1 or e.x1 > box.x1 + 1 or e.y0 < box.y0 - 1 or e.y1 > box.y1 + 1:
            found.append(text.get_text())
    return found


def _beyond_the_axes(figure: Figure) -> Iterator[Text]:
    """Labels of ticks that matplotlib keeps, but does not draw."""
    for ax in figure.axes:
        for axis in ax.xaxis, ax.yaxis, *([ax.zaxis] if hasattr(ax, "zaxis") else []):
            low, high = sorted(axis.get_view_interval())
            for tick in axis.get_major_ticks():
                if hasattr(ax, "zaxis") or not low <= tick.get_loc() <= high:
                    yield from (tick.label1, tick.label2)


def error_map(
    machine: sm.Machine, planes: dict[str, list[float] | None] | None = None, plane: str = "xy"
) -> xr.Dataset:
    return sm.error_map(machine, **in_metres(planes or {}), points=6, wrench=FORCE, plane=plane)


def pictures() -> Iterator[tuple[str, Figure]]:
    for name in ("orthoglide-revised", "five-bar", "swing-table", "hexapod"):
        machine = sm.load_machine(name)
        ds = error_map(machine)
        yield f"map {name}", plot.map_figure(ds)
        yield f"own scales {name}", plot.map_figure(ds, common_scale=False)
        yield f"case {name}", plot.map_figure(ds, "deflection_xy")
        yield f"machine {name}", plot.machine_figure(machine)
        home = machine.description.home.p
        polars = [sm.polar(machine, home, directions=12) for _ in range(4)]
        yield f"polar {name}", plot.polar_figure(polars[0])
        yield f"polars {name}", plot.polar_figure(polars)
        yield f"ellipse {name}", plot.ellipse_figure(polars[0])
        yield f"ellipses {name}", plot.ellipse_figure(polars)
        sweep = sm.sweep(machine, home, [1.0, 0.0, 0.0], np.linspace(0, 500, 4))
        yield f"sweep {name}", plot.sweep_figure({"along (1, 0, 0)": sweep, "once more": sweep})


def test_nothing_is_cut() -> None:
    assert {name: found for name, figure in pictures() if (found := cut(figure))} == {}


def test_a_picture_is_what_matplotlib_draws_drawn_once(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[Axes] = []
    usual = Axes.draw
    monkeypatch.setattr(Axes, "draw", lambda self, renderer: (drawn.append(self), usual(self, renderer)))

    def saved(kind: type[Figure]) -> bytes:
        figure, out = kind(figsize=(3, 2), layout="constrained"), BytesIO()
        figure.subplots().set(ylabel="deflection, µm", xlabel="x, mm", ylim=(0, 1e7))
        figure.savefig(out, dpi=150)
        return out.getvalue()

    picture = saved(Picture)
    assert len(drawn) == 1
    assert picture == saved(Figure)


@pytest.mark.parametrize("plane", ["xy", "xz", "yz"])
@pytest.mark.parametrize("across", ["x", "y", "z"])
def test_planes_across_any_axis_are_filled(plane: str, across: str) -> None:
    ds = error_map(sm.load_machine("orthoglide-revised"), {across: [0.0, 100.0]}, plane)
    figure = plot.map_figure(ds)
    meshes = [c for ax in figure.axes[:2] for c in ax.collections if isinstance(c, QuadMesh)]
    assert len(meshes) == 2
    expected = ds[f"worst_deflection_{plane}"]
    right, up = (a for a in "xyz" if a != across)
    for i, mesh in enumerate(meshes):
        values = expected.isel({across: i}).transpose(up, right).values
        np.testing.assert_allclose(mesh.get_array(), 1e3 * values)
        assert np.isfinite(values).all()
    assert [figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()] == [f"{right}, mm", f"{up}, mm"]
    assert figure.axes[1].get_title().splitlines()[0] == f"(b) {across} = 100 mm"


def test_one_plane_may_be_picked() -> None:
    ds = error_map(sm.load_machine("orthoglide-revised"))
    assert plot.map_figure(ds.sel(z=0)).axes[0].get_title().startswith("z = 0 mm")
    assert plot.map_figure(ds.sel(z=[0])).axes[0].get_title().startswith("z = 0 mm")
    assert plot.map_figure(ds.isel(x=2)).axes[0].get_title().startswith("x = ")
    assert plot.map_figure(ds.sel(z=0).isel(x=2)).axes[0].get_xlabel() == "y, mm"


def test_planar_machines_have_one_panel() -> None:
    machine = sm.load_machine("five-bar")
    x, y = np.linspace(-0.1, 0.1, 4), np.linspace(0.36, 0.48, 4)
    ds = sm.error_map(machine, x=x, y=y, z=[-0.001, 0.0, 0.001], wrench=FORCE)
    figure = plot.map_figure(ds)
    assert [ax.get_title().splitlines()[0] for ax in figure.axes if ax.get_title()] == ["any z"]


def test_what_lies_beyond_the_tolerance_is_told() -> None:
    values = np.array([[1e-3, 3e-3], [4e-3, np.nan]])
    assert shares(values, 2e-3) == "\n67 % beyond 2 mm\n25 % without a value"
    assert shares(values, 9e-3) == "\n0 % beyond 9 mm\n25 % without a value"
    many = np.full(1000, 1e-3)
    many[0] = 3e-3
    assert shares(many, 2e-3) == "\n< 1 % beyond 2 mm"
    assert shares(many, None) == ""


def test_small_deflections_are_in_micrometres() -> None:
    machine = sm.load_machine("orthoglide-revised")
    x = np.linspace(-0.1, 0.1, 5)
    ds = sm.error_map(machine, x=x, y=x, z=0.0, wrench={"F": [10.0, 0, 0, 0, 0, 0]})
    figure = plot.map_figure(ds)
    assert any("µm" in ax.get_ylabel() for ax in figure.axes)
    mesh = next(c for c in figure.axes[0].collections if isinstance(c, QuadMesh))
    np.testing.assert_allclose(mesh.get_array(), 1e6 * ds.worst_deflection_xy.values[0])
