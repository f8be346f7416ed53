"""A view in a real browser: headless Chromium, driven by Playwright."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from typing import Any

import pytest
from tests.python.ui.view.pages import opened, until

import stiffmap as sm

FLAGS = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--disable-dev-shm-usage",
)  # fmt: skip


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """A browser with a fresh profile and no network but this computer; skips where there is none."""
    pytest.importorskip("viser", reason="viser is not installed (pip install stiffmap[view])")
    api = pytest.importorskip(
        "playwright.sync_api", reason="playwright is not installed (pip install --group test)"
    )
    command = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if command is None:
        pytest.skip("no Chromium is installed (Debian: apt-get install chromium)")
    with api.sync_playwright() as p:
        context = p.chromium.launch_persistent_context(
            str(tmp_path_factory.mktemp("profile")), executable_path=command, headless=True, args=list(FLAGS),
            viewport={"width": 1100, "height": 700},
        )  # fmt: skip
        context.set_default_timeout(60_000)
        asked: list[str] = []
        context.on("request", lambda r: asked.append(r.url))
        context.asked = asked
        yield context
        context.close()


@pytest.fixture
def browser(chromium: Any) -> Iterator[Any]:
    """The browser, in which the pages of a test are closed after it."""
    before = list(chromium.pages)
    yield chromium
    chromium.set_offline(False)
    for page in set(chromium.pages) - set(before):
        page.close()


@pytest.fixture(scope="module")
def drawn(chromium: Any) -> Iterator[tuple[Any, Any]]:
    """A view and its page, which takes seconds to draw its first picture."""
    from stiffmap.ui.view.open import View, model_of

    with View(model_of(sm.load_machine("orthoglide-revised"))) as view:
        yield view, opened(chromium, view)


@pytest.fixture
def shown(drawn: tuple[Any, Any]) -> tuple[Any, Any]:
    """The same with the state, the tab and the size that it had at first."""
    view, page = drawn
    page.set_viewport_size({"width": 1100, "height": 700})
    page.get_by_role("tab", name="Tool and load").click()
    view.set(**vars(view._viewer.model.history.first))
    assert view._viewer.worker.idle(60)
    force = page.get_by_role("textbox", name="Force, N, z")
    assert until(lambda: force.input_value() == "-300")
    page.wait_for_timeout(500)  # the other fields have what holds as well
    return drawn
