from __future__ import annotations

import re
from collections.abc import Iterator
from os import PathLike
from pathlib import Path

import typer
from rich.text import Text

from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.outputs import new_file
from stiffmap.common.tables.table_file import layout_of, refuse_options, table_file, with_names
from stiffmap.common.tables.workbook import TABLES
from stiffmap.model.urdf import Imported, import_urdf
from stiffmap.solve.machine import Machine
from stiffmap.ui.cli import options
from stiffmap.ui.cli.inputs import flags_of, options_given
from stiffmap.ui.cli.options import argument, option, written
from stiffmap.ui.cli.output import Answer

AWAY = " (not on the way to the tip; masses stay on what carries them)"


def command(
    context: typer.Context,
    urdf: options.TablePath = argument(
        "URDF file, or a table of Denavit and Hartenberg (text, .md, .tex, .xlsx, .ods)."
    ),
    sidecar: Path | None = option("YAML with what a URDF lacks: loops, motors, compliances."),
    output: Path | None = written("Machine file to write. [default: NAME.yaml]"),
    dh_convention: options.DhConvention = "standard",
    tip: str | None = option(
        "Link of the URDF that is the tool. [default: tool0 and the like, or the only end]"
    ),
    overwrite: options.Overwrite = False,
) -> Answer:
    """Machine file from a URDF: its tree to a tool as a serial machine, with a sidecar also closed loops; or from a table
    of Denavit and Hartenberg: a serial arm with rigid joints, whose compliances can be written into the file.

    Exit codes: 0 done, 2 bad input.

    Examples:
      [cyan]stiffmap import arm.urdf -o arm.yaml[/cyan]
      [cyan]stiffmap import arm_dh.csv --dh-convention modified -o craig.yaml[/cyan]
      [cyan]stiffmap import delta.urdf --sidecar robot.yaml[/cyan]
      [cyan]stiffmap import arm.urdf --tip tool -o tool.yaml[/cyan]
    """
    file = Path(urdf)
    table = file.suffix.lower() in (*TABLES, ".txt", ".md", ".tex")
    expected, found, others = (
        ("URDF", "table", "sidecar tip") if table else ("table", "URDF", "dh_convention")
    )
    for name in set(others.split()) & set(options_given(context)):
        flag = flags_of(context)[name]
        raise FileError(f"{flag}: expected a {expected} with this option, found a {found}", file=str(urdf))
    if not table:
        refuse_options(urdf, "a URDF")
    read = _of_table(urdf, dh_convention) if table else import_urdf(urdf, sidecar, tip=tip)
    machine = Machine(read.description)
    file = new_file(output or file.with_name(f"{machine.name}.yaml"), overwrite)
    machine.save(file)
    data = {"file": file, "name": machine.name, "legs": machine.legs, "actuators": machine.actuators, "tip": read.tip,
            "left_out": read.left_out, "rigid": read.rigid}  # fmt: skip
    lines = [f"wrote {file}: legs {', '.join(machine.legs)}; {len(machine.actuators)} actuators"]
    assumed = table and "dh_convention" not in options_given(context)
    return Answer(data, [*lines, *_remarks(read, assumed)])


def _remarks(found: Imported, assumed: bool) -> Iterator[Text]:
    """What was chosen, left out, taken as rigid, or `assumed` of a table."""
    if assumed:
        from stiffmap.experiment.spreadsheet.dh import ASSUMED

        yield Text.assemble(("convention", "yellow"), f": {ASSUMED}")
    for head, text, there in (
        ("tip", f" {found.tip}, {found.choice}; --tip LINK takes another", found.choice),
        ("left out", f"{AWAY if found.tip else ''}: {', '.join(found.left_out)}", found.left_out),
        ("no mass", f" (gravity does not pull on these links): {', '.join(found.massless)}", found.massless),
        ("rigid", f" (no compliance in the sidecar): {', '.join(found.rigid)}", found.rigid),
    ):  # fmt: skip
        if there:
            yield Text.assemble((head, "yellow"), text)


def _of_table(table: str | PathLike[str], convention: str) -> Imported:
    from stiffmap.common.tables.header import split_unit
    from stiffmap.common.tables.sheet import read_sheet
    from stiffmap.experiment.spreadsheet.dh import LAYOUT, QUANTITIES, arm, left_out, read_dh

    said, file = table_file(table), Path(table)
    name = re.sub(r"[^A-Za-z0-9_\-]+", "-", file.stem)
    if wrong := [n for n in said.units if n not in {*QUANTITIES, *QUANTITIES.values()}]:
        raise StiffmapError(f"--unit {wrong[0]}: expected one of {', '.join(QUANTITIES)}")
    sheet = read_sheet(file, said.sheet, layout_of(said, LAYOUT.known, names=LAYOUT.names))
    sheet = with_names(said, sheet, lambda header: split_unit(header)[0])
    rows = read_dh(sheet, said.units, convention)
    description = arm(rows, convention, name, f"from {file.name}")
    return Imported(description, left_out(sheet), tuple(r.name for r in rows))
