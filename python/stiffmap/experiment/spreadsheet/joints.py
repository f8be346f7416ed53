"""Tables whose rows are commanded joints: which column is which drive, and what an instrument read with them."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.tables.cells import Cells
from stiffmap.common.tables.header import with_unit
from stiffmap.common.tables.orientation import quaternion
from stiffmap.common.tables.table import Table
from stiffmap.common.units import Unit, unit_of
from stiffmap.experiment.channels import AXES
from stiffmap.experiment.files.fields import POSE, SEEN
from stiffmap.experiment.spreadsheet.answers import Meant
from stiffmap.experiment.spreadsheet.guess import READINGS, Column, guess
from stiffmap.solve.machine import Machine

BEFORE = r"(?:.*[/.\[]|rob_?\d+ |(?:(?:ist|soll|act(?:ual)?|cmd)[ _-]?)?(?:pos(?:ition)?|angle|winkel)[ _])?"
BEHIND = r"(?:[/._ ](?:position|pos|angle|winkel))?"
NUMBERED = rf"(?!.*(?:veloc|accel|effort|torque|current))(?:{BEFORE}{{}}(?:joint_a|joint|axis|achse|gelenk|theta|θ|关节|rax|q|j|a)|.*[/.]position)[ _.-]?\[?{{}}\]?{BEHIND}"
"""Also as logs have them: ``/joint_states/joint_1/position``, ``field.position0``, ``position[0]`` of a message."""
JOINT = re.compile(NUMBERED.format("", r"\d"), re.IGNORECASE)
OF_MESSAGE = re.compile(r"(?i)(.*[/.])position(\[?\d+\]?)")
"""A joint of a message that names its joints next to it: ``field.name0`` says whose ``field.position0`` is."""
BY_INSTRUMENT = r"(?:meas(?:ured|\.)?|gemessen|mesuré|misurat[oa]|medid[oa]|(?:laser[ _-]?)?tracker|smr|reflector|reflektor|cmm|实测|测量)"
MEASURED = rf"([xyz])[ _.-]?{BY_INSTRUMENT}|{BY_INSTRUMENT}(?:[ _.-]?(?:position|pos|point))?[ _.-]?([xyz])"
"""A header of a measured position, next to joints."""
MOST_TURNS = 4.0 * math.pi
"""Of a joint; larger numbers are degrees."""
MOST_DEGREES = 7200.0
"""Of a joint; larger numbers are counts of an encoder."""
DIFFERENCES = ("actual-minus-target", "target-minus-actual")
UNITS = ("mm", "um", "m", "in", "mil")
"""In which differences may be."""
SIDE_BY_SIDE = r"(?i)(.+?)[ _.-]?([xyz])|([xyz])[ _.-]?(\d+)"
"""A place's coordinate, next to those of other places."""
COUNTED = r"[ _.-]*(\d+|\b[a-zA-Z])$"
"""How names of targets differ."""
TOUCH, RIGID = 3e-3, 0.01
"""m, within which no two targets are; share of their distance by which it may differ from pose to pose."""
EXACT = 1e-9
"""m, by which numbers differ that are the same."""
NO_DIFFERENCE = "{}: --difference: no column is a difference; say --map dx='HEADER' where one is"


def drives_of(machine: Machine) -> dict[str, bool]:
    """Drives of a machine by full name, and whether each slides."""
    return {a: machine.compiled.names.is_prismatic(a) for a in machine.actuators}


def commands_in(machine: Machine, units: Mapping[str, str], sheet: Table) -> tuple[list[int], Floats | None]:
    """Columns of a table that command the joints of a machine, with `units` of those that have none, and the coordinates (n, actuators)
    m, rad; None where no column does. Raises StiffmapError."""
    m = Meant(units=dict(units), sheet=sheet)
    used = commanded(m, drives_of(machine))
    return used, m.coordinates() if used else None


