"""Pictures of the largest box, of measures along a toolpath, of modes that swing; the shipped motion."""

from __future__ import annotations

from io import BytesIO

import numpy as np
import pytest
from PIL import Image, ImageSequence

import stiffmap as sm
from stiffmap.ui.plot.box import box_figure
from stiffmap.ui.plot.measures import caption, measure_figures, path_measures_figure
from stiffmap.ui.plot.modes import mode_frames
from stiffmap.ui.report.sheet import animation, inline
from stiffmap.workspace.design import load_design
from stiffmap.workspace.performance import largest_box, load_motion


def test_sections_of_the_box_meet_at_the_corner_that_is_limited():
    machine = sm.load_machine("orthoglide-original")
    box = largest_box(machine, tolerance=0.01)
    figure = box_figure(machine, box, nodes=12)
    low, high = box.corners
    for axes, title in zip(figure.axes, "zyx", strict=True):
        dot = next(line for line in axes.lines if line.get_marker() == "o")
        corner = np.concatenate(dot.get_data()) / 1e3
        assert all(np.isclose(c, [low.min(), high.max()], atol=1e-3).any() for c in corner)
        assert axes.get_title().startswith(f"{title} = ")
    assert "proven" in figure.get_suptitle()


def test_a_plane_and_a_line_and_nothing():
    plane = sm.load_machine("five-bar")
    assert len(box_figure(plane, largest_box(plane, tolerance=0.02, max_evaluations=5000), nodes=8).axes) == 1
    line = sm.load_machine("swing-table")
    with pytest.raises(sm.StiffmapError, match="is a line"):
        box_figure(line, largest_box(line, tolerance=0.02, max_evaluations=5000))
    ur10 = sm.load_machine("ur10")
    with pytest.raises(sm.StiffmapError, match="no box was found"):
        box_figure(ur10, largest_box(ur10, tolerance=0.02, max_evaluations=1000))


def test_measures_along_the_shipped_path():
    """Lines of the picture are the numbers of the table; drives of one machine, a line for each of several."""
    table = sm.measures("orthoglide-revised", only=["path_compliance", "path_effort"], toolpath="trim")
    found = measure_figures(table)["toolpath"]
    stiff, effort = found.axes
    np.testing.assert_allclose(
        stiff.lines[0].get_ydata(), 1e6 * table["path_compliance"].found.values, rtol=1e-12
    )
    assert len(effort.lines) == 3
    most = max(np.asarray(line.get_ydata()).max() for line in effort.lines)
    assert most == pytest.approx(table["path_effort"].found.worst)
    both = path_measures_figure({"one": table, "other": table})
    assert [len(a.lines) for a in both.axes] == [2, 2]
    assert "toolpath" in caption("toolpath").lower()
    none = sm.measures("orthoglide-revised", only=["mass"])
    with pytest.raises(sm.StiffmapError, match="no measure along"):
        path_measures_figure({"none": none})


def test_the_shipped_motion_goes_with_the_redesign():
    design = load_design("redesign")
    assert design.toolpath is not None
    assert design.toolpath.name == load_motion("trim").name == "trim"
    low, high = design.bounds
    for x in (low, high):  # every design's box holds the path
        space = design.machine(np.minimum(x, high - 1e-9)).workspace
        place = design.toolpath.places()[0]
        assert (place >= space[0] - 1e-9).all() and (place <= space[1] + 1e-9).all()
    with pytest.raises(sm.StiffmapError, match=r"trimm\.yaml"):
        load_motion("trimm.yaml")


def test_modes_swing():
    """There and back: frames of a GIF, the outermost ones of one mode on either side of rest."""
    machine = sm.load_machine("orthoglide-revised")
    ends = []
    frames = mode_frames(machine, [0.0, 0.0, 0.0], modes=1, count=3)
    for figure in frames:
        ends.append([np.array(line.get_data_3d()) for line in figure.axes[0].lines])
    assert len(ends) == 3
    moved = max(np.abs(a - b).max() for a, b in zip(ends[0], ends[2], strict=True))
    assert moved > 10  # mm, exaggerated
    for a, still, b in zip(ends[0], ends[1], ends[2], strict=True):
        np.testing.assert_allclose((a + b) / 2, still, atol=0.05 * moved)  # turns are of second order
    data = animation(mode_frames(machine, [0.0, 0.0, 0.0], modes=1, count=3), dpi=40)
    frames = [np.array(f.convert("RGB")) for f in ImageSequence.Iterator(Image.open(BytesIO(data)))]
    assert len(frames) == 4 and (frames[3] == frames[1]).all() and (frames[2] != frames[0]).any()
    assert inline(data).startswith("data:image/gif;base64,")
