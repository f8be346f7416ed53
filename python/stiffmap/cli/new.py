"""``stiffmap new``."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from stiffmap.cli.output import JsonOption, print_json
from stiffmap.errors import FileError
from stiffmap.files.starter import starter_text
from stiffmap.outputs import write_text


def new(
    file: Annotated[Path, typer.Argument(help="File to write; its stem becomes the machine's name.")],
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Overwrite an existing file.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Start a machine file from a template in which every key is explained.

    Examples:

      [cyan]stiffmap new my_machine.yaml[/cyan]

      [cyan]stiffmap new --overwrite my_machine.yaml[/cyan]
    """
    if file.exists() and not overwrite:
        raise FileError("exists already; use --overwrite to replace it", file=str(file))
    name = re.sub(r"[^A-Za-z0-9_\-]+", "-", file.stem)
    write_text(file, starter_text(name))
    if as_json:
        print_json({"file": str(file), "name": name})
    else:
        console = Console(highlight=False, soft_wrap=True)
        console.print(
            f"wrote {escape(str(file))}; edit it, then: [cyan]stiffmap check {escape(str(file))}[/cyan]"
        )