def commanded(m: Meant, drives: Mapping[str, bool], alone: bool = False) -> list[int]:
    """Columns of a table of joints, which it returns, and their units; none where no column commands a drive and they are not what
    `alone` does.

    `drives`: full name -> whether it slides. Columns go by the drive's name, full or short, or by its number (`joint_1`, `q1`,
    `J1`, `A1`), or as they are chosen. Raises StiffmapError where some drives have a column and others none, and where a unit is
    missing.
    """
    short = {n.split(".")[-1] for n in drives}
    given = _given(m.chosen, drives, short)
    said = {} if len(given) == len(drives) else _said(m)
    numbers = _numbered(m, len(drives), len(given) == len(drives) or bool(said))
    own = {name: _own(name, number) for name, number in zip(drives, numbers, strict=True)}
    known = [[k for k, p in enumerate(own.values()) if _is_one(w, p)] for w in said.values()]
    in_order = all(not k or k[0] == i for i, k in enumerate(known))
    if in_order if any(known) and len(said) == len(drives) else not any(known) and len(said) != len(drives):
        said = {}  # in the order of the drives, or of another machine
    at = {n: m.index(given[n]) if n in given else _find(m, n, own[n], said) for n in drives}
    lost = [n for n, i in at.items() if i is None]
    if len(lost) == len(at) and not alone:
        return []
    if lost:
        n, words = lost[0], ", ".join(f"{w} in '{m.sheet.header[i]}'" for i, w in said.items())
        seen = f" (the table names {words})" if words else ""
        m.ask_column(f"which column commands {n}{seen}? Say --map {n}='HEADER', or --set {n}=NUMBER", n)
    m.chosen = {k: v for k, v in m.chosen.items() if k not in drives and k not in short}
    for k, (name, slides) in enumerate(drives.items(), 1):
        index = at[name]
        assert index is not None
        unit = _unit(m, index, name, slides)
        m.columns[f"q{k}"] = (name, unit.name)
        if unit.factor == 1.0:
            m.chosen[f"q{k}"] = [m.sheet.header[index]]
        else:  # a command is in a unit that experiment files have
            m.add(m.sheet.names[index], unit.name, unit.factor * m.sheet.numbers(index), f"q{k}")
    return [i for i in at.values() if i is not None]


def _given(chosen: Mapping[str, list[str]], drives: Mapping[str, bool], short: set[str]) -> dict[str, str]:
    wrong = [k for k in chosen if "." in k and k not in {*drives, *short}]
    if wrong:
        raise StiffmapError(f"--map: no drive '{wrong[0]}'; there are: {', '.join(drives)}")
    keys = ((name, key) for name in drives for key in (name, name.split(".")[-1]))
    return {name: chosen[key][0] for name, key in keys if key in chosen}


def _numbered(m: Meant, count: int, given: bool) -> list[str]:
    """Headers of joints by their numbers: from 1, or from 0 where those are as many as the joints; one more must be `given`."""
    turns = quaternion(m.sheet)
    for whose in ("", "target[ _.-]?", "actual[ _.-]?"):
        names = [NUMBERED.format(whose, k) for k in range(count + 1)]
        there = [m.sheet.find(n, turns) is not None or bool(_set(m, n)) for n in names]
        if all(there) and not given:
            raise StiffmapError(
                f"{m.sheet.file}: expected {count} joints, found those from 0 to {count}: say --map JOINT='HEADER' for each"
            )
        if any(there):
            return names[:-1] if there[0] and not there[-1] else names[1:]
    return names[1:]


def _own(name: str, number: str) -> list[str]:
    """Regular expressions of the headers of a drive: its names, also of a message, and its number."""
    own = [re.escape(n) for n in (name, name.split(".")[-1]) if n.lower() not in ("x", "y", "z")]
    return [*(rf"(?:.*[/.])?{n}(?:_joint)?{BEHIND}" for n in own), number]


def _said(m: Meant) -> dict[int, str]:
    """Columns of a message with the names of their joints; StiffmapError where a row has others than the first one."""
    said: dict[int, str] = {}
    for i, header in enumerate(m.sheet.header):
        part = OF_MESSAGE.fullmatch(header)
        k = m.sheet.find(re.escape(f"{part[1]}name{part[2]}")) if part else None
        if k is not None:
            cells = [*m.sheet.columns[k]]
            wanted = f"'{m.sheet.header[k]}': expected the joint {cells[0]} in all rows; found"
            m.sheet.check([c == cells[0] for c in cells], lambda row: f"{wanted} {cells[row]}")  # noqa: B023
            said[i] = cells[0]
    return said


