"""Places that an instrument saw, next to those that were commanded: whether they are in its own frame, and which were not seen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.experiment.files.fields import POSE, SEEN
from stiffmap.experiment.poses.handeye import in_own_frame
from stiffmap.experiment.spreadsheet.answers import Meant

NAMED = 5
"""Lines that a sentence names."""


def seen_next_to_commands(m: Meant) -> None:
    """Columns px, py, pz next to x, y, z: their frame, and the place of the target on the tool, are unknown where they lie elsewhere."""
    of = {c.meaning: c.index for c in m.guessed if c.repeat == 0}
    if m.columns or not set(SEEN) <= set(of) or not set(POSE) <= {*of, *m.constants}:
        return
    m.placed = True

    def column(meaning: str) -> Floats:
        if meaning not in of:
            return np.full(len(m.sheet), 1e-3 * m.constants[meaning])
        return m.unit(of[meaning], meaning).size * m.sheet.numbers(of[meaning])

    seen, commanded = (np.column_stack([column(a) for a in names]) for names in (SEEN, POSE))
    if in_own_frame(seen, commanded):
        names = ", ".join(f"'{m.sheet.header[of[s]]}'" for s in SEEN)
        m.head |= {"frame": "unknown", "tool": "unknown"}
        m.said.append(
            f"{names} lie elsewhere than the commands: they are places in the instrument's own frame, which is unknown, as is the place "
            "of the target on the tool"
        )


def without_lost(m: Meant, seen: Floats, commanded: Floats, names: Sequence[str]) -> Floats:
    """Places (n, k) with NaN in rows where all of a point are zero though others are not: the instrument had lost its target."""
    lost = (seen == 0.0).all(axis=1) & (commanded != 0.0).any(axis=1)
    if seen.shape[1] < 3 or not lost.any() or not seen.any():
        return seen
    lines = [str(m.sheet.lines[i]) for i in np.flatnonzero(lost)]
    more = f" and {len(lines) - NAMED} more" if len(lines) > NAMED else ""
    which = f"line{'s' if len(lines) > 1 else ''} {', '.join(lines[:NAMED])}{more}"
    m.said.append(f"left out: {which}: {', '.join(map(repr, names))} are 0, as of a target that was not seen")
    return np.where(lost[:, None], np.nan, seen)
