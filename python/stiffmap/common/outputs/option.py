"""The option of a command that says where it writes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import typer

from stiffmap.common.outputs.keeping import check_replaceable, reserved


def written(help: str, default: object = None, *names: str) -> Any:
    """Option for a file or folder that a command writes: no other job writes there while the command runs.

    `default` and `names` as of ``typer.Option``; ``-o, --output`` where there are no names.
    """
    return typer.Option(default, *(names or ("-o", "--output")), help=help, callback=_alone)


def _alone(context: typer.Context, path: Path | None) -> Path | None:
    if path is not None and not context.resilient_parsing:
        context.with_resource(reserved(path))
        if path.is_file() and "overwrite" not in {p.name for p in context.command.params}:
            check_replaceable(path)  # before anything is computed
    return path
