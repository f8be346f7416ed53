"""Columns that mean something only together: a load and its direction, a gauge before and after, turns next to a position,
names of targets, and headers with a sign."""

from __future__ import annotations

import re

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.short import first_of
from stiffmap.common.tables.header import DEFLECTION, split_unit
from stiffmap.common.tables.table import Table, column_letter
from stiffmap.common.units import Unit, unit_of
from stiffmap.experiment.spreadsheet.answers import Meant
from stiffmap.experiment.spreadsheet.guess import READINGS, guessed
from stiffmap.experiment.spreadsheet.places import without_marks

LOAD = re.compile(
    r"(?i)(applied |test |hanging |hung )?(load|force|mass|weight|payload|last|prüflast|kraft|prüfkraft|masse|gewicht|belastung|"
    r"zuladung|anhängelast|charge|f|m|p)( hung| applied)?"
)
HUNG = re.compile(r"hung|hanging|\bmass|masse\b|weight\b|gewicht\b|anhängelast|angehängt", re.IGNORECASE)
WEIGHS = re.compile(r"load|last|mass|weight|gewicht|kraft|force|charge|^m$", re.IGNORECASE)
DIRECTION = re.compile(
    r"(?i)(load|force|last|kraft)?[ _-]?(direction|dir\.?|richtung|axis|achse)( of (the )?(load|force))?|"
    r"richtung der (last|kraft)"
)
WAY = re.compile(r"([+-]?)\s*([xyz])|([xyz])\s*([+-])", re.IGNORECASE)
ALONG = re.compile(
    rf"(?i)({DEFLECTION}|reading|dial|gauge|indicator|messuhr|uhr|ablesung|lvdt)( along the load)?"
)
"""A reading whose axis is that of the load."""
STATES = {
    "before": re.compile(r"\b((unloaded|after unloading)( again)?|no[ -]load|without load|before( loading)?|unbelastet|ohne last|vorher|leer|entlastet|initial|zero|pre|vor|avant|sans (charge|effort)|prima|antes)\b", re.I),
    "loaded": re.compile(r"\b(loaded|with load|under load|belastet|mit last|unter last|(en|sous) charge)\b", re.I),
    "after": re.compile(r"\b(after( loading)?|nachher|final|post|nach|apr[eè]s|dopo|despu[eé]s)\b", re.I),
}  # fmt: skip
"""A gauge that was read ``before``, ``loaded`` and ``after`` was read without the load after it, too."""
TARGET = re.compile(
    r"(?i)(target|reflector|reflektor|smr|srm|nest|tooling ball|ball|sphere|kugel|marker|marke|prism|prisma|zielmarke|ziel|zielpunkt)"
    r"[ _.-]?(id|name|no\.?|nr\.?|number|nummer)?"
)
POINT = re.compile(r"(?i)(mess)?(point|punkt|stelle|position|name|id)[ _.-]?(id|name|no\.?|nr\.?)?")
MOST_METRES = 20.0
"""Of a wire or bar; larger numbers are mm."""
NAMED = 5
"""Rows that a sentence names."""


def together(m: Meant, deflection: bool) -> None:
    """Signs of chosen columns, gauges before and after a load, loads with their direction. Raises StiffmapError."""
    m.chosen = {"ll" if k == "length" else k: list(v) for k, v in m.chosen.items()}
    _signs(m)
    without_marks(m)
    _lengths(m)
    if deflection:
        _differences(m)
    _directions(m, deflection)
    if not any(re.fullmatch("[fm][xyz]", c.meaning) for c in m.guessed):
        _hung(m)


def _signs(m: Meant) -> None:
    """``fz=-Last [kg]``: the column with the other sign; ``+``: as it is, whatever its unit would say."""
    for meaning, headers in m.chosen.items():
        for k, wanted in enumerate(headers):
            if wanted[:1] not in ("+", "-", "−") or wanted in m.sheet.header:
                continue
            index = m.index(wanted[1:].strip())
            name = f"{wanted[0].replace('−', '-')}{m.sheet.header[index]}"
            if name not in m.sheet.header:
                values = m.sheet.numbers(index)
                m.sheet = m.sheet.with_column(name, -values if name[0] == "-" else values)
            headers[k] = name
            m.said.append(f"{meaning} is {name[0]}'{m.sheet.header[index]}'")


