from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from rich.text import Text

from stiffmap.model.home import ENOUGH, gap_text
from stiffmap.solve.advice import FileCheck, advice, check_file
from stiffmap.solve.machine import Machine
from stiffmap.solve.trial import tried
from stiffmap.ui.cli.options import argument, flag
from stiffmap.ui.cli.output import Answer

MOST_CHANGES = 12


def command(
    file: str = argument("Machine file, or the name of a shipped machine."),
    strict: bool = flag("Exit with 1 where there are warnings.", "--strict"),
) -> Answer:
    """Validate a machine file and look it over: keys, units, home, free motions, reach, odd numbers.

    Exit codes: 0 usable, 1 usable with warnings (--strict), 2 not usable.

    Examples:
      [cyan]stiffmap check my_machine.yaml[/cyan]
      [cyan]stiffmap check orthoglide-revised --json[/cyan]
      [cyan]stiffmap check --strict my_machine.yaml[/cyan]
    """
    found = check_file(file)
    result = replace(found, warnings=[*found.warnings, *advice(Machine(found.description), file)])
    return Answer(result.as_plain(), _lines(result), finding=strict and bool(result.warnings))


def _lines(result: FileCheck) -> Iterator[str | Text]:
    machine = result.description
    trial = tried(Machine(machine))
    yield Text.assemble((machine.name, "bold"), f"  {machine.title}")
    yield "  " + ", ".join(f"{n} {sort}" for sort, n in result.counts.items() if n)
    if any(max(g[1:]) > ENOUGH for g in result.gaps):
        yield f"  home as written is open at {gap_text(machine, result.gaps)}"
    for change in sorted(result.changes, key=lambda c: -abs(c.closed - c.declared))[:MOST_CHANGES]:
        yield f"  home, closed: {change.text(machine)}"
    if len(result.changes) > MOST_CHANGES:
        yield f"  home, closed: {len(result.changes) - MOST_CHANGES} smaller changes (--json lists all)"
    for effect in machine.effects:
        yield f"  effect: {effect.kind} of {effect.element} {' '.join(effect.legs)}"
    if trial.stiffness is not None:
        low, high = (f"{1e-6 * v:.2g}" for v in trial.stiffness)
        yield f"  softest direction over the workspace: {low} … {high} N/µm, tried with {trial.force:.2g} N"
    for warning in result.warnings:
        yield Text.assemble(("  warning:", "yellow"), f" {warning}")
    yield Text("  usable", "green")
