"""One command makes every picture that a page shows."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

DOCS = Path(__file__).parents[4] / "docs"


def test_every_picture_of_the_pages_is_made_by_the_script() -> None:
    spec = importlib.util.spec_from_file_location("images", DOCS / "images.py")
    assert spec and spec.loader
    images = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(images)
    pages = [DOCS.parent / "README.md", *sorted(DOCS.glob("*.md"))]
    shown = {
        name
        for p in pages
        for name in re.findall(r"\]\((?:docs/)?img/([^)]+)\)", p.read_text(encoding="utf-8"))
    }
    assert shown == set(images.pictures())
    stored = {p.relative_to(images.TARGET).as_posix() for p in images.TARGET.rglob("*.[pg][ni][gf]")}
    assert stored == shown
