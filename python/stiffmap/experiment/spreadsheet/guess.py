"""Which column of a sheet is what, and in which unit."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from stiffmap.common.errors import StiffmapError
from stiffmap.common.tables.header import split_unit
from stiffmap.experiment.channels import AXES
from stiffmap.experiment.files.fields import SEEN

FORCE = "force|kraft|last|load|effort|charge|forza|carico|fuerza|carga"
MOMENT = "moment|torque|drehmoment|momento|couple"
DEFLECTION = (
    "defl|deflection|displ\\.?|displacement|déplacement|flèche|verschiebung|verlagerung|verformung|durchbiegung|"
    "spostamento|freccia|desplazamiento|deflexión|flecha"
)
PATTERNS: tuple[tuple[str, str], ...] = (
    ("id", r"#|id|nr\.?|no\.?|lfd\.? ?nr\.?|number|nummer|row|zeile|punkt|messpunkt|point|messpunkt nr\.?|point no\.?"),
    ("temperature", r"t|temp|temperature|temperatur"),
    ("order", r"order|reihenfolge|sequence"),
    ("setup", r"set-?up|aufbau|aufspannung"),
    ("branch", r"branch|richtung der last|loading"),
    *((f"f{a}", rf"f ?_?{a}|({FORCE})[ _.]?(in |en |f[ _]?)?{a}|{a} ?({FORCE})") for a in "xyz"),
    *((f"m{a}", rf"m ?_?{a}|({MOMENT})[ _.]?(in |en |m[ _]?)?{a}") for a in "xyz"),
    *((f"u_d{a}", rf"(u|±|sigma|std|uncertainty) ?_?d?{a}") for a in "xyz"),
    *((f"d{a}", rf"(d|delta|δ|{DEFLECTION}|abweichung|error|dev|(dial )?gau?ge|dial|indicator|(mess)?uhr|reading|auslenkung|weg|dehnung)[ _.]?(in |en |[dδ][ _]?)?{a}|{a} ?_?(dif|diff|difference|dev|deviation|err|error|abweichung)|{a} ?({DEFLECTION}|dial|gau?ge|uhr|reading)") for a in "xyz"),
    *((f"p{a}", rf"p_?{a}") for a in "xyz"),
    ("ll", r"l|ll|(measured |gemessene )?(length|länge|laenge)|(draw[ -]?)?wire( ?length)?|(cable|string|ball-?bar|bar) ?length|seil(zug)?(länge)?|distance|abstand"),
    *((f"r{a}", rf"r ?_?{a}|rotation ?_?{a}") for a in "xyz"),
    *((a, rf"{a}|pos\.?[ _-]?{a}|{a}[ _-]?pos\.?|position ?_?{a}|(nominal|pose|punkt|messpunkt|tcp|ort|lage|koordinate|coordinate) ?_?{a}|soll ?_?{a}|{a} ?soll|{a}[ _-]?(t|target|cmd|nominal|command|commanded)|target[ _-]?{a}") for a in "xyz"),
)  # fmt: skip
REPEATED = re.compile(r"^(.*?)[ _.-]*(?:#|run|messung|wdh|rep|repeat)?[ _.-]*(\d+)$", re.IGNORECASE)
READINGS = (*AXES, "dd", "ll", *SEEN)


@dataclass(frozen=True)
class Column:
    """A column of the sheet, as understood."""

    index: int
    name: str
    """As in the sheet, without its unit."""
    unit: str
    """As written in brackets; empty where none is."""
    meaning: str
    """Column of an experiment; ``note`` for what is kept in addition."""
    repeat: int = 0
    """From 1, of repeats side by side; 0: none."""


def guess(headers: Sequence[str], chosen: Mapping[str, Sequence[str]]) -> list[Column]:
    """Meaning of every column; ``chosen`` (meaning -> headers) goes before any guess.

    Several headers of one meaning are repeats side by side, in that order. Raises StiffmapError for a chosen
    header that is not there.
    """
    given = {
        find_column(h, headers): (meaning, i)
        for meaning, many in chosen.items()
        for i, h in enumerate(many, 1)
    }
    out = []
    for index, header in enumerate(headers):
        name, unit = split_unit(header)
        if index in given:
            meaning, repeat = given[index]
            out.append(Column(index, name, unit, meaning, repeat if len(chosen[meaning]) > 1 else 0))
        else:
            meaning, repeat = _meaning(name)
            out.append(Column(index, name, unit, "note" if meaning in chosen else meaning, repeat))
    if "ll" not in chosen and any(c.meaning in READINGS and c.meaning != "ll" for c in out):
        # a length of something else
        out = [replace(c, meaning="note") if c.meaning == "ll" else c for c in out]
    meant = {c.meaning for c in out}
    if meant & set(AXES) and not meant & set("xyz") and not set(chosen) & set(SEEN):
        # where deflections are read, what was touched is where the tool stood
        out = [replace(c, meaning=c.meaning[1]) if c.meaning in SEEN else c for c in out]
    first = {(c.meaning, c.repeat): c.index for c in reversed(out)}  # a second one is a note
    return [
        c if first[c.meaning, c.repeat] == c.index else Column(c.index, c.name, c.unit, "note") for c in out
    ]


def find_column(wanted: str, headers: Sequence[str]) -> int:
    """Index of a column by its header, with or without its unit, by how that begins, or by its number from 1; StiffmapError."""
    exact = [i for i, h in enumerate(headers) if wanted in (h, split_unit(h)[0])]
    loose = [i for i, h in enumerate(headers) if h.lower().startswith(wanted.lower())]
    found = exact or (loose if len(loose) == 1 else [])
    if not found and wanted.isdigit() and 1 <= int(wanted) <= len(headers):
        return int(wanted) - 1
    if not found:
        raise StiffmapError(f"--map: no column '{wanted}'; there are: {', '.join(headers)}")
    return found[0]


def has_meaning(name: str) -> bool:
    """Whether a name without its unit stands for a column of an experiment."""
    return guessed(name) != "note"


def guessed(name: str) -> str:
    """Column of an experiment that a name without its unit stands for; ``note`` for none."""
    return _meaning(name)[0]


def _meaning(name: str) -> tuple[str, int]:
    plain = re.sub(r"\s+", " ", name.strip().lower())
    for meaning, pattern in PATTERNS:
        if re.fullmatch(pattern, plain):
            return meaning, 0
    match = REPEATED.match(plain)
    if match and match[1]:
        for meaning, pattern in PATTERNS:
            if meaning in READINGS and meaning != "ll" and re.fullmatch(pattern, match[1].strip()):
                return meaning, int(match[2])
    return "note", 0
