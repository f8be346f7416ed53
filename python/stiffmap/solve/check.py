"""What is in a machine file, and whether it is sound."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from stiffmap.model.description import Joint, MachineDescription
from stiffmap.model.description.tree import all_elements
from stiffmap.model.files.load import load_description
from stiffmap.model.files.shipped import find
from stiffmap.model.home import Gap, gap_text
from stiffmap.solve.compiled import CompiledMachine
from stiffmap.solve.compiled.lowering import home_gaps
from stiffmap.solve.redesign import HomeChange, home_changes

GAP_LIMIT, TURN_LIMIT = 1e-4, 1e-3
"""Gap of the home over the size of the machine, and rad, beyond which a number was probably mistyped; the
solver closes what is smaller."""


@dataclass(frozen=True)
class FileCheck:
    """Result of `check_file`.

    ``counts`` says how many elements of each sort there are (``actuators`` apart from ``joints``);
    ``gaps`` how well the declared home configuration closes, ``changes`` what closing it changes;
    ``warnings`` what deserves a second look.
    """

    path: Path
    description: MachineDescription
    counts: dict[str, int]
    gaps: list[Gap]
    changes: list[HomeChange]
    warnings: list[str]

    def as_plain(self) -> dict[str, Any]:
        """Data of JSON, SI."""
        return {
            "file": str(self.path),
            "name": self.description.name,
            "title": self.description.title,
            "counts": self.counts,
            "home_gaps": {g.name: {"translation": g.translation, "rotation": g.rotation} for g in self.gaps},
            "home_changes": {c.name: {"declared": c.declared, "closed": c.closed} for c in self.changes},
            "effects": [effect.kind for effect in self.description.effects],
            "warnings": self.warnings,
        }


def check_file(path: str | PathLike[str]) -> FileCheck:
    """Load a machine (by path or shipped name) and look it over; raises `StiffmapError` if unusable."""
    description = load_description(path)
    # refuses a home configuration that does not close, with each leg's gap
    compiled = CompiledMachine(description)
    changes, gaps = home_changes(compiled), home_gaps(description)
    warnings = _warnings(description, gaps, compiled.length)
    return FileCheck(find(path), description, _counts(description), gaps, changes, warnings)


def _counts(description: MachineDescription) -> dict[str, int]:
    names = {"Offset": "offsets", "Spring": "springs", "Body": "bodies", "Point": "points", "Block": "blocks"}
    counts = Counter(
        ("actuators" if e.actuated else "joints") if isinstance(e, Joint) else names[type(e).__name__]
        for _, e in all_elements(description)
    )
    keys = ("actuators", "joints", "springs", "blocks", "bodies", "points")
    return {"legs": len(description.legs), **{key: counts[key] for key in keys}}


def _warnings(description: MachineDescription, gaps: list[Gap], size: float) -> list[str]:
    wide = [gap for gap in gaps if gap.translation > GAP_LIMIT * size or gap.rotation > TURN_LIMIT]
    warnings = []
    if wide and not description.search_home:
        warnings.append(f"the home coordinates do not close: {gap_text(description, wide)}")
    if not any(isinstance(e, Joint) and e.actuated for _, e in all_elements(description)):
        warnings.append("no actuator: the machine cannot be commanded")
    if description.workspace is None:
        warnings.append("no workspace: maps need their ranges given")
    return warnings
