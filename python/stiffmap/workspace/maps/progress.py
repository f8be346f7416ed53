"""Progress bars on long work."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

T = TypeVar("T")


def track(items: Iterable[T], total: int, what: str, show: bool | None) -> Iterable[T]:
    """The items, with a bar on standard error where wanted; None: where that is a terminal."""
    if show is False:
        return items
    from rich import progress
    from rich.console import Console

    console = Console(stderr=True)
    hidden = show is None and not console.is_terminal
    return progress.track(items, what, total, console=console, transient=True, disable=hidden)
