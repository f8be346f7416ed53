"""What a view that is open can do, for rooms below the view."""

from __future__ import annotations

from typing import Protocol, Self


class OpenView(Protocol):
    """What `Machine.view` returns: a view that is open; `close` ends it, as the end of a ``with`` block does."""

    @property
    def url(self) -> str:
        """Address to open in a browser."""

    @property
    def link(self) -> str:
        """The address with machine, pose, load, plane and changed numbers."""

    def set(self, **values: object) -> None:
        """New values of the state, such as ``force=(0, 0, -500)``; SI."""

    def wait(self) -> None:
        """Until the program is interrupted."""

    def close(self) -> None:
        """End the view."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...
