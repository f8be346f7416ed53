"""From which side a pose was reached: a column of signs, words or axes, and runs in both directions side by side."""

from __future__ import annotations

import re

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.common.tables.header import split_unit
from stiffmap.experiment.channels import AXES
from stiffmap.experiment.files.fields import APPROACH, POSE
from stiffmap.experiment.spreadsheet.answers import Meant
from stiffmap.experiment.spreadsheet.guess import guessed
from stiffmap.experiment.spreadsheet.together import DIRECTION, way_of

UP = r"[+↑→]|\+?1(\.0*)?|forwards?|fwd|up|pos(itive)?|plus|vor(wärts)?|hin|auf(wärts)?"
DOWN = r"[-−–↓←]|[-−–]1(\.0*)?|reverse|rev|back(wards?)?|bwd|down|neg(ative)?|minus|rück(wärts)?|zurück|her|ab(wärts)?"
SIDE = re.compile(
    r"(?i)(direction of )?(approach|travel)([ _-]?(dir(ection)?|side))?|anfahrt|((an|ver)?fahr)richtung"
)
"""A column of them; ``direction`` is one where nothing is loaded."""


def side_of(text: str) -> float:
    """1 or -1 of the two directions of travel, 0 of what says none."""
    return float(bool(re.fullmatch(UP, text, re.I))) - float(bool(re.fullmatch(DOWN, text, re.I)))


def _run(header: str) -> tuple[str, float]:
    """A header without its direction of travel, and that: ``Run 1 +``, ``2 down [µm]``."""
    name = re.sub(r"(?<=\w)(?=[+−–-]$)", " ", split_unit(header)[0])
    words = re.split(r"[\s_,;/()]+", name)
    sides = [0.0 if re.search(r"\d", w) else side_of(w) for w in words]
    several = len({*sides} - {0.0}) > 1
    return " ".join(w for w, s in zip(words, sides, strict=True) if not s), 0.0 if several else sum({*sides})


def side_of_run(header: str) -> float:
    """1 or -1 of a header that names one direction of travel, else 0."""
    return _run(header)[1]


def approached(m: Meant) -> None:
    """Columns approach_x, approach_y, approach_z. Raises Question where nobody says along which axis, and StiffmapError."""
    columns = m.guessed
    known = {c.index: c.meaning for c in columns if c.meaning in APPROACH and not m.sheet.is_numeric(c.index)}
    loads = any(re.fullmatch("[fm][xyz]", c.meaning) for c in columns)
    named = (c for c in columns if c.meaning == "note")
    named = (c for c in named if SIDE.fullmatch(c.name) or (not loads and DIRECTION.fullmatch(c.name)))
    for i, meaning in (known or {c.index: "" for c in named}).items():
        cells, header = m.sheet.columns[i], m.sheet.header[i]
        ways = [way_of(c) or (meaning[-1:], side_of(c)) for c in cells]
        if any(not s and c not in ("", "0") for c, (_, s) in zip(cells, ways, strict=True)):
            continue
        if len({s for _, s in ways if s}) == 1 and "0" in cells:
            raise StiffmapError(
                f"{m.sheet.file}: column '{header}': expected directions of travel as 1 and -1, or + and -"
            )
        if not (known or {*POSE} & {c.meaning for c in columns}):
            m.said.append(
                f"'{header}' is not used: joints are commanded, and a direction of travel is along base axes"
            )
            return
        axis = _axis(m, header) if any(s and not a for a, s in ways) else ""
        for name in APPROACH:
            parts = [s * ((a or axis) == name[-1]) for a, s in ways]
            if any(parts):
                m.add(f"{header} along {name[-1]}", "", parts, name)
        m.said.append(f"'{header}' is the direction of the last travel{axis and f', along {axis}'}")
        return
    sided = {} if loads else {c.index: _run(m.sheet.header[c.index]) for c in columns if c.meaning == "note"}
    for meaning in {*AXES} - {c.meaning for c in columns}:
        own = [i for i, (name, side) in sided.items() if side and guessed(name) == meaning]
        if {sided[i][1] for i in own} == {1.0, -1.0}:
            m.chosen[meaning] = [m.sheet.header[i] for i in own]
    runs = next((v for k, v in m.chosen.items() if k in AXES and len(v) > 1 and all(map(side_of_run, v))), [])
    places = all(
        re.search(r"(?i)(?<![a-z])pos(?![a-z])", h) for h in runs
    )  # positions, unless others are neg
    if runs and not places and not {*APPROACH} & {*m.chosen}:
        name = f"approach_{_axis(m, runs[0])}"
        m.chosen[name] = [f"{name} of {h}" for h in runs]
        for made, header in zip(m.chosen[name], runs, strict=True):
            m.sheet = m.sheet.with_column(made, np.full(len(m.sheet), side_of_run(header)))
        m.said.append(f"'{runs[0]}' and the others are runs in both directions along {name[-1]}")


def _axis(m: Meant, header: str) -> str:
    """The only one along which commands move, else the only one that is read."""
    columns = m.guessed
    moves = {c.meaning for c in columns if c.meaning in POSE and np.ptp(m.sheet.numbers(c.index)) > 0.0}
    reads = {c.meaning[-1] for c in columns if c.meaning in AXES[:3]}
    axis = next((s for s in (moves, reads) if len(s) == 1), None)
    if axis is None:
        m.ask_column(f"along which axis is '{header}'? Say --map approach_x='{header}' (approach_y, approach_z)", "approach_x")  # fmt: skip
    return next(iter(axis))
