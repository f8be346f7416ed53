"""From what was understood of a sheet to a folder that loads, or to nothing at all."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from stiffmap.common.errors import FileError, MissingColumnError
from stiffmap.common.outputs import putting
from stiffmap.common.tables.sheet import Sheet, column_letter
from stiffmap.experiment import Experiment, load_experiment
from stiffmap.experiment.spreadsheet.convert import Imported, write_folder


def make_experiment(
    found: Imported,
    sheet: Sheet,
    folder: Path,
    machine: str,
    quantity: str,
    noise: Mapping[str, float],
    title: str,
    record: Mapping[str, str] | None = None,
) -> Experiment:
    """Write the folder and load it. Where it does not load nothing is left behind, and the error names row and column of
    the sheet. Raises FileError."""
    with putting(folder, "experiment.yaml") as fresh:
        write_folder(found, sheet, fresh, machine, quantity, noise, title, record)
        try:
            made = load_experiment(fresh)
        except FileError as error:
            raise of_sheet(error, found, sheet, fresh) from None
    return replace(made, name=folder.name)


def of_sheet(error: FileError, found: Imported, sheet: Sheet, fresh: Path) -> FileError:
    """An error of the generated files in the words of the sheet."""
    reason = re.sub(r" \(first in line \d+\)", "", error.reason)
    columns = {c.meaning: c for c in found.columns if c.meaning != "note"}

    def named(match: re.Match[str]) -> str:
        c = columns.get(match[1])
        return match[0] if c is None else f"column '{sheet.header[c.index]}' ({column_letter(c.index)})"

    reason = re.sub(r"column '([^']*)'", named, reason).replace(str(fresh), sheet.file)
    if isinstance(error, MissingColumnError):
        reason += f"; say which by --map fx='HEADER'; columns: {', '.join(repr(h) for h in sheet.header)}"
    at = None
    if (
        error.line is not None
        and error.file.endswith("data.csv")
        and 2 <= error.line < len(found.rows.lines) + 2
    ):
        at = found.rows.lines[error.line - 2]
    return FileError(reason, file=sheet.file, line=at, key=error.key)