def _lengths(m: Meant) -> None:
    """Lengths of a wire or bar: rows with a wrong sign are left out, and large numbers without a unit are mm."""
    for c in [c for c in m.guessed if c.meaning == "ll" and not c.repeat]:
        values = m.sheet.numbers(c.index)
        if (
            not c.unit
            and not {"ll", "length"} & set(m.units)
            and np.nanmax(np.abs(values), initial=0.0) > MOST_METRES
        ):
            m.units["ll"] = "mm"
            m.said.append(f"'{c.name}' goes to {np.nanmax(values):.4g}: taken as mm")
        wrong = np.flatnonzero(values <= 0.0)
        if wrong.size:
            lines = first_of([f"line {m.sheet.lines[int(i)]} ({values[i]:g})" for i in wrong], NAMED)
            m.said.append(f"'{c.name}': expected lengths above zero; left out: {lines}")
            unit = m.written_unit(c.index, "ll")
            m.add(f"{c.name} in use", unit, np.where(values > 0.0, values, np.nan), "ll")


def _stateless(header: str) -> tuple[str, str]:
    """What a header names without the word for its state, and that state."""
    name = split_unit(header)[0]
    for state, words in STATES.items():
        if words.search(name):
            return re.sub(r"[\s_()-]+", " ", words.sub(" ", name)).strip().lower(), state
    return name.lower(), ""


def _differences(m: Meant) -> None:
    """A gauge's reading with the load less that without it."""
    header, units = m.sheet.header, dict(m.units)
    states = [_stateless(h.replace("_", " ")) for h in header]
    first = {s: i for i, s in reversed([*enumerate(states)])}
    given = {m.index(h): k for k, v in m.chosen.items() for h in v}
    for name in dict.fromkeys(n for n, state in states if state == "before"):
        j = first[name, "before"]
        i = next((first[name, s] for s in ("loaded", "after", "") if (name, s) in first), None)
        if i is None:
            m.said.append(
                f"'{header[j]}' is in no reading; if it was read without the load, call the other one the same but 'loaded'"
            )
            continue
        meaning = given.get(i) or {"x": "dx", "y": "dy", "z": "dz"}.get(guessed(name), guessed(name))
        if meaning not in READINGS or not m.sheet.is_numeric(i):
            continue
        own = [m.sheet.unit(k) for k in (i, j)]
        unit = units.get(meaning) or own[0] or own[1]
        loaded, unloaded = (unit_of(u or unit) for u in own)
        scale = unloaded.size / loaded.size if unit and loaded and unloaded else 1.0
        values = m.sheet.numbers(i) - scale * m.sheet.numbers(j)
        others = [h for h in m.chosen.get(meaning, []) if m.index(h) != i]
        m.add(f"{m.sheet.names[i]} less {m.sheet.names[j]}", unit, values, meaning)
        m.chosen[meaning] = [*others, *m.chosen[meaning]]
        if not others:
            m.unloaded[meaning] = j
        idle = [f"'{header[k]}'" for k, (n, s) in enumerate(states) if n == name and s and k not in (i, j)]
        left = f"; not used, as read again: {', '.join(idle)}" if idle else ""
        m.said.append(f"{meaning} is '{header[i]}' less '{header[j]}'{left}")


def way_of(cell: str) -> tuple[str, float] | None:
    match = WAY.fullmatch(cell.strip().replace("−", "-"))
    if match is None:
        return None
    return (match[2] or match[3]).lower(), -1.0 if "-" in (match[1] or "", match[4] or "") else 1.0


def _directions(m: Meant, deflection: bool) -> None:
    """Components of a load whose size and direction stand in columns of their own, and of a deflection that was read along it."""
    names = m.sheet.names
    at = [i for i, n in enumerate(names) if DIRECTION.fullmatch(n) and any(map(way_of, m.sheet.columns[i]))]
    loads = [
        i
        for i, n in enumerate(names)
        if LOAD.fullmatch(n) and i not in at and unit_of(m.sheet.unit(i) or "N", "force")
    ]
    mapped = {m.index(v[0]): k for k, v in m.chosen.items() if re.fullmatch("f[xyz]", k)}
    loads = [i for i in loads if i in mapped] or loads or [i for i in mapped if i < len(names)]
    if len(at) != 1 or len(loads) != 1 or len(mapped) > 1:
        return
    way, load = at[0], loads[0]
    sizes = m.sheet.numbers(load)
    parts = np.zeros((len(sizes), 3))
    for row, (cell, size) in enumerate(zip(m.sheet.columns[way], sizes, strict=True)):
        found = way_of(cell)
        if found is not None:
            parts[row, "xyz".index(found[0])] = found[1] * size
        elif size and not np.isnan(size):
            m.sheet.fail(
                f"column '{m.sheet.header[way]}': expected the direction of the load, as +x, -Z or y; found {cell.strip()!r} "
                f"(cell {column_letter(way)}{m.sheet.lines[row]})",
                row,
            )
    common = m.units.get("force", "")
    unit = m.sheet.unit(load) or m.units.get(mapped.get(load, "force"), common)
    for axis, values in zip("xyz", parts.T, strict=True):
        m.chosen.pop(f"f{axis}", None)
        if values.any() or (axis == "z" and not parts.any()):
            m.add(f"+{names[load]} along {axis}", unit, values, f"f{axis}")
    m.said.append(f"the load is '{m.sheet.header[load]}' along '{m.sheet.header[way]}'")
    read = [i for i, n in enumerate(names) if ALONG.fullmatch(n) and m.sheet.is_numeric(i)]
    if deflection and len(read) == 1 and not {c.meaning for c in m.guessed} & {*READINGS}:
        _read_along(m, read[0], parts)


