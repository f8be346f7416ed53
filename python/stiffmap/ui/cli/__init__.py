"""The command line, ``stiffmap``."""

from __future__ import annotations

from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``stiffmap`` (default: with the process's arguments); returns the exit code. Quiet when interrupted."""
    try:
        from stiffmap.ui.cli.app import main as run

        return run(arguments)
    except KeyboardInterrupt:  # also while modules are imported
        return 130


__all__ = ["main"]
