from __future__ import annotations

from pathlib import Path

from stiffmap.common.errors import StiffmapError
from stiffmap.identification.diagnosis.report.result import diagnosed
from stiffmap.identification.planning.budget import budgets
from stiffmap.identification.planning.changes import monitor
from stiffmap.ui.cli import options
from stiffmap.ui.cli.options import argument, option
from stiffmap.ui.cli.output import Answer


def command(
    machine: options.Declared,
    before: str = argument("Experiment folder: the machine as it was, or one specimen."),
    after: str = argument("Experiment folder: the machine now, or another specimen."),
    effect: options.Effects = None,
    diagnosis: Path | None = option("diagnosis.json of the last diagnosis: its effects are followed."),
    budget: bool = option("Print the uncertainty budget of every number now.", False),
) -> Answer:
    """What changed since the last diagnosis; or whether two specimens of a type share their numbers.

    The same effects are fitted to both experiments, each on its own. Exit codes: 0 nothing changed, 1 something
    did, 2 bad input.

    Examples:
      [cyan]stiffmap monitor orthoglide-revised january june --effect 'dead_zone actuator y half_width=10um'[/cyan]
      [cyan]stiffmap monitor orthoglide-revised january june --diagnosis january/diagnosis.json --budget[/cyan]
    """
    terms = [*(effect or ()), *(diagnosed(diagnosis) if diagnosis else ())]
    if not terms:
        raise StiffmapError("monitor: name what to follow, by --effect or --diagnosis")
    found = monitor(machine, before, after, terms)
    now = budgets(machine, after, found.second) if budget else []
    data = found.as_plain() | ({"budgets": now} if budget else {})
    return Answer(data, [str(found), *map(str, now)], finding=not found.common)
