"""An experiment from a table as a workshop has it: what ``stiffmap experiment new`` does."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial, reduce
from operator import attrgetter
from os import PathLike
from pathlib import Path

from stiffmap.common.broadcasting import given_path, one_of, real_number
from stiffmap.common.errors import FileError, MissingColumnError, StiffmapError
from stiffmap.common.fingerprints import file_digest
from stiffmap.common.outputs import new_file, putting
from stiffmap.common.short import short_repr
from stiffmap.common.tables.header import RECORD
from stiffmap.common.tables.sheet import Layout, read_sheet, with_header
from stiffmap.common.tables.side_by_side import side_by_side
from stiffmap.common.tables.table import Table, column_letter
from stiffmap.common.tables.table_file import TableFile, layout_of
from stiffmap.common.tables.workbook import WORKBOOKS, sheet_names
from stiffmap.common.units import SPELLINGS, known, unit_of
from stiffmap.experiment.experiment import Experiment
from stiffmap.experiment.files.fields import READ
from stiffmap.experiment.files.load import load_experiment
from stiffmap.experiment.noise.level import against_the_load, contradictions, no_difference, not_at_zero
from stiffmap.experiment.spreadsheet import dialogue
from stiffmap.experiment.spreadsheet.answers import Answers, Meant, Question
from stiffmap.experiment.spreadsheet.convert import ImportedSheet, write_folder
from stiffmap.experiment.spreadsheet.dh import LAYOUT, LEG, QUANTITIES, arm, left_out, read_dh
from stiffmap.experiment.spreadsheet.followed import followed
from stiffmap.experiment.spreadsheet.guess import guessed
from stiffmap.experiment.spreadsheet.instrument import Instrument, as_readings, load_instrument
from stiffmap.experiment.spreadsheet.joints import (
    DIFFERENCES,
    JOINT,
    as_seen,
    commanded,
    compared,
    drives_of,
    turned,
)
from stiffmap.experiment.spreadsheet.places import in_base_axes, seated, seen_next_to_commands, without_lost
from stiffmap.experiment.spreadsheet.reshaped import one_load_a_row, one_point_a_row, titled
from stiffmap.experiment.spreadsheet.sides import approached
from stiffmap.experiment.spreadsheet.spherical import spherical
from stiffmap.experiment.spreadsheet.together import named_targets, together
from stiffmap.experiment.spreadsheet.turned import oriented, positioned
from stiffmap.solve.machine import Machine, load_machine

Understand = Callable[[Sequence[str | None], dialogue.Ask | None], tuple[Meant, ImportedSheet]]
"""What is meant by the sheets of these names, side by side, with answers to questions."""


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
    sheet: Table = field(repr=False)
    understood: ImportedSheet = field(repr=False)
    commanded: Meant | None = field(repr=False)
    """Joints that the table commands."""


def experiment_from_table(
    machine: str | PathLike[str] | None,
    table: str | PathLike[str] | Sequence[str | PathLike[str]],
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
    ask: dialogue.Ask | None = None,
    overwrite: bool = False,
) -> FromTable:
    """Make an experiment folder of a spreadsheet or text table: columns, units, repeats and separators are understood.

    Parameters
    ----------
    machine
        Shipped name or machine file; or None and `dh`, a table of Denavit and Hartenberg of which ``machine.yaml`` is made in the
        folder, in the `dh_convention` ``standard`` or ``modified``.
    table, folder
        A workbook or a text, or several with rows of the same points, such as joints of a controller and places of a tracker, whose
        columns stand side by side; where the experiment is written.
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
    loaded = None if machine is None else load_machine(str(machine))
    drives = {} if loaded is None else drives_of(loaded)
    several = [table] if isinstance(table, str | PathLike) else [*table]
    file, *more = [given_path(t, "table", "a spreadsheet") for t in several]
    output = given_path(folder, "folder", "a folder")
    wrote = None if instrument is None else load_instrument(instrument)
    quantity = quantity or (wrote.quantity if wrote else "deflection")
    one_of(quantity, ("deflection", "position"), "quantity")
    one_of(difference, DIFFERENCES, "difference")
    new_file(output / "experiment.yaml", overwrite, output)
    wrong = sorted(set(record or ()) - {*RECORD})
    if wrong:
        raise StiffmapError(f"record: expected one of {', '.join(sorted(RECORD))}; got '{wrong[0]}'")
    chosen = {k: v.split("|") for k, v in (columns or {}).items()}
    sure = {READ.get(k, k): real_number(v, f"noise: {k}") for k, v in (noise or {}).items()}
    same = {k: real_number(v, f"constants: {k}") for k, v in (constants or {}).items()}
    given = Answers(chosen, dict(units or {}), same, sure)
    joints = None if dh is None else read_sheet(Path(dh), layout=LAYOUT)
    rows = None if joints is None else read_dh(joints, given.units, dh_convention)
    drives = drives if rows is None else {f"{LEG}.{r.name}": r.slides for r in rows}
    said = TableFile(file, columns or {}, units or {}, sheet, header, which)
    layout = layout_of(said, lambda n: guessed(n) != "note" or bool(JOINT.fullmatch(n)))

    def declared_for(m: Meant) -> Machine:
        if rows is None or dh is None:
            assert loaded is not None
            return loaded
        return Machine(arm(rows, dh_convention, output.name, f"from {Path(dh).name}", m.middle()))

    deflection, alone = quantity == "deflection", rows is not None
    wanted = _Wanted((file, *more), layout, drives, wrote, difference, deflection, given, declared_for, alone)
    m, found = _fitting(file, sheet, wanted.understood, ask)
    own = m.sheet
    _refuse_units(given.units, m, drives, () if rows is None else QUANTITIES)
    quantity = "position" if m.placed or "ll" in found.units else quantity
    declared = str(output / "machine.yaml") if machine is None else str(machine)
    title = f"from {reduce(lambda text, f: text.replace(str(f), f.name), (file, *more), own.file)}"
    source, digest = (", ".join(map(of, (file, *more))) for of in (attrgetter("name"), file_digest))
    kept = {"source": source, "sha256": digest, **(record or {})}
    with putting(output, "experiment.yaml") as fresh:
        write_folder(found, m, fresh, declared, quantity, title, kept)
        try:
            made = load_experiment(fresh)
        except FileError as error:  # nothing is left behind
            raise _of_sheet(error, found, own, fresh) from None
    made = replace(made, name=output.name)
    if dh is not None:
        declared_for(m).save(declared)
    # a gauge that is not at zero has no sign
    of_loads = no_difference(made) or not_at_zero(made) or against_the_load(made)
    warnings = tuple(line for line in (of_loads, *contradictions(made)) if line)
    left = () if joints is None else left_out(joints)
    remarks = (*m.said, *(f"left out: {t}" for t in own.left_out), *(f"left out of {dh}: {t}" for t in left))
    return FromTable(made, output, declared, warnings, remarks, own, found, m if m.columns else None)


