"""The header of a table: one line, or several with groups, units in a line of their own, merged cells, a leading #; and what the name
of a column stands for, in the words of workshops in several languages."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import lru_cache
from itertools import pairwise, takewhile, zip_longest

from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.number_text import terms
from stiffmap.common.tables.lines import COMMENTS, NUMBER
from stiffmap.common.units import FREQUENCIES, SHORT_TIMES, TIMES, name_and_unit, unit_of

Line = tuple[int, list[str]]
MOST_LINES = 4
"""Lines above the data that may be of the header."""
KEPT = 10_000
"""Names of columns whose units and meanings are known at once when they are asked for again."""
DIRECTIONS = re.compile(r"\+|[-−–]|[↑↓←→]")
"""Of travel, in a line of their own above the names."""
BEHIND = [
    re.compile(pattern)
    for pattern in (
        r"(.*?\S)(?:\s+in)?[\s,;]+((?:1/|0[.,]0*1\s?)\d*\s?(?:mm|in)?|(?:mm|in)/1\d+)\s*",
        r"(.*?[^\s,;/])(?:\s+in)?[\s_](k?N)\s*",
        r"(.+?)(?:\s*[/,;]\s*|\s+in\s+)(\S+)\s*",
        r"(.*\S)[\s_](?!(?i:in)\s*$)(\S{2,})\s*",
    )
]
"""A name, and behind it a unit without brackets: parts of a millimetre, N and kN in capitals, behind a sign or a word, behind a blank."""


def header_of(
    above: Sequence[Line], first: Sequence[str], known: Callable[[str], bool], repeated: bool = False
) -> tuple[int, list[str]] | None:
    """Line number and names of the columns, from the lines above the first row of data; None where none is a header.

    `known`: whether a name without its unit and the group over it has a meaning of its own; `repeated`: whether names may come again.
    Below the names there may be lines of devices and rates, and above them one of units with a word for it.
    """
    width = sum(bool(c.strip()) for c in first)
    lines = [(n, [_plain(c) for c in cells]) for n, cells in above]
    lines = [(n, cells) for n, cells in lines if any(c.strip("-=_–—: ") for c in cells)]
    whole = {n for n, c in lines if _units(c) and sum(map(bool, c)) >= width}
    said = [k for k, (n, c) in enumerate(lines) if n in whole and UNIT_LABEL.fullmatch(c[0])]
    units = lines.pop(said[-1])[1] if said else []
    stated = {n for n, c in lines if any(m and m["text"] for m in map(STATED.fullmatch, c))} - whole
    lines = [(n, cells) for n, cells in lines if n not in stated][-MOST_LINES:]
    last = lines[-1:]
    if len(lines) > 2 and _units(lines[-2][1]) and _completes(lines[-3][1], lines[-1][1], width):
        lines[-2:] = lines[:-3:-1]  # runs are counted below the units
    while lines and not fits(lines[-1][1], width):
        if _units(lines[-1][1]) or (len(lines) > 1 and _completes(lines[-2][1], lines[-1][1], width)):
            break
        commented = {n for n, cells in above if cells[0].strip().startswith(COMMENTS)}
        if len(lines) == 1 and any(lines[-1][1]) and lines[-1][0] not in commented:
            break
        lines.pop()
    if lines and _units(lines[-1][1]) and len(lines) > 1:
        units = lines.pop()[1]
    if not lines or (lines[-1:] != last and any(map(NUMBER.fullmatch, lines[-1][1]))):
        return None  # numbers with remarks below them are no names
    number, names = lines[-1]
    names = [*names, *[""] * (len(units) - len(names))]
    if len(lines) > 1 and (marks := [c for c in lines[-2][1] if c]) and all(map(DIRECTIONS.fullmatch, marks)):
        each = zip_longest(names, lines.pop(-2)[1], fillvalue="")
        names = [" ".join(filter(None, pair)) for pair in each]
    if len(lines) > 1 and not repeated and _needs_group(names, lines[-2][1], first):
        names = _grouped(lines[-2][1], names, known)
    elif len(lines) > 1 and not _is_of_some(lines[-2][1], names):  # Position [mm] over x y z
        names = [_with_own_unit(n, _of_group(g)[1]) if n else n for n, g in _under(lines[-2][1], names)]
    for _, group in reversed([] if repeated else lines[:-2]):
        if len({*names}) < len(names) and _needs_group(names, group, first):
            names = _grouped(group, names, known)
    names = names if repeated else _held(names, first, known)
    if units:
        names = [_with_own_unit(n, units[i] if i < len(units) else "") for i, n in enumerate(names)]
    names = _off_path(_of_metres(names), known)
    for k in () if any(known(split_unit(n)[0]) for n in names) else range(len(above) - 1, 0, -1):
        over = [split_unit(_plain(c))[0] for c in above[k - 1][1] if c.strip()]
        if fits(over, width) and len({*over}) == len(over) and sum(map(known, over)) > 1:
            below = [line for line in above[k:] if _units([_plain(c) for c in line[1]])]
            return header_of([*above[:k], *below[:1]], first, known, repeated)
    return number, names


def _off_path(names: list[str], known: Callable[[str], bool]) -> list[str]:
    """``Untitled/X``, ``"DB1".X``: names without the one path before them, where more than a position has a meaning then."""
    pairs = [split_unit(n) for n in names]
    parts = [re.fullmatch(r"(.*[/.\\])(['\"]?)([^/.\\\s'\"]+)\2", name) for name, _ in pairs]
    bare = [with_unit(m[3], unit) if m else n for n, (_, unit), m in zip(names, pairs, parts, strict=True)]
    meant = sum(known(m[3]) for m in parts if m)
    return bare if meant > 3 and len({m[1] for m in parts if m}) == 1 and len({*bare}) == len(bare) else names


def _of_metres(names: Sequence[str]) -> list[str]:
    """``x_m`` is x in metres where another header ends in ``_N``, ``_um`` and the like; without one it may be x as measured."""
    said = any(split_unit(n)[1] and re.search(r"_[^\W_]+$", n) for n in names)
    return [re.sub(r"^(.+)_m$", r"\1 [m]", n) if said else n for n in names]


def refuse_twice(names: Sequence[str], file: str, line: int, way: str = "") -> None:
    """FileError where two columns have one name; `way`: what to do then."""
    twice = sorted(name for name, times in Counter(names).items() if times > 1)
    if twice:
        raise FileError(f"column '{twice[0]}' occurs twice{way}", file=file, line=line)


RECORD = {
    "operator": r"operator|bediener|prüfer|measured by|gemessen von|name",
    "instrument": r"instrument|messmittel|messgerät|messuhr|gauge",
    "certificate": r"certificate|zertifikat|kalibrierschein|calibration",
    "date": r"date|datum",
    "temperature": r"temperature|temperatur|temp\.?|raumtemperatur",
    "notes": r"notes?|bemerkung(en)?|remarks?",
}


def record_of(above: Sequence[Line]) -> tuple[tuple[str, str], ...]:
    """``Operator;Miller`` or ``Operator: Miller`` in the lines above a table."""
    out: dict[str, str] = {}
    for _, cells in above:
        filled = [_plain(c) for c in cells if c.strip()]
        pairs = [tuple(filled)] if len(filled) == 2 else [tuple(c.split(":", 1)) for c in filled if ":" in c]
        pairs += [(a, b) for a, b in pairwise(filled) if a.endswith(":")]
        for name, value in (p for p in pairs if len(p) == 2):
            for key, pattern in RECORD.items():
                if re.fullmatch(pattern, name.strip().rstrip(":"), re.IGNORECASE) and value.strip():
                    out.setdefault(key, value.strip())
    return tuple(out.items())


STATED = re.compile(
    r"(?i)\W*(?:(?P<length>length|linear|distance|coordinate|längen|maß)|(?P<angle>angular|angle|winkel)|(?P<force>force|load|kraft))?"
    r"[ -]?(?:units?|einheit(?:en)?|unités?|unidad(?:es)?|unità)\s*(?:[:=]\s*(?P<text>.*))?"
)


def stated_unit(above: Sequence[str], quantity: str) -> str:
    """``Units: mm, deg`` or ``Length unit;inches`` in the cells above a table: what it says of a quantity, of lengths also a unit
    that nobody knows; nothing where it says nothing."""
    above = [re.sub(r"[][]", "", cell).strip() for cell in above]
    for i, cell in enumerate(above):
        match = STATED.fullmatch(cell)
        of = match and next((q for q in ("length", "angle", "force") if match[q]), "")
        behind = [*takewhile(unit_of, above[i + 1 :])]
        said = [t for t in [match["text"], *behind] if t] or above[i + 1 : i + 2] if match else []
        text = ", ".join(said).strip() if of in ("", quantity) else ""
        words = [text, *re.split(r"[\s,;/&|]+", text)]
        if found := next((w for w in words if unit_of(w, quantity)), ""):
            return found
        if text and quantity == "length" and not any(map(unit_of, words)):
            return text
    return ""


UNIT_LABEL = re.compile(r"(?i)[\w -]*(unit|einheit|unité|unidad)[\w ]*")
"""Before the units of all columns, as in ``Y_Unit_Label``."""
NO_UNIT = ("", "-", "–", "—", "#", "1", "None")  # in the place of a unit


def _plain(cell: str) -> str:
    text = re.sub(r"\s+", " ", cell.strip())
    bare = text.lstrip("#%").strip() if text.startswith(("#", "%")) else text
    return bare or text


def fits(cells: Sequence[str], width: int) -> bool:
    """Whether a line names at least half of the columns that hold data."""
    return sum(map(bool, cells)) >= max(2, (width + 1) // 2)


def _bare(cell: str) -> str:
    text = (match["text"] if (match := STATED.fullmatch(cell)) else "") or cell.strip()
    text = re.sub(r"(?<=\S)\s+\([^()]*\)$", "", text)  # mm (Length)
    inside = re.fullmatch(r"\[(.*)\]|\(((?:[^()]|\([^()]*\))*)\)", text)
    return (inside[1] or inside[2] or "").strip() if inside else text


def is_unit(text: str) -> bool:
    """Whether it is a unit, also one of several, such as g/N, m/s^2/N or mm/min."""
    more = (*TIMES, *SHORT_TIMES, "Hz", "kHz", "rpm", "tooth", "rev")
    with suppress(StiffmapError):
        return unit_of(text) is not None or all(unit_of(n) is not None or n in more for n, _ in terms(text))
    return False


def _is_ratio(text: str) -> bool:
    return "/" in text and is_unit(text)


def _units(cells: Sequence[str]) -> bool:
    """Whether a line holds nothing but units."""
    filled = [b for c in cells if (b := _bare(c)) not in NO_UNIT and not UNIT_LABEL.fullmatch(c)]
    named = [c for c in filled if is_unit(c)]
    return bool(named) and len(named) >= 0.6 * len(filled)


def with_unit(name: str, unit: str) -> str:
    """``x [mm]``, or the bare name where there is no unit."""
    return f"{name} [{unit}]" if unit else name


def _with_own_unit(name: str, unit: str) -> str:
    bare = _bare(unit)
    none = bare in NO_UNIT or UNIT_LABEL.fullmatch(unit) or split_unit(name)[1]
    return name if none or not (name or is_unit(bare)) else with_unit(name, bare)


def with_labels(names: Sequence[str], lines: Sequence[Sequence[str]]) -> list[str]:
    """Names of columns below which a scope says more of each channel, a label before every line: their units; the first one counts
    the time in the unit of its label."""
    units = next((c for c in lines if UNIT_LABEL.fullmatch(c[0].strip()) and _units(c)), [])
    out = [_with_own_unit(n, u) for n, u in zip_longest(names, units, fillvalue="")]
    times = (split_unit(c[0])[1] for c in lines)
    clock = next((u for u in times if u in (*TIMES, *SHORT_TIMES)), "")
    return [with_unit("t", clock), *out[1:]] if clock else out


def _needs_group(names: Sequence[str], group: Sequence[str], first: Sequence[str]) -> bool:
    """Whether names say too little without the line above: the same twice, or nothing where there is data."""
    twice = [n for n, times in Counter(n.lower() for n in names if n).items() if times > 1]
    nameless = any(
        c.strip() and not (names[i] if i < len(names) else "") and i < len(group) and group[i]
        for i, c in enumerate(first)
    )
    return sum(map(bool, group)) >= 2 and bool(twice or nameless)


def _grouped(group: Sequence[str], names: Sequence[str], known: Callable[[str], bool]) -> list[str]:
    """``Force [N]`` over ``x`` is ``Force x [N]``; a group reaches to the next one, as merged cells do."""
    out = []
    once = Counter(split_unit(n)[0].lower() for n in names)
    for name, over in _under(group, names):
        title, unit = _of_group(over)
        plain, own = split_unit(name)
        text = " ".join(p for p in (title, plain) if p)
        if once[plain.lower()] == 1 and known(plain) and not known(text):
            text = plain  # Force over Fx
        out.append(with_unit(text, own or unit))
    return out


def _completes(over: Sequence[str], names: Sequence[str], width: int) -> bool:
    """Whether names, or numbers of runs, stand where the header over them has blank cells."""
    pairs = [*zip_longest(over, names, fillvalue="")]
    blank = any(name and not above for above, name in pairs)
    return (
        blank and sum(map(bool, names)) > 1 and fits(over, width) and fits([a or b for a, b in pairs], width)
    )


def _held(names: Sequence[str], first: Sequence[str], known: Callable[[str], bool]) -> list[str]:
    """``dx [um]`` over three columns of numbers, the next two of them without a name, is ``dx 1``, ``dx 2``, ``dx 3``."""
    out, begin = [*names], 0
    for i, name in enumerate(names):
        plain, unit = split_unit(names[begin])
        if name or not (i < len(first) and NUMBER.fullmatch(first[i]) and known(f"{plain} 2")):
            begin = i
        else:
            out[begin : i + 1] = [with_unit(f"{plain} {k}", unit) for k in range(1, i - begin + 2)]
    return out


def _of_group(over: str) -> tuple[str, str]:
    """Name and unit of what stands over columns; a size, ``Tool length: 120 mm``, and ``mm, N`` are no unit of all of them."""
    title, unit = split_unit(over)
    size = unit and re.search(rf"\d\s*{re.escape(unit)}\s*$", over)
    return (over, "") if size or split_unit(title)[1] else (title, unit)


def _under(group: Sequence[str], names: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Each name with the group over it, which reaches to the next one or to a column without a name; over names that begin anew, as
    x y z x y z do, it may stand in the middle of them."""
    sets: list[dict[str, int]] = [{}]
    for i, name in enumerate(names):
        if name in sets[-1]:
            sets.append({})
        if name:
            sets[-1][name] = i
    over = [[g for g in (group[i] for i in s.values() if i < len(group)) if g] for s in sets]
    begins = (min(s.values(), default=0) for s in sets[1:])
    if all(len(g) == 1 for g in over) and not all(i < len(group) and group[i] for i in begins):
        titles = {i: g for s, (g,) in zip(sets, over, strict=True) for i in s.values()}
        group = [titles.get(i, g) for i, g in enumerate([*group, *[""] * (len(names) - len(group))])]
    current = ""
    for above, name in zip_longest(group, names, fillvalue=""):
        current = above or (current if name else "")
        yield name, current


