"""Covariances of link files, kept in ``extra: link_covariance`` for `error_map(..., uncertainty=True)`."""

from __future__ import annotations

from typing import Any

import numpy as np

from stiffmap.model.files.context import Context, LinkUse

KEY = "link_covariance"
Extra = tuple[tuple[str, Any], ...]


def with_links(extra: Extra, new: dict[str, LinkUse], context: Context) -> Extra:
    """``extra`` with the covariances of springs that name link files, merged with those it keeps.

    A spring that now names a link file leaves the kept entry it was in. Springs of one file join, since one
    file is one error.

    Raises:
        FileError: the kept value is not (file, springs, 21 x 21 numbers) entries, or a file's covariance is
            another one than that kept for its other springs.
    """
    kept = _kept(dict(extra).get(KEY, ()), context)
    linked = {spring for use in new.values() for spring in use.springs}
    for file, use in list(kept.items()):
        use.springs[:] = [s for s in use.springs if s not in linked]
        if not use.springs:
            del kept[file]
    for file, use in new.items():
        old = kept.setdefault(file, LinkUse(use.covariance))
        if old.covariance != use.covariance:
            context.at("extra", KEY).fail(
                f"{file} has another covariance than the one kept here for {', '.join(old.springs)}; "
                "let all its springs name the file"
            )
        old.springs.extend(use.springs)
    uses = tuple((file, tuple(use.springs), use.covariance) for file, use in kept.items())
    return tuple(e for e in extra if e[0] != KEY) + (((KEY, uses),) if uses else ())


def _kept(entries: Any, context: Context) -> dict[str, LinkUse]:
    kept = {}
    try:
        for file, springs, rows in entries:
            if np.array(rows, dtype=float).shape != (21, 21):
                raise ValueError
            kept[str(file)] = LinkUse(
                tuple(tuple(float(v) for v in row) for row in rows), [str(s) for s in springs]
            )
    except (TypeError, ValueError):
        context.at("extra", KEY).fail("expected [file, [springs], 21 x 21 numbers] per link file")
    return kept