def _is_one(text: str, patterns: Sequence[str]) -> bool:
    return any(re.fullmatch(p, text, re.IGNORECASE) for p in patterns)


def _find(m: Meant, name: str, own: Sequence[str], said: Mapping[int, str]) -> int | None:
    if said:
        return next((i for i, w in said.items() if _is_one(w, own)), None)
    turns = quaternion(m.sheet)
    index = next((i for p in own if (i := m.sheet.find(p, turns)) is not None), None)
    if index is not None and m.sheet.find(own[-1], (*turns, index)) is not None:
        m.ask_column(f"which of two columns commands {name}? Say --map {name}='HEADER'", name)
    if index is None and (same := _set(m, *own)):
        index = len(m.sheet.header)
        m.sheet = m.sheet.with_column(same[0], np.full(len(m.sheet), m.spend(same[0])))
    return index


def _set(m: Meant, *patterns: str) -> list[str]:
    """What --set says to be the same in every row and is all of one of these regular expressions."""
    return [k for p in patterns for k in m.constants if re.fullmatch(p, k, re.IGNORECASE)]


def _unit(m: Meant, index: int, name: str, slides: bool) -> Unit:
    quantity = "length" if slides else "angle"
    own = unit_of(m.sheet.unit(index), quantity)
    names = (name, name.split(".")[-1], m.sheet.names[index], *([] if own else ["joints"]))
    largest = float(np.nanmax(np.abs(m.sheet.numbers(index)), initial=0.0))
    if m.sheet.names[index] in m.spent and (slides or not largest):  # mm by --set; zero in any unit
        return Unit("mm" if slides else "deg")
    if not slides and largest > MOST_TURNS and not m.written_unit(index, *names, quantity=quantity):
        if largest > MOST_DEGREES:
            raise StiffmapError(
                f"{m.sheet.file}: '{m.sheet.header[index]}' goes to {largest:.4g}: expected an angle; of counts of an encoder, write "
                "angles (counts × 360 / counts per turn), or say --unit joints=deg where they are"
            )
        m.said.append(f"'{m.sheet.header[index]}' goes to {largest:.4g}: taken as degrees")
        return Unit("deg")
    return m.unit(index, *names, quantity=quantity)


def _side_by_side(columns: Sequence[Column]) -> dict[str, dict[str, int]]:
    """Places in one row, by their names and axes: X1 … Z2, or N1x … N2z where nothing else is a place."""
    groups: dict[str, dict[str, int]] = {}
    seen = any(k.meaning in SEEN for k in columns)
    for k in columns:
        part = re.fullmatch(SIDE_BY_SIDE, k.name) if k.meaning == "note" and not seen else None
        if k.meaning in SEEN and k.repeat:
            groups.setdefault(str(k.repeat), {})[k.meaning[-1]] = k.index
        elif part:
            groups.setdefault(part[1] or part[4], {})[(part[2] or part[3]).lower()] = k.index
    whole = {name: at for name, at in groups.items() if len(at) == len(POSE)}
    return whole if len(whole) > 1 else {}


