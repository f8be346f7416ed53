"""What is in a machine file, and what a file that loads may still have wrong: freedoms, reach, and numbers that no workshop has."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from stiffmap.common.units import DENSITY, LENGTH, MODULUS, UnitSystem
from stiffmap.common.yaml_text import read
from stiffmap.model.description import Body, Cable, Joint, MachineDescription, Offset, Spring
from stiffmap.model.description.tree import all_elements, chains, sequences
from stiffmap.model.files.load import load_description
from stiffmap.model.files.schema.base import NAMED
from stiffmap.model.files.shipped import find
from stiffmap.model.home import Gap, gap_text
from stiffmap.solve.compiled import CompiledMachine, Status
from stiffmap.solve.compiled.lowering import home_gaps
from stiffmap.solve.machine import Machine
from stiffmap.solve.mobility import NAMES, direction, free_motions
from stiffmap.solve.redesign import HomeChange, home_changes
from stiffmap.solve.singular_home import serial_home, singular_words
from stiffmap.solve.trial import tried

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


TRIAL = 0.01
"""Of the machine's length, how far from home reach is tried."""
STEEL = 8000.0
SOLIDS = {
    "E": (MODULUS, "{0.force}/{0.length}²", 3e8, 2e12, 2.1e11),
    "density": (DENSITY, "{0.mass}/{0.length}³", 20.0, 25e3, 7850.0),
}
"""Numbers of materials: their unit, the least and the largest from polyethylene and foam to diamond and osmium, and that of steel, SI."""
RIGID = "the machine is rigid: no spring and no drive yields, so nothing deflects"


def advice(machine: Machine, path: str | PathLike[str]) -> list[str]:
    """Findings in sentences, the gravest first; empty where there is nothing to say."""
    return [
        *_freedoms(machine),
        *_reach(machine),
        *_limits(machine),
        *_trial(machine),
        *_numbers(machine, path),
        *_beams(machine),
    ]


def _freedoms(machine: Machine) -> list[str]:
    s = machine.solve(machine.description.home.p, np.zeros(6), method="reference")
    if int(s.status) != Status.SINGULAR:
        return []
    ways = free_motions(machine, s.free_twists)
    if not ways:
        return [
            "home: the pose leaves the configuration open (a folded or stretched leg); choose another home"
        ]
    return [
        f"the platform can {'; '.join(ways)} although all drives stand still: a constraint is missing, "
        "a pin too many, or a spring has a zero in its stiffness"
    ]


def _reach(machine: Machine) -> list[str]:
    """Home and box against what can be reached."""
    d = machine.description
    home = serial_home(machine.compiled)
    length = (home.arm if home else 0.0) or machine.compiled.length
    task = d.task or ("x", "y", "z")
    moved = [i for i, a in enumerate(NAMES) if a in task]
    steps = [s * TRIAL * length * np.eye(3)[i] for i in moved for s in (1, -1)]
    out = []
    lost = [k for k in steps if int(machine.solve(d.home.p + k, np.zeros(6)).status) == Status.UNREACHABLE]
    both = [NAMES[i] for i in moved if sum(bool(k[i]) for k in lost) == 2]
    singular = singular_words(machine.compiled, bool(lost))
    if singular:
        out.append(singular)
    elif both:
        out.append(
            f"the machine cannot move along {', '.join(both)}: {len(machine.actuators)} drives, {len(d.task) or 6} "
            "components commanded; name those that are, such as task: [x, y]"
        )
    elif lost:
        towards = f"{'-' if lost[0].sum() < 0 else '+'}{direction(abs(lost[0]))}"
        out.append(
            f"home lies on the limit of its own reach: {1e3 * TRIAL * length:.3g} mm towards {towards} is "
            "unreachable"
        )
    if d.workspace is None:
        return out
    low, high = machine.workspace
    outside = np.maximum(low - d.home.p, d.home.p - high).max()
    if outside > (size := float((high - low).max())):
        out.append(
            f"home lies {1e3 * outside:.4g} mm outside of the workspace, whose longest side is {1e3 * size:.4g} mm: are both in "
            f"{d.units.length}?"
        )
    grid = [np.linspace(low[i], high[i], 3) if i in moved else [d.home.p[i]] for i in range(3)]
    at = np.array(list(product(*grid)))
    status = machine.solve(at, np.zeros(6)).status
    missing = int((status == Status.UNREACHABLE).sum())
    if missing and not out:
        where = ", ".join(f"{1e3 * v:g}" for v in at[int(np.argmax(status == Status.UNREACHABLE))])
        out.append(
            f"{missing} of {len(at)} positions of the workspace cannot be reached, such as ({where}) mm"
        )
    return out


