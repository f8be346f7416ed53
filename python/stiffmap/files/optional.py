"""Parts of stiffmap that a file may need but that are loaded only then."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from stiffmap.errors import MissingPartError


def optional(module: str, name: str, purpose: str) -> Callable[..., Any]:
    """Function ``name`` of ``module``; raises `MissingPartError` where it is not installed."""
    try:
        found: Callable[..., Any] = getattr(import_module(module), name)
    except (ModuleNotFoundError, AttributeError) as error:
        missing = getattr(error, "name", None) or module
        raise MissingPartError(
            f"{purpose} need {module}.{name}, which is not installed ({missing})"
        ) from error
    return found
