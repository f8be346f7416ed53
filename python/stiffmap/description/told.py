"""A description as a notebook shows it."""

from __future__ import annotations

from collections.abc import Sequence

from stiffmap.description.machine import MachineDescription
from stiffmap.html import table, titled


def machine_html(d: MachineDescription, actuators: Sequence[str], points: Sequence[str]) -> str:
    """Title, what is commanded, elements of each leg."""
    rows = [("drives", ", ".join(actuators)), ("commanded", ", ".join(d.task) or "x, y, z, rx, ry, rz")]
    if d.workspace is not None:
        box = zip("xyz", *d.workspace, strict=True)
        rows.append(("workspace, mm", "; ".join(f"{a} {1e3 * u:g} … {1e3 * v:g}" for a, u, v in box)))
    rows.append(("points", ", ".join(points)))
    effects = "; ".join(f"{e.kind} of {e.element} {' '.join(e.legs)}" for e in d.effects)
    rows.append(("effects", effects or "none"))
    parts = [(f"leg {leg.name}", " → ".join(e.name for e in leg.elements)) for leg in d.legs]
    return titled(f"{d.name}: {d.title}", table(("", ""), rows), table(("chain", "elements"), parts))
