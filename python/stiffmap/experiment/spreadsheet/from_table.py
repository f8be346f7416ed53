"""An experiment from a table as a workshop has it: what ``stiffmap experiment new`` does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

from stiffmap.common.broadcasting import given_path, one_of
from stiffmap.common.errors import StiffmapError
from stiffmap.common.fingerprints import file_digest
from stiffmap.common.outputs import new_file
from stiffmap.common.short import short_repr
from stiffmap.common.tables.header import RECORD
from stiffmap.common.tables.sheet import Layout, Sheet, read_sheet
from stiffmap.experiment.experiment import Experiment
from stiffmap.experiment.noise.level import against_the_load, contradictions
from stiffmap.experiment.spreadsheet.answers import Answers, Meant
from stiffmap.experiment.spreadsheet.convert import Imported
from stiffmap.experiment.spreadsheet.dh import LEG, arm, read_dh
from stiffmap.experiment.spreadsheet.dialogue import Ask
from stiffmap.experiment.spreadsheet.folder import make_experiment
from stiffmap.experiment.spreadsheet.guess import has_meaning
from stiffmap.experiment.spreadsheet.instrument import load_instrument
from stiffmap.experiment.spreadsheet.joints import DIFFERENCES, drives_of
from stiffmap.experiment.spreadsheet.reading import Reading, read_and_ask
from stiffmap.solve.machine import Machine, load_machine


@short_repr
@dataclass(frozen=True, eq=False)
class FromTable:
    """An experiment made from a table, and how the table was understood."""

    experiment: Experiment
    folder: Path
    machine: str
    """The machine that was declared, or the file that was made of a table of Denavit and Hartenberg."""
    warnings: tuple[str, ...]
    """What contradicts itself in the readings."""
    remarks: tuple[str, ...]
    """What was taken for granted, and what was left out."""
    sheet: Sheet = field(repr=False)
    understood: Imported = field(repr=False)
    commanded: Meant | None = field(repr=False)
    """Joints that the table commands."""


def experiment_from_table(
    machine: str | PathLike[str] | None,
    table: str | PathLike[str],
    folder: str | PathLike[str],
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    constants: Mapping[str, float] | None = None,
    noise: Mapping[str, float] | None = None,
    dh: str | PathLike[str] | None = None,
    dh_convention: str = "standard",
    difference: str = DIFFERENCES[0],
    quantity: str | None = None,
    instrument: str | None = None,
    sheet: str | None = None,
    header: Sequence[str] = (),
    which: int | None = None,
    record: Mapping[str, str] | None = None,
    ask: Ask | None = None,
    overwrite: bool = False,
) -> FromTable:
    """Make an experiment folder of a spreadsheet or text table: columns, units, repeats and separators are understood.

    Parameters
    ----------
    machine
        Shipped name or machine file; or None and `dh`, a table of Denavit and Hartenberg of which ``machine.yaml`` is made in the
        folder, in the `dh_convention` ``standard`` or ``modified``.
    table, folder
        A workbook or a text; where the experiment is written.
    columns
        What a column is, by its header or number: ``{"dx": "Uhr 1 [µm]"}``, repeats ``"Uhr 1|Uhr 2"``, the other sign
        ``{"fz": "-Last [kg]"}``. What is left out is guessed.
    units, constants, noise
        Unit of a column without one (``{"dx": "um", "joints": "deg"}``); what is the same in all rows, mm and N; one standard
        deviation of a reading, in its unit.
    difference, quantity, instrument
        ``actual-minus-target`` or ``target-minus-actual``; ``deflection`` or ``position``; what wrote the file, by name or mapping
        file.
    sheet, header, which
        Sheet of a workbook; names of the columns of a table that has none; which of several tables on a sheet, from 1.
    record
        For the report: operator, instrument, certificate, date, temperature, notes.
    ask
        Answers a question (text) that cannot be guessed; None: it is an error that says how to answer it.

    Raises StiffmapError for what cannot be understood, naming file, row and column.
    """
    if (machine is None) == (dh is None):
        raise StiffmapError("experiment: give either --machine or --dh")
    drives = {} if machine is None else drives_of(load_machine(str(machine)))
    file, output = given_path(table, "table", "a spreadsheet"), given_path(folder, "folder", "a folder")
    wrote = None if instrument is None else load_instrument(instrument)
    quantity = quantity or (wrote.quantity if wrote else "deflection")
    one_of(quantity, ("deflection", "position"), "quantity")
    one_of(difference, DIFFERENCES, "difference")
    said = {"columns": columns, "units": units, "constants": constants, "noise": noise, "record": record}
    for name, value in said.items():
        if value is not None and not isinstance(value, Mapping):
            raise StiffmapError(
                f"{name}: expected a mapping of columns to what is said of them, got {value!r}"
            )
    new_file(output / "experiment.yaml", overwrite, output)
    wrong = sorted(set(record or ()) - {*RECORD})
    if wrong:
        raise StiffmapError(f"record: expected one of {', '.join(sorted(RECORD))}; got '{wrong[0]}'")
    chosen = {k: v.split("|") for k, v in (columns or {}).items()}
    given = Answers(chosen, dict(units or {}), dict(constants or {}), dict(noise or {}))
    rows = None if dh is None else read_dh(read_sheet(Path(dh)), given.units)
    drives = drives if rows is None else {f"{LEG}.{r.name}": r.slides for r in rows}
    numbered = any(h.strip("+-").isdigit() for many in chosen.values() for h in many)
    layout = Layout(has_meaning, tuple(header), numbered, which)
    read = Reading(wrote, drives, difference, quantity == "deflection", layout)
    m, found = read_and_ask(file, sheet, read, given, ask)
    own = m.sheet
    if rows is not None and not m.columns:
        raise StiffmapError(f"{file}: no column commands a joint; the arm has {', '.join(drives)}")
    quantity = "position" if m.placed or "ll" in found.units else quantity
    declared = str(output / "machine.yaml") if machine is None else str(machine)
    title = f"from {own.file.replace(str(file), file.name)}"
    kept = {"source": file.name, "sha256": file_digest(file), **(record or {})}
    made = make_experiment(found, own, output, declared, quantity, m.noise, title, kept)
    if rows is not None and dh is not None:
        source = f"from {Path(dh).name}"
        Machine(arm(rows, dh_convention, output.name, source, m.middle())).save(declared)
    warnings = tuple(line for line in (against_the_load(made), *contradictions(made)) if line)
    remarks = (*m.said, *(f"left out: {text}" for text in own.aside))
    return FromTable(made, output, declared, warnings, remarks, own, found, m if m.columns else None)