def _is_of_some(title: Sequence[str], names: Sequence[str]) -> bool:
    """Whether a title names one quantity above columns of several, none of which it says more of than of the others."""
    (first, *more) = [c for c in title if c] or [""]
    columns = {re.sub("[xyzXYZ]$", "", split_unit(n)[0]) for n in names if n}
    return not more and len(columns) > 1 and OF_SOME.search(first) is not None


@lru_cache(KEPT)
def split_unit(header: str) -> tuple[str, str]:
    """``Uhr 1 [µm]`` is ``Uhr 1`` in ``µm``; also round brackets, and ``x / mm``, ``x, mm``, ``x in mm``, ``x_mm``,
    ``x 1/100 mm``."""
    name, unit = name_and_unit(header)
    if name != header.strip():
        return name, unit
    found = (pattern.fullmatch(header) for pattern in BEHIND)
    units = (m for m in found if m and (unit_of(m[2]) or m[2].lower() in FREQUENCIES or _is_ratio(m[2])))
    match = None if unit_of(header) else next(units, None)
    return (match[1].strip(), match[2].strip()) if match else (header.strip(), "")


FORCE = "force|kraft|last|load|effort|charge|forza|carico|fuerza|carga|力|载荷|负载|受力"
MOMENT = "moment|torque|drehmoment|momento|couple|力矩|扭矩"
DEFLECTION = (
    "defl|deflection|(directional )?deformation|displ?\\.?|displacement|d[ée]placement|fl[èe]che|verschiebung|verlagerung|verformung|durchbiegung|"
    "spostamento|freccia|desplazamiento|deflexión|flecha|位移|变形|挠度"
)
OF_SOME = re.compile(f"(?i){DEFLECTION}|{FORCE}|{MOMENT}")
"""In a title whose unit is not that of all columns."""
IN_SI = re.compile(
    r"(?i)(actual|target)_(q|tcp_pose|tcp_force)_\d|.*[./](position|point|translation|force|torque)[./][xyz]|.*[./]position\[?\d+\]?|"
    r".*/joint_states/.*/position"
)
"""Fields of logs that are in SI by their format: messages of ROS, and UR's RTDE."""
COMMANDED = "target|cmd|nom|nominal|command|commanded|ref|desired|begin|r?soll?(?:wert)?|理论|名义|指令|目标"
MEASURED = (
    "act|actual|meas|measured|achieved|attained|end|r?ist(?:wert)?|gemessen|mess?|mesur[ée]e?|实测|实际|测量"
)
FILLED = re.compile("方向|向|坐标|位置|轴|值")
"""What Chinese headers have next to the name of an axis."""
PATTERNS: tuple[tuple[str, str], ...] = (
    ("id", r"#|id|nr\.?|no\.?|lfd\.? ?nr\.?|number|nummer|row|zeile|punkt|messpunkt|point|(mess)?punkt[ -]?nr\.?|point no\.?|punto|序号|编号|点号"),
    ("temperature", r"t|temp|temperature|temperatur|温度"),
    ("order", r"order|reihenfolge|sequence"),
    ("setup", r"set-?up|aufbau|aufspannung"),
    ("branch", r"branch|richtung der last|loading"),
    *((f"f{a}", rf"f ?_?{a}|({FORCE})[ _.]?(in |en |f[ _]?)?{a}|{a} ?({FORCE})") for a in "xyz"),
    *((f"m{a}", rf"m ?_?{a}|({MOMENT})[ _.]?(in |en |m[ _]?)?{a}") for a in "xyz"),
    *((f"u_d{a}", rf"(u|±|sigma|std|uncertainty) ?_?d?{a}") for a in "xyz"),
    *((f"d{a}", rf"(d|delta|δ|{DEFLECTION}|abweichung|error|dev|deviation|[ée]cart|(dial )?gau?ge|dial|indicator|(mess)?uhr|dti|clock|comparateur|comparatore|comparador|reading|auslenkung|weg|dehnung|误差|偏差)[ _.]?(in |en |[dδ][ _]?)?{a}|{a} ?_?(dif|diff|difference|dev|deviation|err|error|abweichung)|{a}[ _-]?({DEFLECTION}|dial|gau?ge|uhr|reading)") for a in "xyz"),
    *((f"p{a}", rf"p_?{a}") for a in "xyz"),
    *((f"approach_{a}", rf"(approach|travel|anfahrt|anfahrrichtung|fahrrichtung)[ _.-]?(in |dir(ection)?[ _.-]?)?{a}") for a in "xyz"),
    ("ll", r"l|ll|(measured |gemessene )?(length|länge|laenge)|(draw[ -]?)?wire( ?length)?|(cable|string|ball-?bar|bar) ?length|seil(zug)?(länge)?|distance|abstand"),
    *((f"r{a}", rf"r ?_?{a}|rotation ?_?{a}") for a in "xyz"),
    *((a, rf"{a}|(.*[./])?(position|point|translation)[./]{a}|target_tcp_pose_{i}|(pos\.?|location|coord(inate)?)[ _-]?{a}|{a}[ _-]?(pos\.?|location|coord(inate)?)|position ?_?{a}|(pose|punkt|messpunkt|tcp|ort|lage|koordinate|coordinate) ?_?{a}|{a}[ _-]?(t|{COMMANDED})|({COMMANDED})[ _-]?{a}") for i, a in enumerate("xyz")),
)  # fmt: skip


@lru_cache(KEPT)
def meaning_of(name: str) -> str:
    """``x``, ``fz``, ``dx``, ``temperature``, ``id`` and the like, of a name without its unit; empty for what is none of them."""
    plain = FILLED.sub("", re.sub(r"\s+", " ", name.strip().lower()))
    return next((m for m, pattern in PATTERNS if re.fullmatch(pattern, plain)), "")
