"""Runs the gallery's notebooks and writes them as pages.

python docs/gallery/build.py OUT: each `NAME.py` beside this file is executed and becomes OUT/NAME.html (and NAME.ipynb).
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

HERE = Path(__file__).parent


def notebooks() -> list[Path]:
    """The sources, in the percent form of jupytext."""
    return sorted(p for p in HERE.glob("*.py") if p.name != Path(__file__).name)


def executed(source: Path, seconds: int = 300) -> Any:
    """The notebook with its outputs; an error in a cell is raised."""
    import jupytext
    from nbclient import NotebookClient

    book = jupytext.read(source, fmt="py:percent")
    with TemporaryDirectory() as folder:
        NotebookClient(
            book, timeout=seconds, kernel_name="python3", resources={"metadata": {"path": folder}}
        ).execute()
    return book


def main(out: Path) -> None:
    """Writes every page."""
    import nbformat
    from nbconvert import HTMLExporter

    out.mkdir(parents=True, exist_ok=True)
    for source in notebooks():
        book = executed(source)
        nbformat.write(book, out / f"{source.stem}.ipynb")
        page, _ = HTMLExporter().from_notebook_node(book)
        (out / f"{source.stem}.html").write_text(page, encoding="utf-8")
        print(f"wrote {out / source.stem}.html")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "build/site/gallery"))