def _read_along(m: Meant, read: int, loads: Floats) -> None:
    """A deflection (column) that names no axis, where each load (n, 3) has one, was read along it: positive where the load pulls, if
    loads against the axes have no other sign than those along them, else along the axis."""
    values, header = m.sheet.numbers(read), m.sheet.header[read]
    axes = np.sign(loads).sum(axis=1)
    with_load = np.nansum(np.sign(values)[axes < 0]) > 0 or not (axes > 0).any()
    signs = np.sign(loads) if with_load else np.abs(np.sign(loads))
    for axis, sign in zip("xyz", signs.T, strict=True):
        if sign.any():
            found = np.where(sign != 0, sign * values, np.nan)
            m.add(f"{m.sheet.names[read]} along {axis}", m.written_unit(read, f"d{axis}"), found, f"d{axis}")
    way = "the load" if with_load else "its axis"
    m.said.append(
        f"'{header}' is read along {way}, and positive so; --map dx='HEADER' (dy, dz) where it is not"
    )


def _hung(m: Meant) -> None:
    """A mass that no column gives a direction hangs."""
    for i, name in enumerate(m.sheet.names):
        unit = m.sheet.unit(i)
        found = unit_of(unit, "force") if unit else None
        heavy = found and (found.mass or HUNG.search(name)) and WEIGHS.search(name)
        if heavy and m.sheet.is_numeric(i):
            m.chosen.setdefault("fz", [m.sheet.header[i]])
            return


def named_targets(m: Meant) -> None:
    """A column of names of reflectors; also one of points that are read at every pose of the joints."""
    if "target" in m.chosen:
        return
    taken = {m.index(h) for v in m.chosen.values() for h in v}
    commands = [m.sheet.header.index(h) for c in m.columns for h in m.chosen[c]]
    poses = list(zip(*(m.sheet.columns[i] for i in commands), strict=True))
    for i, name in enumerate(m.sheet.names):
        sure = TARGET.fullmatch(name) is not None
        if i in taken or not (sure or (poses and POINT.fullmatch(name))):
            continue
        cells = list(m.sheet.columns[i])
        words = {c for c in cells if c}
        many = 1 < len(words) < len(cells) and len(words) * 2 <= len(cells) + 1
        plain = not m.sheet.is_numeric(i) or all(re.fullmatch(r"\d+", w) for w in words)
        if not sure:  # names, each once at every pose
            each_pose = len(set(zip(poses, cells, strict=True))) == len(poses) > len(set(poses))
            sure = each_pose and all(re.search(r"[^\W\d]", w) for w in words)
        if many and plain and sure:
            header = m.sheet.header[i]
            m.chosen["target"] = [header]
            m.said.append(
                f"'{header}' names the target that was read: {', '.join(sorted(words)[:6])}; --map note='{header}' where it does not"
            )
            return


def weight(sheet: Table, index: int, explicit: bool, meaning: str, unit: Unit) -> tuple[float, str]:
    """Sign of a load along an axis, and what to say of it: a mass, and what is called a weight, pulls down."""
    values, header = sheet.numbers(index), sheet.header[index]
    hangs = unit.mass or HUNG.search(sheet.names[index])
    if not hangs or explicit or meaning[0] != "f" or np.nanmin(values, initial=0.0) < 0:
        return 1.0, ""
    sign = -1.0 if meaning == "fz" else 1.0
    way = f"{'-' if sign < 0 else '+'}{meaning[1]}"
    other = f'--map "{meaning}={"+" if sign < 0 else "-"}{header}"'
    what = "a mass: its weight pulls" if unit.mass else "a weight: it pulls"
    said = f"'{header}' is {what} along {way}{' (9.80665 N per kg)' if unit.mass else ''}; {other} says the other way"
    return sign, said
