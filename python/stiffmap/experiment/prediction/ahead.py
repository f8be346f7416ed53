"""Slopes that are computed many at once, and asked for one by one."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Generic, TypeVar

from stiffmap.experiment.experiment import Floats

K = TypeVar("K", bound=Hashable)
Tell = Callable[[Sequence[K]], Sequence[Floats | None]]


class Ahead(Generic[K]):
    """Slopes by key, in the order in which they will be asked for; each is handed out once.

    tell
        Slopes of some keys; None where whole predictions are needed.
    """

    def __init__(self, keys: Sequence[K], at_once: int, tell: Tell[K]) -> None:
        self._keys, self._at_once, self._tell = keys, at_once, tell
        self._place = {key: i for i, key in enumerate(keys)}
        self._told: dict[K, Floats | None] = {}

    def of(self, key: K) -> Floats | None:
        """(n, c); None where whole predictions are needed, and for what is not among the keys."""
        if key not in self._place:
            return None
        if key not in self._told:
            some = self._keys[self._place[key] :][: self._at_once]
            self._told.update(zip(some, self._tell(some), strict=True))
        return self._told.pop(key)