def _refuse_units(units: Mapping[str, str], m: Meant, drives: Iterable[str], more: Iterable[str]) -> None:
    """StiffmapError for a unit that nobody knows, or of nothing that is there."""
    names = {c.meaning for c in m.guessed} | {*m.sheet.names, *m.sheet.header, *SPELLINGS}
    names |= {*more, "joints", "deviation"}  # the last is what a ball bar reads
    names |= {part for d in drives for part in (d, d.split(".")[-1])}
    for name, unit in units.items():
        if name not in names:
            there = ", ".join(m.sheet.header)
            raise StiffmapError(f"--unit {name}: no column has this name or meaning; columns: {there}")
        if unit_of(unit) is None:
            raise StiffmapError(f"--unit {name}: the unit '{unit}' is not known; known: {known()}")


def _fitting(
    file: Path, sheet: str | None, understood: Understand, ask: dialogue.Ask | None
) -> tuple[Meant, ImportedSheet]:
    """The sheet that fits with the answers in use, and what was understood of it."""
    names = sheet_names(file) if sheet is None and file.suffix.lower() in WORKBOOKS else [sheet]
    if len(names) == 1:
        return understood([sheet], ask)
    reasons: dict[str, StiffmapError] = {}
    for name in names:
        try:
            return understood([name], None)
        except StiffmapError as problem:
            reasons[str(name)] = problem
    parts = {n: p for n, p in reasons.items() if isinstance(p, Question)}
    if len(parts) > 1:
        try:
            return understood([*parts], None)
        except StiffmapError as problem:
            reasons["' and '".join(parts)] = problem
    tables = [n for n, p in parts.items() if p.waits]
    if ask is not None and tables:
        return understood([tables[0]], ask)
    lines = "; ".join(f"'{n}': {str(p).removeprefix(str(file)).lstrip(':, ')}" for n, p in reasons.items())
    raise StiffmapError(f"{file}: none of its {len(names)} sheets fits (--sheet NAME reads one). {lines}")