def _limits(machine: Machine) -> Iterator[str]:
    for name, e in all_elements(machine.description):
        if not isinstance(e, Joint) or len(e.home) != 1 or e.ends is None:
            continue
        share = (e.home[0] - e.ends[0]) / (e.ends[1] - e.ends[0])
        if not 0.01 <= share <= 0.99:
            yield f"{name}: home lies {'outside' if not 0 <= share <= 1 else 'at the end'} of its range"


def _trial(machine: Machine) -> list[str]:
    trial = tried(machine)
    description = machine.description
    elements = [e for _, e in all_elements(description)]
    elastic = any(
        isinstance(e, (Spring, Cable)) or (isinstance(e, Joint) and e.law is not None) for e in elements
    )
    if trial.stiffness is not None or elastic or description.external_springs:
        return trial.findings
    return [RIGID]


def _numbers(machine: Machine, path: str | PathLike[str]) -> Iterator[str]:
    heaviest = STEEL * machine.compiled.length**3
    masses = {name: e.mass for name, e in all_elements(machine.description) if isinstance(e, Body)}
    if any(machine.description.gravity or ()) and not any(masses.values()):
        yield "gravity pulls on nothing: no body has a mass"
    for name, mass in masses.items():
        if mass > heaviest:
            yield f"{name}: {mass:g} kg is more than solid steel of the machine's size ({heaviest:.3g} kg)"
    data = read(find(path)).data
    units = data.get("units", {}) if isinstance(data, dict) else {}
    system = UnitSystem(**units)
    for name, (dimension, words, least, most, steel) in SOLIDS.items():
        size, unit = system.to_si(1.0, dimension), words.format(system)
        for key, part in _walk(data, ""):
            value = _plain(part.get(name)) if isinstance(part, dict) else None
            if value is not None and not least <= size * value <= most:
                yield f"{key}.{name} = {value:g} {unit} is no solid (steel: {steel / size:.3g} {unit})"


def _beams(machine: Machine) -> Iterator[str]:
    """Beams that are much longer than the offset before them, or nothing of it; and those of constant length that slide along
    themselves, where no passive joint keeps them from bending. Of legs with one template the first is named."""
    d = machine.description.declared or machine.description
    passive = any(isinstance(e, Joint) and not e.actuated for _, e in all_elements(d))
    found: dict[str, str] = {}
    for place, elements in [found for chain in chains(d) for found in sequences(chain[1], chain[0])]:
        span, slide = 0.0, Joint("", "", ())
        for e in elements:
            if isinstance(e, Offset) and e.name not in ("frame", "attach"):
                span = float(np.linalg.norm(e.nominal.p))
            if isinstance(e, Joint) and e.kind == "prismatic":
                slide = e
            if not isinstance(e, Spring) or e.beam is None:
                continue
            length = dict(e.beam.numbers)["length"]
            shown = d.units.say(length, LENGTH)
            if span and not 0.01 * span < length < 1.5 * span:
                before = d.units.say(span, LENGTH)
                found.setdefault(
                    f"the beam of '{e.name}' is {shown} long, the offset before it spans {before}", place
                )
            if (
                not passive
                and slide.axes
                and not e.stroke
                and abs(np.dot(NAMED[e.beam.along], slide.axes[0])) > 0.99
            ):
                found.setdefault(
                    f"'{slide.name}' slides along the beam of '{e.name}', whose length stays {shown}: if it is a ram or column that "
                    f"gets longer, write stroke: {{joint: {slide.name}}}; if not, with rate: 0",
                    place,
                )
    yield from (f"{place}: {text}" for text, place in found.items())


def _plain(value: object) -> float | None:
    value = value.get("value") if isinstance(value, dict) else value
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def _walk(data: object, key: str) -> Iterator[tuple[str, object]]:
    """A file's data and everything in it, each with its key."""
    yield key, data
    inside = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for name, value in inside:
        yield from _walk(value, f"{key}.{name}".strip("."))
