"""Pictures in files."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from stiffmap.common.errors import StiffmapError
from stiffmap.common.outputs.writing import writing


def write_picture(path: str | os.PathLike[str], figure: Any, dpi: int) -> Path:
    """Write a figure of matplotlib in the format that the file's name says; the same picture gives the same bytes.

    Raises FileError where it cannot be written, StiffmapError for an unknown format.
    """
    target = Path(path)
    try:
        with writing(target) as fresh:
            figure.savefig(fresh, dpi=dpi, metadata={"Software": None} if target.suffix == ".png" else None)
    except StiffmapError:
        raise
    except ValueError as error:
        raise StiffmapError(f"{target}: {error}") from error
    return target
