"""``stiffmap machines``."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape
from rich.padding import Padding

from stiffmap.model.files import shipped_machines
from stiffmap.ui.cli.output import JsonOption, print_json


def machines(as_json: JsonOption = False) -> None:
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
    console = Console(highlight=False)
    for machine in shipped:
        console.print(f"[bold]{machine.name}[/bold]  {escape(machine.title)}")
        console.print(Padding(f"[dim]{escape(machine.source)}[/dim]", (0, 0, 0, 2)))
