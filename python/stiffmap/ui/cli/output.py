"""How every command shows what it found, in lines, tables and JSON, and writes its files."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text
from rich.tree import Tree

from stiffmap.common.json_text import json_text
from stiffmap.common.outputs import make_folder, write_rows, write_text, writing

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

MEANINGS = {
    "UNREACHABLE": "the joints cannot get there, or a limit forbids it",
    "SINGULAR": "the machine can move freely there",
    "UNSTABLE": "it gives way before the whole load acts; a slender rod between balls in one piece does so "
    "early: docs/machine_files.md",
    "NOT_CONVERGED": "no equilibrium was found under the whole load",
}


class Answer(NamedTuple):
    """What a command found."""

    data: Any
    """For JSON."""
    told: Iterable[Any]
    """Lines and tables for the terminal; None: nothing."""
    files: Iterable[str | Path] | None = None
    """That were written; they are part of the JSON as well."""
    finding: bool = False
    """Whether there is something to act on: exit code 1."""


def show(as_json: bool, answer: Answer) -> None:
    """One document of JSON, or lines and tables for the terminal: text as it is, without markup and never broken."""
    data, told, files, _ = answer
    if as_json:
        text = json_text(data if files is None else {**data, "files": files})
        print(text, flush=True)  # a program that reads a pipe waits for it
        return
    console = Console(highlight=False, emoji=False)
    for each in (*told, f"wrote {', '.join(map(str, files))}" if files else None):
        if each is not None:
            unbroken = isinstance(each, (str, Text, Tree))
            console.print(each, soft_wrap=unbroken, markup=not isinstance(each, str))


def write_files(folder: Path | None, contents: Iterable[tuple[str, Any]]) -> list[Path]:
    """Write named datasets (.nc), data (.json), machines (.yaml), tables (.csv: head and rows), texts, bytes and figures, each of them made
    when its turn comes; no folder: nothing."""
    if folder is None:
        return []
    return [_written(make_folder(folder) / name, content) for name, content in contents]


def _written(path: Path, content: Any) -> Path:
    if path.suffix == ".json":
        return write_text(path, json_text(content))
    if isinstance(content, str):
        return write_text(path, content)
    if isinstance(content, bytes):
        with writing(path) as fresh:
            fresh.write_bytes(content)
        return path
    if path.suffix == ".csv":
        write_rows(path, *content)
        return path
    if path.suffix == ".nc":
        from stiffmap.workspace.maps.files import write_dataset

        return write_dataset(content, path)
    if path.suffix == ".yaml":
        content.save(path)
        return path
    from stiffmap.ui.plot import save

    save(content, path)
    content.set_layout_engine(None)  # as it is there now: a page draws it again, once
    return path


def table(
    title: str | None,
    heads: Sequence[str],
    rows: Iterable[Sequence[str]] = (),
    left: Sequence[str] = (),
    no_wrap: bool = False,
    **how: Any,
) -> Table:
    """Columns under their heads: numbers to the right, the words of the columns `left` to the left."""
    out = Table(box=box.SIMPLE_HEAD, title=title, **how)
    for head in heads:
        out.add_column(head, justify="left" if head in left else "right", no_wrap=no_wrap)
    for row in rows:
        out.add_row(*row)
    return out


def as_text(table: Table) -> tuple[list[str], list[tuple[str, ...]]]:
    """Headers and rows of a table without the terminal's colours."""
    columns = [[Text.from_markup(str(cell)).plain for cell in c.cells] for c in table.columns]
    return [str(c.header) for c in table.columns], list(zip(*columns, strict=True))


def failed(status: NDArray[np.uint8]) -> dict[str, int]:
    """Number of poses per status but CONVERGED."""
    from stiffmap.solve.compiled import Status, counted

    return {name: n for name, n in counted(status).items() if name != Status.CONVERGED.name}


def failed_in_words(failed: Mapping[str, int], what: str = "poses") -> list[Text]:
    """``12 poses: UNSTABLE (…)``, a line per status."""
    return [Text(f"{count} {what}: {name} ({MEANINGS[name]})", "yellow") for name, count in failed.items()]
