from __future__ import annotations

from itertools import chain

from rich.padding import Padding
from rich.text import Text

from stiffmap.model.files import shipped_machines
from stiffmap.ui.cli.output import Answer


def command() -> Answer:
    """List the machines that come with stiffmap.

    Examples:
      [cyan]stiffmap machines[/cyan]
      [cyan]stiffmap machines --json[/cyan]
    """
    shipped = shipped_machines()
    data = [{"name": m.name, "title": m.title, "source": m.source, "file": m.path} for m in shipped]
    titles = (Text.assemble((m.name, "bold"), f"  {m.title}") for m in shipped)
    sources = (Padding(Text(m.source, "dim"), (0, 0, 0, 2)) for m in shipped)
    return Answer(data, chain.from_iterable(zip(titles, sources, strict=True)))
