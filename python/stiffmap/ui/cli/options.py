"""Options and arguments that several commands share."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Annotated, Any, NamedTuple, get_args

import typer
from typer import CallbackParam

from stiffmap.common.errors import StiffmapError
from stiffmap.common.outputs.keeping import check_replaceable, reserved


def option(help: str, default: Any = None, *names: str, **more: Any) -> Any:
    """An option of one command, required where its default is ``...``; `names` and `more` as of ``typer.Option``."""
    return typer.Option(default, *names, help=help, **more)


LINE, PLANE, BOX = 1_000_000, 100_000, 1_000
"""The largest counts: along one line, along each axis of a plane or at each of many poses, along each edge of a box."""


def how_many(help: str, default: Any = None, *names: str, most: int = LINE) -> Any:
    """An option that says how many, at most `most`: more would fill the memory, or take days, before anything is said."""

    def at_most(param: CallbackParam, value: int | None) -> int | None:
        check_count(max(param.opts, key=len), value, most)
        return value

    return option(help, default, *names, callback=at_most)


def check_count(name: str, value: float | None, most: int) -> None:
    """StiffmapError with an option's name for more than it may be."""
    if value is not None and value > most:
        raise StiffmapError(f"{name}: expected at most {most}, got {value:.15g}")


def flag(help: str, name: str) -> Any:
    """An option without a value, which is not set by default."""
    return option(help, False, name)


def argument(help: str, default: Any = ...) -> Any:
    """An argument of one command, required where it has no default."""
    return typer.Argument(default, help=help)


def written(help: str, default: object = None, *names: str) -> Any:
    """Option for a file or folder that a command writes: no other job writes there while the command runs.

    `default` and `names` as of ``typer.Option``; ``-o, --output`` where there are no names.
    """
    return typer.Option(default, *(names or ("-o", "--output")), help=help, callback=_alone)


def _alone(context: typer.Context, path: Path | None) -> Path | None:
    if path is not None and not context.resilient_parsing:
        context.with_resource(reserved(path))
        if path.is_file() and "overwrite" not in {p.name for p in context.command.params}:
            check_replaceable(path)  # before anything is computed
    return path


class Tabular(NamedTuple):
    """Marks the argument of a table's file, whose command has the options of `TABLE` as well and gets a `TableFile` where one is given."""

    typed: Any
    """What the command line has for it."""


def typed_for(annotation: Any) -> Any:
    """What the command line has for the argument of a table's file; None for another argument."""
    parts = (annotation, *get_args(annotation))
    marks = (m for part in parts for m in getattr(part, "__metadata__", ()) if isinstance(m, Tabular))
    return next((m.typed for m in marks), None)


TablePath = Annotated[PathLike[str], Tabular(Path | None)]
TableText = Annotated[str | PathLike[str], Tabular(str | None)]
"""Where it may be something else than a file."""
TABLE: dict[str, tuple[Any, Any]] = {
    "columns": (list[str] | None, option(
        "What a column is, by header or number, e.g. x='X pos', y=2; the other sign: fz='-Last [kg]'; repeatable.", None, "--map"
    )),
    "units": (list[str] | None, option("Unit of a column without one, e.g. x=um; length=mm: of all of them.", None, "--unit")),
    "sheet": (str | None, option("Sheet of a workbook. [default: the first that fits]")),
    "header": (str | None, option("Names of the columns of a table that has none, e.g. id,x,y,z.")),
    "which": (int | None, option("Which of several tables on a sheet, from 1.", None, "--table")),
}  # fmt: skip
"""What a table does not say itself: fields of a `TableFile`, with the type and the option of each."""

Machine = Annotated[str, typer.Argument(help="Shipped name (stiffmap machines) or machine file.")]
Declared = Annotated[str, typer.Argument(help="Declared machine: shipped name or machine file.")]
Corrected = Annotated[
    str, typer.Argument(help="Corrected machine: file with its effects, or a shipped name.")
]
Experiment = Annotated[str, typer.Argument(help="Experiment: folder with experiment.yaml and its CSV file.")]
At = Annotated[str | None, typer.Option("--at", help="Commanded TCP in mm, e.g. 0,0,300. [default: home]")]
Places = Annotated[
    list[str] | None,
    typer.Option("--at", help="TCP position in mm, e.g. 0,0,300; repeatable. [default: home]"),
]
Effects = Annotated[
    list[str] | None,
    typer.Option("--effect", help="Add an effect, e.g. 'dead_zone actuator y half_width=12um'; repeatable."),
]
Gravity = Annotated[
    str | None,
    typer.Option(
        "--gravity", help="Gravity in m/s², base axes, e.g. 0,0,-9.81; default: the machine file's."
    ),
]
Force = Annotated[
    str,
    typer.Option(
        help="Force on the tool in N: a vector in base axes, such as 300,0,0, or a size, such as 300, "
        "whose directions are searched."
    ),
]
Method = Annotated[str, typer.Option(help="fast or reference.")]
Quantity = Annotated[str, typer.Option(help="deflection or position.")]
Frame = Annotated[str, typer.Option(help="Instrument's frame: known, offset_unknown or unknown.")]
Target = Annotated[str, typer.Option("--tool", help="Point on the tool: known or offset_unknown.")]
Budget = Annotated[
    float | None, typer.Option("--budget", min=0.1, help="Seconds after which the best so far is given.")
]
Spread = Annotated[
    float,
    typer.Option(
        "--tolerance", min=1e-3, help="Factor on the default standard uncertainties of the machine."
    ),
]
Scheduler = Annotated[str | None, typer.Option(help="Address of a dask scheduler whose workers do the work.")]
DhConvention = Annotated[
    str,
    typer.Option("--dh-convention", help="standard, or modified (Craig: a and alpha of the link before)."),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Overwrite what is there already.")]
Threads = Annotated[int | None, typer.Option(help="Threads; default: all cores.")]
Tolerance = Annotated[float, typer.Option(help="Tolerated deflection, mm.")]
Plane = Annotated[str, typer.Option(help="Plane in which the force turns: xy, xz or yz.")]
Folder = Annotated[Path | None, written("Folder for files and pictures.", ...)]
Rotation = Annotated[
    str | None,
    typer.Option(
        "--rotation", help="Commanded orientation as a rotation vector in deg, base axes, e.g. 0,0,30."
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of text (SI units).")]
