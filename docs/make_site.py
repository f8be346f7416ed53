"""Builds the documentation as a site that needs no server and no network: ``python docs/make_site.py [--output site]``.

The pages are plain Markdown, navigation and theme are in mkdocs.yml, which Zensical reads. This script brings together what
is not in `docs`: notebooks are executed and become pages with downloads, and files elsewhere in the repository to which a page links
are taken along. Every warning is an error. ``--no-notebooks`` keeps the notebooks' text and leaves their results out.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(Path(__file__).parent / "gallery"))
LINK = re.compile(r"(\]\()([^)#\s]+)((?:#[^)\s]*)?\))")


def main() -> int:
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--output", type=Path, default=ROOT / "site", help="folder that is replaced [site]")
    parser.add_argument("--work", type=Path, default=ROOT / "build/site", help="scratch folder [build/site]")
    parser.add_argument("--no-notebooks", action="store_true", help="do not execute the gallery")
    a = parser.parse_args()
    work = a.work.resolve()
    shutil.rmtree(work, ignore_errors=True)
    gather(work / "docs", not a.no_notebooks)
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    # forward slashes: a path with backslashes would be an escape in YAML
    (work / "mkdocs.yml").write_text(
        text.replace("paths: [python]", f'paths: ["{(ROOT / "python").as_posix()}"]'), encoding="utf-8"
    )
    done = subprocess.run(
        [sys.executable, "-m", "zensical", "build", "--strict", "--clean"],
        cwd=work,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=os.environ | {"NO_COLOR": "1"},
    )
    warned = [line for line in done.stdout.splitlines() if re.search(r"(?i)\bwarning\b|griffe", line)]
    if done.returncode or warned:
        print(done.stdout)
        return 1
    without_network(work / "site")
    if a.output.exists():
        shutil.rmtree(a.output)
    shutil.copytree(work / "site", a.output)
    print(f"wrote {a.output}/index.html and {len(list(a.output.rglob('*.html'))) - 1} more pages")
    return 0


def without_network(site: Path) -> None:
    """Zensical's pages for reading without a server fetch one script from the network: ours takes its place."""
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        own = Path(os.path.relpath(site / "file_worker.js", page.parent)).as_posix()
        page.write_text(text.replace("https://unpkg.com/iframe-worker/shim", own), encoding="utf-8")


def gather(docs: Path, run: bool) -> None:
    """Copies `docs`, notebooks as pages, and files beyond it that pages link to."""
    shutil.copytree(ROOT / "docs", docs, ignore=shutil.ignore_patterns("__pycache__", "*.py"))
    notebooks(docs / "gallery", run)
    taken: dict[Path, Path] = {}
    pages = [(p, ROOT / "docs" / p.relative_to(docs)) for p in sorted(docs.rglob("*.md"))]
    while pages:
        page, source = pages.pop()
        text = page.read_text(encoding="utf-8")

        def moved(match: re.Match[str], page: Path = page, source: Path = source) -> str:
            if re.match(r"[a-z]+:", match[2]):
                return match[0]
            target = (source.parent / match[2]).resolve()
            if not target.is_file() or not target.is_relative_to(ROOT):
                return match[0]  # a page that is made, or a dead link: Zensical reports it
            if target.is_relative_to(ROOT / "docs"):
                there = docs / target.relative_to(ROOT / "docs")
                if not there.exists():  # a Python file of the documentation
                    shutil.copy(target, there)
            else:
                there = docs / "repository" / target.relative_to(ROOT)
                if target not in taken:
                    taken[target] = there
                    there.parent.mkdir(parents=True, exist_ok=True)
                    shutil.copy(target, there)
                    if target.suffix == ".md":
                        pages.append((there, target))
            return match[1] + Path(os.path.relpath(there, page.parent)).as_posix() + match[3]

        page.write_text(LINK.sub(moved, text), encoding="utf-8")


def notebooks(folder: Path, run: bool) -> None:
    """NAME.md with its pictures, NAME.ipynb and NAME.py for each notebook; the gallery's list leads to the pages."""
    import build  # docs/gallery/build.py
    import jupytext
    import nbformat
    from nbconvert import MarkdownExporter

    for source in build.notebooks():
        book = build.executed(source) if run else jupytext.read(source, fmt="py:percent")
        name = source.stem
        shutil.copy(source, folder / source.name)
        nbformat.write(book, folder / f"{name}.ipynb")
        without_wide_reports(book.cells)
        text, more = MarkdownExporter().from_notebook_node(
            book, {"unique_key": name, "output_files_dir": f"{name}_files"}
        )
        for file, data in more.get("outputs", {}).items():
            (folder / file).parent.mkdir(exist_ok=True)
            (folder / file).write_bytes(data)
        head, _, rest = text.lstrip().partition("\n")
        downloads = f"[notebook]({name}.ipynb){{ download }} · [Python file]({name}.py){{ download }}"
        (folder / f"{name}.md").write_text(f"{head}\n\nDownload: {downloads}\n{rest}", encoding="utf-8")
    index = (folder / "index.md").read_text(encoding="utf-8")
    for source in build.notebooks():
        index = index.replace(f"[{source.name}]({source.name})", f"[{source.stem}]({source.stem}.md)")
    (folder / "index.md").write_text(index, encoding="utf-8")


def without_wide_reports(cells: Iterable[dict]) -> None:  # type: ignore[type-arg]
    """Datasets as text: their HTML needs style sheets of its own."""
    for cell in cells:
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            if "xr-wrap" in data.get("text/html", ""):
                del data["text/html"]


if __name__ == "__main__":
    raise SystemExit(main())
