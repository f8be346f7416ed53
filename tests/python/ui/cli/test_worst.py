"""One worst pose: the map's, in whatever direction the force turned."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.common.errors import StiffmapError
from stiffmap.ui.cli import main
from stiffmap.ui.cli.map_summary import in_words
from stiffmap.ui.plot import map_figure
from stiffmap.ui.plot.error_maps import component
from stiffmap.workspace.maps.summary import name_of, summary, worst_pose

AXIS = [-0.2, 0.05, 0.3]


def test_the_report_names_the_worst_of_the_map(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["map", "orthoglide-revised", "--points", "3", "--z", "-200", "-o", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert "worst pose of the map: (300, 300, -200) mm, 932." in out
    assert "rests on numbers that are assumed" in out
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Worst pose of the map: (300, 300, -200) mm, 932." in page
    assert "rests on numbers that are assumed" in page


def test_worst_is_that_of_the_table() -> None:
    m = sm.load_machine("orthoglide-revised")
    ds = sm.error_map(m, x=AXIS, y=AXIS, z=[-0.2], wrench={"Fx": [300.0, 0, 0, 0, 0, 0]}, progress=False)
    worst = worst_pose(m, ds, None)
    assert worst is not None
    assert worst["deflection"] == pytest.approx(float(np.nanmax(ds.worst_deflection)))
    found = m.solve(worst["position"], worst["wrench"]).displacement[:3]
    assert np.linalg.norm(found) == pytest.approx(worst["deflection"], rel=1e-6)
    assert "worst direction in the xy plane" in in_words(worst)


@pytest.fixture(scope="module")
def two() -> object:
    loads = {"Fx": [300.0, 0, 0, 0, 0, 0], "thrust": [0, 0, -300.0, 0, 0, 0]}
    return sm.error_map("orthoglide-revised", x=AXIS, y=AXIS, z=[0.0], wrench=loads, progress=False)


def test_a_force_out_of_the_plane_is_judged_in_space(two) -> None:  # type: ignore[no-untyped-def]
    assert name_of(two, "xy", "thrust") == "deflection"
    assert name_of(two, "xy", "Fx") == "deflection_xy"
    row = next(r for r in summary(two, "xy", 2.5e-4) if r["force"] == "thrust")
    assert row["max"] == pytest.approx(float(two.deflection.sel(case="thrust").max()))


def test_a_selected_case_is_drawn(two) -> None:  # type: ignore[no-untyped-def]
    for case in ("Fx", "thrust"):
        figure = map_figure(two.sel(case=case))
        mesh = figure.axes[0].collections[0]
        assert np.nanmax(mesh.get_array()) == pytest.approx(
            1e6 * float(two.deflection.sel(case=case).max()), rel=1e-3
        ) or (
            np.nanmax(mesh.get_array())
            == pytest.approx(1e3 * float(two.deflection.sel(case=case).max()), rel=1e-3)
        )
        assert ("fz = -300 N" in figure.get_suptitle()) == (case == "thrust")


def test_components_and_planes(two) -> None:  # type: ignore[no-untyped-def]
    d = two.displacement
    np.testing.assert_allclose(component(two, "|d|"), two.deflection)
    np.testing.assert_allclose(component(two, "d_xy"), two.deflection_xy)
    np.testing.assert_allclose(component(two, "dz"), d.sel(component="dz"))
    map_figure(two, "d_xz", case="thrust")
    with pytest.raises(StiffmapError, match=r"\|d\|, dx, dy, dz"):
        component(two, "d_zz")
