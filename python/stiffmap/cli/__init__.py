"""The command line, ``stiffmap``."""

from stiffmap.cli.app import main

__all__ = ["main"]