def _below_each_other(m: Meant, groups: Mapping[str, Mapping[str, int]]) -> None:
    """Places side by side in rows below each other: of several targets, or repeats where they coincide. StiffmapError where their
    names or distances are not those of targets on one tool."""
    places = np.stack([m.metres([at[a] for a in POSE], SEEN) for at in groups.values()], axis=1)
    apart = np.linalg.norm(places[:, 1:] - places[:, :1], axis=2)
    usual = np.nanmedian(apart, axis=0)
    if (
        len({re.sub(COUNTED, "", name) for name in groups}) > 1
        or (np.nanmedian(np.abs(apart - usual), axis=0) > RIGID * usual + TOUCH).any()
    ):
        found = ", ".join(f"'{m.sheet.header[i]}'" for at in groups.values() for i in at.values())
        raise StiffmapError(
            f"{m.sheet.file}: expected one place in each row, or those of targets on one tool, numbered and always as far apart; "
            f"found {found}: say --map px='HEADER' --map py='HEADER' --map pz='HEADER'"
        )
    m.sheet = m.sheet.repeated(len(groups))
    for meaning, values in zip(SEEN, places.reshape(-1, len(SEEN)).T, strict=True):
        m.add(f"{meaning} of all", "mm", np.round(1e3 * values, 9), meaning)
    what = "repeats"
    if (usual > TOUCH).any():
        m.sheet = m.sheet.with_cells("target of all", [*groups] * (len(m.sheet) // len(groups)))
        m.chosen["target"], what = ["target of all"], "each a target with a place of its own on the tool"
    m.said.append(f"places side by side are taken below each other: {', '.join(groups)}, {what}")


def as_seen(m: Meant, difference: str, by_instrument: bool) -> None:
    """What was read as places in the instrument's own frame, where the table has them: frame, and place of the reflector on the
    tool, are then unknown.

    Places are columns `px py pz`, or, where nothing else is a reading, `X meas`; or targets and differences side by side; `x y z`
    alone with joints are asked for, unless an instrument is named that wrote them.
    """
    header = m.sheet.header
    columns = m.guessed
    places, groups = dict[str, Column](), _side_by_side(columns)
    if not any(k.meaning in READINGS and k.meaning not in AXES[3:] for k in columns):
        notes = [(k, re.fullmatch(MEASURED, k.name.lower())) for k in columns if k.meaning == "note"]
        places = {seen[1] or seen[2]: k for k, seen in notes if seen}
        if by_instrument and not places and not groups:
            places = {k.meaning: k for k in columns if k.meaning in POSE}
        for a, k in places.items():
            m.chosen[f"p{a}"] = [header[k.index]]
    if groups and not places:
        _below_each_other(m, groups)
    of = {k.meaning: k for k in m.guessed if k.repeat == 0}
    if difference != DIFFERENCES[0] and ({*SEEN, "ll"} & {*of}):
        raise StiffmapError(NO_DIFFERENCE.format(m.sheet.file))
    if any(s in of for s in SEEN):
        for s in SEEN:
            if s in of and m.written_unit(of[s].index, s) != "mm":
                _in_mm(m, s, [(1.0, of[s])])
    elif "ll" in of:  # a wire's end sits somewhere on the tool; x y z are the controller's
        m.head, m.placed = {"tool": "offset_unknown"}, True
        return
    elif not all(a in of for a in "xyz"):
        return
    elif not all(f"d{a}" in of for a in "xyz"):
        raise StiffmapError(
            f"{m.sheet.file}: {', '.join(repr(of[a].name) for a in 'xyz')} with commanded joints: if an instrument read them, say "
            f"--map px='{of['x'].name}' --map py='{of['y'].name}' --map pz='{of['z'].name}'"
        )
    else:
        sign = 1.0 if difference == DIFFERENCES[0] else -1.0
        for a in "xyz":
            _in_mm(m, f"p{a}", [(1.0, of[a]), (sign, of[f"d{a}"])])
            used = [header[of[a].index], header[of[f"d{a}"].index]]
            m.chosen["note"] = [*m.chosen.get("note", ()), *used]
        m.said.append(
            f"places are targets {'plus' if sign > 0 else 'less'} differences ({difference}); their frame, and the reflector's place, are unknown"
        )
    m.head, m.placed = {"frame": "unknown", "tool": "unknown"}, True


def compared(
    m: Meant, difference: str, measured: Mapping[str, str], deflection: bool, taken: Collection[str] = ()
) -> None:
    """Differences next to what was commanded and measured, of which `measured` has the header's patterns. StiffmapError where they
    have another sign or unit than what is said of them; rows that differ are named, of a `deflection` where others do not, and where
    what was measured less what was commanded was `taken` instead."""
    columns = guess(m.sheet.header, {}) if taken else m.guessed
    of = {c.meaning: c.index for c in columns if c.repeat == 0}
    sign = 1.0 if difference == DIFFERENCES[0] else -1.0
    turns, ways, shown = [], [], ""
    for reading, pattern in measured.items():
        at, command = of.get(reading), of.get(reading[-1])
        own = m.sheet.find(pattern, [i for i in (at, command) if i is not None])
        if at is None or command is None or own is None or reading in m.unloaded:
            continue
        if not all(map(m.sheet.is_numeric, (at, command, own))):
            continue
        place = m.unit(command, reading[-1])
        written, seen = (unit_of(m.sheet.unit(i), "length") or place for i in (at, own))
        size, actual = written.size if taken else m.unit(at, reading).size, seen.size
        read = m.sheet.numbers(at)
        apart = sign * (actual * m.sheet.numbers(own) - place.size * m.sheet.numbers(command))
        apart[~np.isfinite(read)] = np.nan
        step, rounded = _step(m.sheet.columns[at]), actual * _step(m.sheet.columns[own]) + EXACT
        units = {u.size: n for n in UNITS if (u := unit_of(n, "length"))} | {size: ""}
        ks = [size, *(k for k in units if k != size)]
        off = {k: np.abs(k * read - apart) > rounded + abs(k) * step for one in ks for k in (one, -one)}
        telling = {k: np.abs(apart) > 2.0 * (rounded + abs(k) * step) for k in off}
        fits = (k for k, t in telling.items() if t.sum() > 1 and 2 * (off[k] & t).sum() < t.sum())
        found = next(fits, None)
        turns.append(found is not None and found < 0.0)
        if not (rows := np.flatnonzero(off[size])).size:
            continue
        header, both = m.sheet.header[at], [f"'{m.sheet.header[k]}'" for k in (own, command)]
        less, i = " less ".join(both[:: int(sign)]), rows[0]
        differs = f"line {m.sheet.lines[i]}: '{header}' is {1e3 * size * read[i]:.4g} mm, {less} {1e3 * apart[i]:.4g} mm"
        differs += f", and {len(rows) - 1} further rows differ" if len(rows) > 1 else ""
        if reading in taken:
            m.said.append(f"{differs}; {' less '.join(both)} is taken")
        elif found == size or (found is None and not deflection):
            m.said.append(differs)
        elif found is not None:
            shown = shown or differs
            ways += [f"--unit {reading}={units[abs(found)]}"] if units[abs(found)] else []
            turn = header[1:] if header[0] == "-" else f"-{header}"
            ways += [f"--map {reading}='{turn}'"] if found < 0.0 else []
    if shown:
        if all(turns):
            ways = [*(w for w in ways if w.startswith("--unit")), f"--difference {DIFFERENCES[sign > 0]}"]
        raise StiffmapError(f"{m.sheet.file}: {shown}: say {' '.join(ways)}")


def _step(cells: Cells) -> float:
    """About half of the last digit of a column of numbers; 0 of numbers with powers of ten."""
    digits = [c.replace(",", ".").partition(".")[2].lower() for c in cells]
    return 0.0 if any("e" in d for d in digits) else 0.51 * 0.1 ** max(map(len, digits))


def turned(m: Meant, difference: str, besides: Collection[str] = ()) -> None:
    """Readings as actual minus target in columns of their own, `besides` those that are that already."""
    if difference == DIFFERENCES[0]:
        return
    chosen: dict[str, list[str]] = {}
    for c in m.guessed:
        if c.meaning in {*AXES, "dd"} - {*besides}:
            name = f"less {with_unit(c.name, c.unit)}"
            m.sheet = m.sheet.with_column(name, -m.sheet.numbers(c.index))
            chosen.setdefault(c.meaning, []).append(name)
    if not chosen and not besides:
        raise StiffmapError(NO_DIFFERENCE.format(m.sheet.file))
    m.chosen |= chosen


def _in_mm(m: Meant, meaning: str, parts: Sequence[tuple[float, Column]]) -> None:
    each = [sign * 1e3 * m.unit(c.index, c.meaning).size * m.sheet.numbers(c.index) for sign, c in parts]
    m.add(f"{meaning} of {' and '.join(c.name for _, c in parts)}", "mm", sum(each, 0.0), meaning)
