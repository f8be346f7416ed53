"""Moving pictures and screenshots of docs/view.md: `python docs/view_movie.py FILE`, or `machines FOLDER`: every shipped machine.

Needs the extra [view], Playwright's wheel and a Chromium of the system. The tool of the revised Orthoglide goes from home to
the corner in which it is weak; every picture is a screenshot of the page.
"""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from playwright.sync_api import sync_playwright

import stiffmap as sm
from stiffmap.ui.view.open import View, model_of

FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync", "--use-gl=angle", "--use-angle=swiftshader",
         "--enable-unsafe-swiftshader", "--disable-dev-shm-usage"]  # fmt: skip
FRAMES, COLOURS = 16, 256
START, CORNER = np.array([0.0, 0.0, 0.0]), np.array([0.28, 0.28, 0.28])
LOAD = {"force": (300.0, 0.0, 0.0), "quantity": "deflection", "magnification": 200.0}


@contextmanager
def page_of(view: View, width: int = 1000, height: int = 620) -> Iterator[Any]:
    """A page with the view, its panel open and its notice of slow graphics closed."""
    command = shutil.which("chromium") or shutil.which("google-chrome")
    with sync_playwright() as p, tempfile.TemporaryDirectory() as folder:
        browser = p.chromium.launch_persistent_context(
            folder,
            executable_path=command,
            headless=True,
            args=FLAGS,
            viewport={"width": width, "height": height},
        )
        browser.set_default_timeout(120_000)
        page = browser.new_page()
        page.goto(view.url)
        page.get_by_role("tab", name="Tool and load").wait_for()
        page.wait_for_timeout(2500)
        for close in page.locator(".mantine-Notification-closeButton").all():
            close.click()
        page.wait_for_timeout(1000)
        yield page
        browser.close()


def shot(view: View, page: Any, wait: int = 900) -> Image.Image:
    """The page when all is drawn."""
    view._viewer.worker.idle(60)
    page.wait_for_timeout(wait)
    return Image.open(io.BytesIO(page.screenshot())).convert("RGB")


def look(view: View) -> None:
    """From above, so that the plane is seen."""
    for client in view._server.get_clients().values():
        client.camera.position = (0.35, -0.95, 1.35)  # this moves what is looked at as well
        client.camera.look_at = (-0.12, -0.15, -0.05)


def movie(target: Path) -> None:
    """From home to the weak corner, and the shares."""
    with View(model_of(sm.load_machine("orthoglide-revised"), START, **LOAD)) as view, page_of(view) as page:
        look(view)
        page.get_by_role("tab", name="Why").click()
        frames = []
        for t in (1 - np.cos(np.linspace(0, np.pi, FRAMES))) / 2:
            view.set(position=tuple(float(v) for v in START + t * (CORNER - START)))
            frames.append(shot(view, page))
    palette = frames[-1].quantize(COLOURS)  # one for all, so that a frame holds only what differs
    small = [
        f.resize((800, 496), Image.Resampling.LANCZOS).quantize(palette=palette, dither=Image.Dither.NONE)
        for f in frames
    ]
    hold = [1200, *[160] * (FRAMES - 2), 2500]
    small[0].save(target, save_all=True, append_images=small[1:], duration=hold, loop=0, optimize=True)


def still(target: Path) -> None:
    """The first look, the shares at the corner, or the worst direction there with the ellipsoid, by the file's name."""
    place = START if target.stem == "first" else CORNER
    with View(model_of(sm.load_machine("orthoglide-revised"), place, **LOAD)) as view, page_of(view) as page:
        look(view)
        if target.stem == "why":
            page.get_by_role("tab", name="Why").click()
        if target.stem == "worst":
            view.set(quantity="worst", plane="free", normal=(1.0, -1.0, 0.0))
            page.get_by_role("tab", name="Map").click()
            page.get_by_label("At the tool").first.click()
            page.get_by_role("option", name="ellipsoid").click()
        shot(view, page, 2500).quantize(128).save(target, optimize=True)


def machines(folder: Path) -> None:
    """A screenshot of every shipped machine, to be looked at."""
    for name in sm.machine_names():
        with View(model_of(sm.load_machine(name))) as view, page_of(view) as page:
            shot(view, page, 1500).save(folder / f"{name}.png")
            print(folder / f"{name}.png", flush=True)


def main(wanted: list[str]) -> None:
    if wanted[0] == "machines":
        machines(Path(wanted[1]))
        return
    target = Path(wanted[0])
    (movie if target.suffix == ".gif" else still)(target)


if __name__ == "__main__":
    main(sys.argv[1:])
