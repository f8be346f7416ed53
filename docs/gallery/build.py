"""Runs the gallery's notebooks; docs/make_site.py makes pages of them."""

from __future__ import annotations

import os
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
    from traitlets.config import Config

    book = jupytext.read(source, fmt="py:percent")
    with TemporaryDirectory() as folder:
        # Sockets of its own: the default path is that of every kernel that was started in this folder.
        sockets = {"transport": "ipc", "ip": f"{folder}/kernel"} if os.name == "posix" else {}
        local = Config({"KernelManager": sockets})
        NotebookClient(
            book,
            timeout=seconds,
            startup_timeout=seconds,
            kernel_name="python3",
            resources={"metadata": {"path": folder}},
            config=local,
        ).execute()
    return book
