"""How every command shows what it found and writes its files."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.text import Text
from rich.tree import Tree

from stiffmap.common.json_text import json_text
from stiffmap.common.outputs import make_folder, write_text

JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON instead of text (SI units).")]


def print_json(data: Any) -> None:
    """JSON on standard output: one document, keys in the order given, no NaN."""
    print(json_text(data), flush=True)  # a program that reads a pipe waits for it


def say(*told: Any) -> None:
    """Lines and tables on the terminal: text as it is, without markup and never broken; None: nothing."""
    console = Console(highlight=False, emoji=False)
    for each in told:
        if each is not None:
            console.print(
                each, soft_wrap=isinstance(each, (str, Text, Tree)), markup=not isinstance(each, str)
            )


def show(
    as_json: bool, data: Mapping[str, Any], told: Iterable[Any], files: Iterable[str | Path] | None = None
) -> None:
    """A result as JSON, with the files written, or as lines and tables for the terminal."""
    if as_json:
        print_json(data if files is None else {**data, "files": files})
        return
    say(*told)
    if files:
        say(f"wrote {', '.join(map(str, files))}")


def write_files(folder: Path | None, contents: Iterable[tuple[str, Any]]) -> list[Path]:
    """Write named datasets (.nc), data (.json), machines (.yaml) and figures, each of them made when its turn comes; no folder: nothing."""
    if folder is None:
        return []
    return [_written(make_folder(folder) / name, content) for name, content in contents]


def _written(path: Path, content: Any) -> Path:
    if path.suffix == ".json":
        return write_text(path, json_text(content))
    if path.suffix == ".nc":
        from stiffmap.workspace.maps.files import write_dataset

        return write_dataset(content, path)
    if path.suffix == ".yaml":
        content.save(path)
        return path
    from stiffmap.ui.plot import save

    return save(content, path)
