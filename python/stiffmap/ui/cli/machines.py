"""``stiffmap machines``."""

from __future__ import annotations

from rich.padding import Padding
from rich.text import Text

from stiffmap.model.files import shipped_machines
from stiffmap.ui.cli import options
from stiffmap.ui.cli.output import print_json, say


def command(as_json: options.Json = False) -> None:
    """List the machines that come with stiffmap.

    Examples:

      [cyan]stiffmap machines[/cyan]

      [cyan]stiffmap machines --json[/cyan]
    """
    shipped = shipped_machines()
    if as_json:
        print_json(
            [{"name": m.name, "title": m.title, "source": m.source, "file": str(m.path)} for m in shipped]
        )
        return
    for machine in shipped:
        say(Text.assemble((machine.name, "bold"), f"  {machine.title}"))
        say(Padding(Text(machine.source, "dim"), (0, 0, 0, 2)))
