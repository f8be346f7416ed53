"""The library of the extra ``[view]``, imported only when something is to be looked at."""

from __future__ import annotations

from typing import Any

from stiffmap.common.errors import MissingPartError


def need_viser() -> Any:
    """The module; MissingPartError that says how to install it."""
    try:
        import viser
    except ModuleNotFoundError:
        raise MissingPartError(
            "a view needs viser, which is not installed: pip install stiffmap[view]"
        ) from None
    return viser
