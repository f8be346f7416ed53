"""A row of the scoreboard."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Peer:
    """What another package reaches with the same rows, or why there is no number."""

    name: str
    after: float | None
    """On unseen rows, in the unit of the row."""
    seconds: float | None = None
    note: str = ""


@dataclass(frozen=True)
class Row:
    """One measured set, or why it is not here."""

    set: str
    source: str
    """Where the data come from, and their licence."""
    authors: str
    """What the authors of the data reached, in their words' meaning and with their rows."""
    status: str = "measured"
    """``measured``, ``absent`` or ``failed``."""
    note: str = ""
    quantity: str = ""
    """What before and after are, with its unit."""
    before: float | None = None
    after: float | None = None
    """On rows that no fit saw."""
    unseen_rows: int | None = None
    unseen_by: str = ""
    """How the unseen rows were chosen."""
    cause: str = ""
    """The verdict, and what is named."""
    seconds: float | None = None
    """CPU time of stiffmap, with all folds and the verdict."""
    peers: tuple[Peer, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return {**asdict(self), "peers": [asdict(p) for p in self.peers]}

    @staticmethod
    def of(data: dict[str, Any]) -> Row:
        """From plain data."""
        return Row(**{**data, "peers": tuple(Peer(**p) for p in data["peers"])})
