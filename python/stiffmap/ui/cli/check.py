"""``stiffmap check``."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape

from stiffmap.model.home import gap_text
from stiffmap.solve.check import FileCheck, check_file
from stiffmap.ui.cli.output import JsonOption, print_json

if TYPE_CHECKING:
    from stiffmap.solve.trial import Trial

MOST_CHANGES = 12


def check(
    file: Annotated[str, typer.Argument(help="Machine file, or the name of a shipped machine.")],
    strict: Annotated[bool, typer.Option("--strict", help="Exit with 1 where there are warnings.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Validate a machine file and look it over: keys, units, home, free motions, reach, odd numbers.

    Exit codes: 0 usable, 1 usable with warnings (--strict), 2 not usable.

    Examples:

      [cyan]stiffmap check my_machine.yaml[/cyan]

      [cyan]stiffmap check orthoglide-revised --json[/cyan]

      [cyan]stiffmap check --strict my_machine.yaml[/cyan]
    """
    result = with_advice(check_file(file), file)
    if as_json:
        print_json(as_plain(result))
    else:
        from stiffmap.solve.machine import Machine
        from stiffmap.solve.trial import tried

        _print(result, tried(Machine(result.description)))
    if strict and result.warnings:
        raise typer.Exit(1)


def with_advice(result: FileCheck, file: str) -> FileCheck:
    """The check with findings about freedoms, reach and numbers among its warnings."""
    from stiffmap.solve.advice import advice
    from stiffmap.solve.machine import Machine

    return replace(result, warnings=[*result.warnings, *advice(Machine(result.description), file)])


def as_plain(result: FileCheck) -> dict[str, Any]:
    """A check as JSON data (SI)."""
    return {
        "file": str(result.path),
        "name": result.description.name,
        "title": result.description.title,
        "counts": result.counts,
        "home_gaps": {g.name: {"translation": g.translation, "rotation": g.rotation} for g in result.gaps},
        "home_changes": {c.name: {"declared": c.declared, "closed": c.closed} for c in result.changes},
        "effects": [effect.kind for effect in result.description.effects],
        "warnings": result.warnings,
    }


def _print(result: FileCheck, trial: Trial) -> None:
    # soft_wrap: a path or a count must not be broken when piped
    console = Console(highlight=False, soft_wrap=True)
    machine = result.description
    console.print(f"[bold]{machine.name}[/bold]  {escape(machine.title)}")
    console.print("  " + ", ".join(f"{n} {sort}" for sort, n in result.counts.items() if n))
    console.print(f"  home as written is open at {gap_text(machine, result.gaps)}")
    for change in sorted(result.changes, key=lambda c: -abs(c.closed - c.declared))[:MOST_CHANGES]:
        console.print(f"  home, closed: {change.text(machine)}")
    if len(result.changes) > MOST_CHANGES:
        console.print(
            f"  home, closed: {len(result.changes) - MOST_CHANGES} smaller changes (--json lists all)"
        )
    for effect in machine.effects:
        console.print(f"  effect: {effect.kind} of {effect.element} {' '.join(effect.legs)}")
    if trial.stiffness is not None:
        low, high = (f"{1e-6 * v:.2g}" for v in trial.stiffness)
        console.print(
            f"  softest direction over the workspace: {low} … {high} N/µm, tried with {trial.force:.2g} N"
        )
    for warning in result.warnings:
        console.print(f"  [yellow]warning:[/yellow] {escape(warning)}")
    console.print("  [green]usable[/green]")
