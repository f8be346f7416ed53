"""``stiffmap import``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from stiffmap.cli.output import JsonOption, print_json
from stiffmap.errors import FileError
from stiffmap.outputs.option import written


def import_urdf(
    urdf: Annotated[Path, typer.Argument(help="URDF file.")],
    sidecar: Annotated[
        Path | None, typer.Option(help="YAML with what a URDF lacks: loops, motors, compliances.")
    ] = None,
    output: Annotated[Path | None, written(help="Machine file to write. [default: NAME.yaml]")] = None,
    without_meshes: Annotated[bool, typer.Option("--without-meshes", help="Do not look for meshes.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Overwrite an existing file.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Machine file from a URDF: its tree to a tool as a serial machine, with a sidecar also closed loops.

    Exit codes: 0 done, 2 bad input.

    Examples:

      [cyan]stiffmap import arm.urdf -o arm.yaml[/cyan]

      [cyan]stiffmap import delta.urdf --sidecar robot.yaml --without-meshes[/cyan]
    """
    from stiffmap.machine import Machine
    from stiffmap.urdf import import_urdf as read

    found = read(urdf, sidecar, meshes=not without_meshes)
    machine = Machine(found.description)
    file = output or urdf.with_name(f"{machine.name}.yaml")
    if file.exists() and not overwrite:
        raise FileError("exists already; use --overwrite to replace it", file=str(file))
    machine.save(file)
    if as_json:
        print_json({"file": str(file), "name": machine.name, "legs": list(machine.legs),
                    "actuators": list(machine.actuators), "left_out": list(found.left_out),
                    "rigid": list(found.rigid)})  # fmt: skip
        return
    console = Console(highlight=False, soft_wrap=True)
    console.print(
        f"wrote {escape(str(file))}: legs {', '.join(machine.legs)}; {len(machine.actuators)} actuators"
    )
    if found.left_out:
        console.print(f"[yellow]left out[/yellow] (not on the way to the tip): {', '.join(found.left_out)}")
    if found.rigid:
        console.print(f"[yellow]rigid[/yellow] (no compliance in the sidecar): {', '.join(found.rigid)}")
