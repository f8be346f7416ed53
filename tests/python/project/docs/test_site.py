"""The documentation's site: every page has its place, every link leads somewhere, nothing is fetched from elsewhere."""

from __future__ import annotations

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
import yaml

ROOT = Path(__file__).parents[4]
DOCS = ROOT / "docs"
FETCHED = {("script", "src"), ("link", "href"), ("img", "src"), ("iframe", "src")}


def pages_of(nav: object) -> list[str]:
    """Pages of a navigation, however deep."""
    if isinstance(nav, str):
        return [nav]
    parts = nav.values() if isinstance(nav, dict) else nav
    assert not isinstance(parts, (int, float)) and parts is not None
    return [page for part in parts for page in pages_of(part)]  # type: ignore[attr-defined]


def test_every_page_has_one_place_in_the_navigation() -> None:
    listed = pages_of(yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"])
    notebooks = {f"gallery/{p.stem}.md" for p in (DOCS / "gallery").glob("*.py") if p.stem != "build"}
    there = {p.relative_to(DOCS).as_posix() for p in DOCS.rglob("*.md")} | notebooks
    assert sorted(listed) == sorted(there), "mkdocs.yml, nav: one line for each page of docs"


class Page(HTMLParser):
    """Names to which links may lead, links, and what a browser fetches."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.ids: set[str] = set()
        self.links: list[str] = []
        self.fetched: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        for name, value in attributes:
            if name in ("id", "name") and value:
                self.ids.add(value)
            if tag == "a" and name == "href" and value:
                self.links.append(value)
            elif (tag, name) in FETCHED and value:
                self.fetched.append(value)


def dead_links(site: Path) -> list[str]:
    """Links and files of a site that lead nowhere, or to another place on the network where a browser would fetch."""
    pages = {p: Page(p) for p in site.rglob("*.html") if p.name != "404.html"}
    wrong = []
    for path, page in pages.items():
        for link in [*page.links, *page.fetched]:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                if link in page.fetched and parts.scheme != "data":
                    wrong.append(f"{path.relative_to(site)} fetches {link}")
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            target = target / "index.html" if target.is_dir() else target
            anchor = unquote(parts.fragment)
            if not target.exists():
                wrong.append(f"{path.relative_to(site)} -> {link}")
            elif anchor and target in pages and anchor not in pages[target].ids:
                wrong.append(f"{path.relative_to(site)} -> {link}: no such place on the page")
    return wrong


def test_dead_links_are_noticed(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text(
        '<a href="b.html#here">b</a><a href="#nowhere">x</a><a href="gone.html">y</a>'
        '<a href="https://example.org">z</a><script src="https://example.org/s.js"></script>'
    )
    (tmp_path / "b.html").write_text('<p id="here">b</p>')
    found = " ".join(dead_links(tmp_path))
    assert len(dead_links(tmp_path)) == 3
    assert all(word in found for word in ("#nowhere", "gone.html", "fetches"))


def test_the_site_is_built_without_a_dead_link(tmp_path: Path) -> None:
    for needed in ("zensical", "mkdocstrings", "jupytext", "nbconvert"):
        pytest.importorskip(needed)
    command = [sys.executable, DOCS / "make_site.py", "--no-notebooks"]
    places = ["--output", tmp_path / "site", "--work", tmp_path / "work"]
    run = subprocess.run([*command, *places], capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr
    assert not re.search(r"(?i)warning", run.stdout + run.stderr)
    assert dead_links(tmp_path / "site") == []
    api = (tmp_path / "site/api.html").read_text(encoding="utf-8")
    assert 'id="stiffmap.solve.machine.Machine.solve"' in api
    assert (tmp_path / "site/search.json").stat().st_size > 100_000
