"""The view in a browser: a drag with the mouse, typed numbers, several pages, the page without a network."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.python.ui.view.pages import client_of, on_screen, opened, pixels, pulled, until, works

import stiffmap as sm
from stiffmap.ui.cli import main
from stiffmap.ui.view.controls import DECIMALS, PAUSE
from stiffmap.ui.view.open import View, model_of
from stiffmap.ui.view.plane import table

UNNAMED = """() => [...document.querySelectorAll("input:not([type=hidden]), textarea, button, [role=slider]")]
    .filter(e => !e.getAttribute("aria-label") && !e.getAttribute("aria-labelledby") && !e.labels?.length
        && !(e.tagName === "BUTTON" && e.textContent.trim()) && !e.closest("[aria-hidden=true]") && e.checkVisibility())
    .map(e => e.outerHTML)"""
"""Visible fields and buttons without a name for screen readers."""


def test_drag_probe_and_colours_equal_solve(shown: tuple[View, Any]) -> None:
    machine = sm.load_machine("orthoglide-revised")
    view, page = shown
    view.set(force=(200.0, 0.0, -100.0))
    camera = client_of(view).camera
    camera.position = (0.6, -0.8, 0.9)  # this moves what is looked at as well
    camera.look_at = (0.05, 0.05, 0.0)
    # the gizmo is dragged with the mouse by the handle of its z axis
    length = 0.14 * view._viewer.scene.extent
    a, b = ((0, 0, z) for z in (0.8 * length, 0.8 * length + 0.1))
    assert pulled(view, page, a, b, lambda: view.state.position[2] > 0.05), view.state.position
    x, y, z = view.state.position
    assert abs(x) < 1e-9 and abs(y) < 1e-9 and 0.05 < z < 0.2
    assert view._viewer.worker.idle(60)
    # what the page says is what is solved
    d = 1e6 * np.linalg.norm(machine.solve((x, y, z), view.state.wrench).displacement[:3])
    page.get_by_text(f"{d:.1f} µm").first.wait_for()
    # the probe: a click on the plane
    spot = (-0.13, -0.13, z)  # clear of the gizmo
    probe = page.get_by_role("textbox", name="Probe")
    assert works(
        page,
        lambda: page.mouse.click(*on_screen(view, page, spot)),
        lambda: probe.input_value().startswith("probe at"),
    )
    found = re.match(r"probe at \((.*), (.*), (.*)\) mm: (.*) µm", probe.input_value())
    assert found is not None
    at = [1e-3 * float(v) for v in found.groups()[:3]]
    assert np.linalg.norm(np.array(at) - spot) < 0.01
    there = 1e6 * np.linalg.norm(machine.solve(view._viewer.probe.point, view.state.wrench).displacement[:3])
    assert found[4] == f"{there:.5g}"
    # the colours on the screen are those of the values
    plane = view._viewer._plane
    low, high = plane.range
    page.wait_for_timeout(1500)
    image = pixels(page)
    seen = []
    for px in ((-0.1, 0.05), (-0.15, -0.1), (0.1, 0.22), (0.2, 0.2), (0.25, 0.1), (-0.15, 0.25)):
        value = 1e6 * np.linalg.norm(machine.solve((*px, z), view.state.wrench).displacement[:3])
        want = table()[round((value - low) / (high - low) * 255)].astype(int)
        u, v = (round(c) for c in on_screen(view, page, (*px, z)))
        near = image[v - 3 : v + 4, u - 3 : u + 4].reshape(-1, 3)
        seen.append(np.abs(near - want).max(axis=1).min() <= 4)
    assert sum(seen) >= 3, seen  # a link may stand before the others


def test_typed_numbers_undo_and_what_is_refused(shown: tuple[View, Any]) -> None:
    machine = sm.load_machine("orthoglide-revised")
    view, page = shown
    box = page.get_by_role("textbox", name="Force, N, z")
    box.fill("-450")
    box.press("Enter")
    assert until(lambda: view.state.force == (0.0, 0.0, -450.0)), view.state.force
    d = 1e6 * np.linalg.norm(machine.solve(view.state.position, view.state.wrench).displacement[:3])
    page.get_by_text(f"{d:.1f} µm").first.wait_for()
    tool = page.get_by_role("textbox", name="Tool, mm, x")
    tool.fill("9000")
    tool.press("Enter")
    page.get_by_role("alert").get_by_text("cannot reach (9000").wait_for()
    assert view.state.position == (0.0, 0.0, 0.0)
    assert until(lambda: tool.input_value() == "0")  # the panel shows what holds
    page.get_by_role("button", name="Undo").click()
    assert until(lambda: view.state.force == (0.0, 0.0, -300.0))


FIELDS: dict[str, list[tuple[str, str, Callable[[View], float], float]]] = {
    "Tool and load": [
        ("Tool, mm, x", "12.5", lambda v: v.state.position[0], 0.0125),
        ("Tool, mm, y", "-0.75", lambda v: v.state.position[1], -0.00075),
        ("Tool, mm, z", ".25", lambda v: v.state.position[2], 0.00025),
        ("Moment, N·m, x", ".25", lambda v: v.state.moment[0], 0.25),
        ("Moment, N·m, z", "-1.125", lambda v: v.state.moment[2], -1.125),
        ("Force, N, y", "100.5", lambda v: v.state.force[1], 100.5),
        ("Force, N, z", "-0.001", lambda v: v.state.force[2], -0.001),
        ("Force around z, deg", "90.5", lambda v: float(np.rad2deg(np.arctan2(*v.state.force[1::-1]))), 90.5),
        ("Size of the force, N", "200.5", lambda v: float(np.linalg.norm(v.state.force)), 200.5),
        ("Gravity downwards, m/s²", "9.806", lambda v: -(v.state.gravity or (0.0, 0.0, 0.0))[2], 9.806),
        ("Magnification", "37.5", lambda v: v.state.magnification or 0.0, 37.5),
    ],
    "Map": [
        ("Normal of a free plane, x", "0.125", lambda v: v.state.normal[0], 0.125),
        ("Tolerance, µm", "12.5", lambda v: v.state.tolerance, 12.5e-6),
        ("Frequency, Hz", "7.25", lambda v: v.state.frequency, 7.25),
    ],
    "Numbers": [
        ("Value, SI", "0.3", lambda v: next((x for _, x in v.state.changes), 0.0), 0.3),
        ("Value, SI", "0.0000000125", lambda v: next((x for _, x in v.state.changes), 0.0), 1.25e-8),
    ],
}  # fmt: skip


def close_to(found: Callable[[], float], wanted: float) -> bool:
    return found() == pytest.approx(wanted, rel=1e-6)


def entered(page: Any, name: str, text: str) -> Any:
    box = page.get_by_role("textbox", name=name)
    box.fill(text)
    box.press("Enter")
    return box


def test_decimals_are_taken_in_every_field_after_longer_numbers_were_refused_or_undone(browser: Any) -> None:
    with View(model_of(sm.load_machine("orthoglide-revised"))) as view:
        page = opened(browser, view)
        for tab, fields in FIELDS.items():
            page.get_by_role("tab", name=tab).click()
            before = {name: page.get_by_role("textbox", name=name).input_value() for name, *_ in fields}
            boxes = {n: entered(page, n, "9000.125" if n.startswith("Tool,") else "123.4567") for n in before}
            page.wait_for_timeout(500)  # the page sends the last key late
            view._viewer.act(lambda m: m.reset())
            for name, box in boxes.items():
                assert until(lambda b=box, t=before[name]: b.input_value() == t, 10), (
                    name,
                    box.input_value(),
                )
            for name, text, value, wanted in fields:
                box = entered(page, name, text)
                near = partial(close_to, lambda v=value: v(view), wanted)
                shown = partial(close_to, lambda b=box: float(b.input_value()), float(text))
                assert until(near, 10), (name, value(view), view._viewer.error)
                assert until(shown, 10), (name, box.input_value())
        page.get_by_role("button", name="All as in the file").click()
        own = next(iter(view._viewer.controls.numbers.all.values()))
        box = page.get_by_role("textbox", name="Value, SI")
        assert until(lambda: float(box.input_value()) == pytest.approx(own, rel=1e-9)), (
            own,
            box.input_value(),
        )


def test_what_came_late_to_a_page_does_not_stay_in_place_of_what_was_typed(shown: tuple[View, Any]) -> None:
    view, page = shown
    controls = view._viewer.controls
    box, field = page.get_by_role("textbox", name="Magnification"), controls._factor

    def late(event: Any) -> None:
        """What was written before arrives only now."""
        if event.client_id is not None:
            field._queue_update("value", 2000.0)

    field.on_update(late)
    controls._written[id(field)] = time.monotonic()  # as after a change of the load
    box.fill("37.5")
    box.press("Enter")
    assert until(lambda: view.state.magnification == 37.5, 10)
    field.remove_update_callback(late)
    page.wait_for_timeout(1e3 * (PAUSE + 1.5))
    assert box.input_value() == "37.5"


def test_a_number_whose_first_digits_are_refused_is_typed(shown: tuple[View, Any]) -> None:
    view, page = shown
    page.get_by_role("tab", name="Map").click()
    box = page.get_by_role("textbox", name="Tolerance, µm")
    box.click()
    box.press("Control+a")
    page.keyboard.type("0.25", delay=300)
    assert until(lambda: view.state.tolerance == 0.25e-6), (view.state.tolerance, box.input_value())
    box.press("Control+a")
    page.keyboard.type("0")
    page.get_by_role("alert").first.wait_for()
    assert until(lambda: box.input_value() == "0.25", 10), box.input_value()  # the panel shows what holds


def test_every_field_of_a_number_has_decimals() -> None:
    pytest.importorskip("viser", reason="viser is not installed (pip install stiffmap[view])")
    with View(model_of(sm.load_machine("orthoglide-revised"))) as view:
        controls = view._viewer.controls
        found = [*vars(controls).values(), *vars(controls.numbers).values(), *(h for h, _ in controls._shown)]
        fields = [h for h in found if hasattr(h, "precision") and h is not controls.mode]  # whole
        assert len(fields) >= 12
        assert {h.precision for h in fields} == {DECIMALS}


def test_the_page_holds_everything_and_asks_for_nothing(tmp_path: Path) -> None:
    pytest.importorskip("viser", reason="viser is not installed (pip install stiffmap[view])")
    machine = sm.load_machine("orthoglide-revised")
    page = tmp_path / "out.html"
    assert main(["view", "orthoglide-revised", "--at", "100,0,50", "--html", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    assert "__VISER_EMBED_DATA__" in text and "orthoglide-revised at (100.0, 0.0, 50.0) mm" in text
    for tag in ('<script src="http', '<link rel="stylesheet" href="http', "@import url(http"):
        assert tag not in text
    d = 1e6 * np.linalg.norm(machine.solve((0.1, 0, 0.05), (0, 0, -300.0, 0, 0, 0)).displacement[:3])
    assert f"{d:.1f} µm" in text


def test_the_page_opens_without_a_network(browser: Any, tmp_path: Path) -> None:
    page_file = tmp_path / "out.html"
    assert main(["view", "orthoglide-revised", "--html", str(page_file)]) == 0
    browser.set_offline(True)
    browser.asked.clear()
    page = browser.new_page()
    errors: list[str] = []
    page.on("pageerror", lambda e: errors.append(str(e)))
    page.goto(page_file.as_uri())
    page.locator("canvas").first.wait_for()
    page.get_by_text("where it comes from").wait_for()
    want = table()[0].astype(int)

    def painted() -> bool:
        return bool((np.abs(pixels(page) - want).max(axis=2) < 12).sum() > 300)

    assert until(painted)
    assert not errors
    assert [u for u in browser.asked if not u.startswith(("file:", "data:", "blob:"))] == []


def test_controls_have_names_and_take_the_keyboard(shown: tuple[View, Any]) -> None:
    view, page = shown
    page.get_by_role("tab", name="Tool and load").focus()
    page.keyboard.press("ArrowRight")
    assert page.get_by_role("tab", name="Map").get_attribute("aria-selected") == "true"
    page.get_by_role("status").first.wait_for()
    page.get_by_role("img", name=re.compile("deflection under this load")).wait_for()
    page.keyboard.press("ArrowLeft")
    assert page.get_by_role("slider", name="Size of the force, N").count() == 1
    assert until(lambda: not page.evaluate(UNNAMED)), page.evaluate(UNNAMED)
    for name in ("Undo", "Reset", "Round magnification"):
        assert page.get_by_role("button", name=name, exact=True).count() == 1
    page.keyboard.press("ArrowRight")
    isolines = page.get_by_role("checkbox", name="Isolines")
    isolines.focus()
    page.keyboard.press("Space")
    assert until(lambda: not view._viewer.controls.isolines.value)