@dataclass(frozen=True)
class _Wanted:
    """What is wanted of each sheet."""

    files: Sequence[Path]
    """Whose columns stand side by side."""
    layout: Layout
    drives: Mapping[str, bool]
    """That it may command: name -> whether it slides."""
    wrote: Instrument | None
    difference: str
    deflection: bool
    """Rows of a deflection need a load."""
    given: Answers
    declared: Callable[[Meant], Machine]
    """The machine that it commands, by its joints `alone`."""
    alone: bool

    def _read(self, names: Sequence[str | None]) -> Table:
        first, *more = self.files
        if not more and len(names) == 1:
            return read_sheet(first, names[0], self.layout)
        header = self.layout.header
        each = replace(self.layout, header=(), numbered=self.layout.numbered or bool(header))
        table = side_by_side(
            [read_sheet(first, n, each) for n in names] + [read_sheet(f, None, each) for f in more]
        )
        return (
            replace(table, header=tuple(with_header(table.header, header, table.file))) if header else table
        )

    def understood(
        self, names: Sequence[str | None], ask: dialogue.Ask | None
    ) -> tuple[Meant, ImportedSheet]:
        """One sheet, or some side by side."""
        form = self._read(names)
        kept = dialogue.remembered(form)
        m = Meant.of_sheet(form, self.given if kept is None else kept.below(self.given))
        if kept is not None:
            m.said.append(f"answers of an earlier sheet of this form are used: {dialogue.profile_file(form)}")
        titled(m)
        one_point_a_row(m)
        one_load_a_row(m)
        together(m, self.deflection)
        positioned(m)
        approached(m)
        commanded(m, self.drives, self.alone)
        dialogue.asked(m, ask, partial(spherical, m, partial(self.declared, m)))
        measured = (self.wrote or load_instrument("tracker")).measured
        without_lost(m, self.wrote.columns if self.wrote else {}, measured)
        same = partial(compared, m, self.difference, measured, self.deflection)
        less: set[str] = set()
        if m.columns:
            dialogue.asked(m, ask, partial(seated, m))
            dialogue.asked(m, ask, same)
            as_seen(m, self.difference, self.wrote is not None)
        elif self.wrote is not None:
            if less := as_readings(m, self.wrote):
                compared(m, self.difference, measured, self.deflection, less)
        else:
            dialogue.asked(m, ask, same)
        dialogue.asked(m, ask, partial(in_base_axes, m, partial(self.declared, m)))
        oriented(m, partial(self.declared, m))
        followed(m, partial(self.declared, m))
        named_targets(m)
        if not m.placed:
            turned(m, self.difference, less)
        dialogue.asked(m, ask, partial(seen_next_to_commands, m))
        try:
            found = dialogue.ask_all(m, ask, self.deflection and not m.placed)
        except dialogue.Unanswered as left:
            said = m.to_remember(form, self.given)
            if said == self.given:
                raise
            kept_in = dialogue.remember(form, said)
            raise StiffmapError(f"{left}; the answers so far are remembered: {kept_in}") from None
        if m.answered:
            kept_in = dialogue.remember(form, m.to_remember(form, self.given))
            m.said.append(f"the answers are remembered for sheets of this form: {kept_in}")
        m.said += found.said
        return m, found


def _of_sheet(error: FileError, found: ImportedSheet, sheet: Table, fresh: Path) -> FileError:
    """An error of the generated files in the words of the sheet."""
    reason = re.sub(r" \(first in line \d+\)", "", error.reason)
    columns = {c.meaning: c for c in found.columns if c.meaning != "note"}

    def named(match: re.Match[str]) -> str:
        c = columns.get(match[1])
        return match[0] if c is None else f"column '{sheet.header[c.index]}' ({column_letter(c.index)})"

    reason = re.sub(r"column '([^']*)'", named, reason).replace(str(fresh), sheet.file)
    if isinstance(error, MissingColumnError):
        lost = re.match(r"missing column '(\w+)'", error.reason)
        reason += f"; say which by --map {lost[1] if lost else 'fx'}='HEADER'; columns: {', '.join(repr(h) for h in sheet.header)}"
    row = (error.line or 0) - 2
    within = error.file.endswith("data.csv") and 0 <= row < len(found.rows.lines)
    at = found.rows.lines[row] if within else None
    return FileError(reason, file=sheet.file, line=at, key=error.key)
