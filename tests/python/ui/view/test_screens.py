"""What a person sees of the view and takes with the mouse, on large and small screens: headless Chromium."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.python.ui.view.pages import client_of, on_screen, opened, pull, pulled, until, works

import stiffmap as sm
from stiffmap.ui.view.open import View, model_of
from stiffmap.ui.view.outputs import write_page
from stiffmap.ui.view.panels import hint, legend, probe_text
from stiffmap.ui.view.plane import rgb

ON_CANVAS = "p => !!document.elementFromPoint(...p)?.closest(':has(> canvas)')"
"""Whether what is seen at a place of the page is the scene, not something over it."""
SIZES = [(1024, 600), (390, 844)]


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_the_panel_does_not_hide_the_tool(width: int, height: int, shown: tuple[View, Any]) -> None:
    view, page = shown
    page.set_viewport_size({"width": width, "height": height})
    if width < 576:
        page.get_by_role("button", name="Expand panel Legend").wait_for()
    else:
        page.get_by_text("travel of the drives").wait_for()
        page.get_by_text("the force by the arrows at its tail").wait_for()
    panel = page.get_by_role("tab", name="Tool and load").bounding_box()
    assert panel["x"] + panel["width"] <= width and panel["y"] + panel["height"] <= height
    for point in (view.state.position, view._viewer.scene.force_handle.position):
        assert page.evaluate(ON_CANVAS, on_screen(view, page, point))


def test_what_a_page_says_stands_below_its_scene_on_a_narrow_screen(browser: Any, tmp_path: Path) -> None:
    file = write_page(model_of(sm.load_machine("orthoglide-revised")).moment, tmp_path / "out.html")
    page = browser.new_page()
    page.set_viewport_size({"width": 390, "height": 844})
    page.goto(file.as_uri())
    scene, said = page.locator("canvas").first.bounding_box(), page.locator("#said").bounding_box()
    assert scene["y"] + scene["height"] <= said["y"] and said["y"] + said["height"] <= 844


def test_every_line_of_the_scene_has_its_colour_in_the_legend() -> None:
    with View(model_of(sm.load_machine("orthoglide-revised"), (0.28, 0.28, 0.28))) as view:
        assert view._viewer.worker.idle(60)
        text = view._viewer.controls._legend.content
        shown = {name: node for name, node in view._viewer.scene._lines.items() if node.visible}
        assert {"/ghost", "/tolerance", "/travel", "/links/0"} <= set(shown)
        said = {rgb(c) for c in re.findall("#[0-9A-Fa-f]{6}", text)}
        for name, node in shown.items():
            drawn = tuple(int(v) for v in node.colors.reshape(-1, 3)[0])
            assert drawn in said or name == "/isolines", name
        assert all(f"leg {leg}" in text for leg in "xyz") and "force, 300 N" in text
        view.set(force=(0.0, 0.0, 0.0), quantity="status")
        assert view._viewer.worker.idle(60)
        text = view._viewer.controls._legend.content
        assert "force," not in text and "tolerance" not in text


def test_the_hint_speaks_of_turning_where_the_machine_turns() -> None:
    assert "turn it" not in hint(model_of(sm.load_machine("orthoglide-revised")).moment)
    assert "turn it" in hint(model_of(sm.load_machine("hexapod")).moment)


def test_the_legend_shows_texts_of_files_as_text() -> None:
    machine = sm.load_machine("orthoglide-revised")
    d = machine.description
    evil = sm.Machine(replace(d, legs=(replace(d.legs[0], name="<img src=x>"), *d.legs[1:])))
    moment = model_of(evil).moment
    assert "&lt;img" in legend(moment, moment.rest(), 1.0) and "<img" not in legend(
        moment, moment.rest(), 1.0
    )


def test_the_force_is_dragged_by_its_tail_with_the_mouse(browser: Any) -> None:
    machine = sm.load_machine("orthoglide-revised")
    with View(model_of(machine, force=(200.0, 0.0, -100.0))) as view:
        page, scene = opened(browser, view), view._viewer.scene
        before = view.state.force
        tail, length = np.array(scene.force_handle.position), 0.06 * scene.extent
        a, b = (tail + (0, 0, z) for z in (0.8 * length, 0.8 * length + 0.1))
        assert pulled(view, page, a, b, lambda: view.state.force != before)
        assert view._viewer.worker.idle(60)
        x, y, z = view.state.force
        wanted = -100 - np.linalg.norm(before) * 0.1 / scene.arrow_length
        assert (x, y) == pytest.approx((200, 0), abs=1e-3) and z == pytest.approx(wanted, rel=0.15)
        d = 1e6 * np.linalg.norm(machine.solve(view.state.position, view.state.wrench).displacement[:3])
        page.get_by_text(f"{d:.1f} µm").first.wait_for()
        page.get_by_role("button", name="Undo").click()
        assert until(lambda: view.state.force == before)


def test_the_probe_follows_the_mouse(shown: tuple[View, Any]) -> None:
    view, page = shown
    probe = view._viewer.probe
    assert view._viewer.worker.idle(60)
    first, last = (0.1, 0.25, 0.0), (0.25, 0.15, 0.0)
    assert works(
        page, lambda: page.mouse.click(*on_screen(view, page, first)), lambda: probe.point is not None
    )
    camera = np.array(client_of(view).camera.position)
    page.wait_for_timeout(2000)
    pull(page, on_screen(view, page, first), on_screen(view, page, last))
    assert until(lambda: np.linalg.norm(probe.point - last) < 0.01), probe.point
    np.testing.assert_allclose(client_of(view).camera.position, camera)  # the view stays
    said = page.get_by_role("textbox", name="Probe").input_value
    assert until(lambda: said() == probe_text(view._viewer.now(), list(probe.point)))
