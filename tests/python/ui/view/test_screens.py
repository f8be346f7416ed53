"""What a person sees of the view and takes with the mouse, on large and small screens: headless Chromium."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from tests.python.ui.view.pages import on_screen, opened

import stiffmap as sm
from stiffmap.ui.view.open import View, model_of
from stiffmap.ui.view.outputs import write_page

ON_CANVAS = "p => !!document.elementFromPoint(...p)?.closest(':has(> canvas)')"
"""Whether what is seen at a place of the page is the scene, not something over it."""
SIZES = [(1024, 600), (390, 844)]


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_the_panel_does_not_hide_the_tool(browser: Any, width: int, height: int) -> None:
    with View(model_of(sm.load_machine("orthoglide-revised"))) as view:
        page = opened(browser, view, width, height)
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
