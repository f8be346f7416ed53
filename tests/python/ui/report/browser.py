"""A page in headless Chromium: its pictures, its width, what its console says."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

PROBE = """<script>addEventListener("load", () => { const d = document.documentElement;
document.body.dataset.wide = d.scrollWidth - d.clientWidth;
document.body.dataset.lost = [...document.images].filter(i => !i.complete || !i.naturalWidth).length; });</script>"""


def chromium() -> str:
    """The browser's command; skips the test where none is installed."""
    found = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if found is None:
        pytest.skip("no Chromium is installed (Debian: apt-get install chromium)")
    return found


def look(page: Path, folder: Path, width: int = 900) -> dict[str, int]:
    """Pixels of overflow, pictures that are missing, lines of the console that are errors."""
    probed = folder / f"probe-{page.name}"
    probed.write_text(
        page.read_text(encoding="utf-8").replace("</body>", PROBE + "</body>"), encoding="utf-8"
    )
    command = [chromium(), "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
               f"--user-data-dir={folder / 'profile'}", f"--window-size={width},1200", "--enable-logging=stderr",
               "--virtual-time-budget=3000", "--dump-dom", probed.as_uri()]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=180, check=True)
    numbers = {k: int(v) for k, v in re.findall(r'data-(wide|lost)="(-?\d+)"', done.stdout)}
    return numbers | {"console": done.stderr.count("CONSOLE")}
