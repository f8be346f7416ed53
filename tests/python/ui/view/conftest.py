"""A view in a real browser: headless Chromium, driven by Playwright."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

FLAGS = (
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--disable-dev-shm-usage",
)  # fmt: skip


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Any]:
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
            str(tmp_path / "profile"), executable_path=command, headless=True, args=list(FLAGS),
            viewport={"width": 1100, "height": 700},
        )  # fmt: skip
        context.set_default_timeout(60_000)
        asked: list[str] = []
        context.on("request", lambda r: asked.append(r.url))
        context.asked = asked
        yield context
        context.close()
