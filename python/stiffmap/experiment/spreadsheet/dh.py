"""A serial arm from its table of Denavit and Hartenberg: one row a joint, theta, d, a, alpha.

Standard: the frame behind joint i is Rz(theta) Tz(d) Tx(a) Rx(alpha) of the one before (Denavit and Hartenberg 1955).
Modified: Rx(alpha) Tx(a) Rz(theta) Tz(d), alpha and a being those of the link before (Craig 1986). theta is what is added
to the joint's coordinate, or d for a joint that slides.
"""

from __future__ import annotations

import html
import math
import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.tables.cells import Cells
from stiffmap.common.tables.header import split_unit, with_unit
from stiffmap.common.tables.lines import DASHES, IN_PI, is_nothing, radians, sum_in
from stiffmap.common.tables.sheet import Layout
from stiffmap.common.tables.table import Table
from stiffmap.common.units import unit_of
from stiffmap.experiment.spreadsheet.answers import Meant
from stiffmap.experiment.spreadsheet.joints import MOST_TURNS
from stiffmap.model.description import Drive, Element, Joint, Leg, MachineDescription, Offset, Pose

CONVENTIONS = ("standard", "modified")
ASSUMED = "the table does not say which convention it has, and standard was taken; --dh-convention modified takes the other"
LONG = r"((link|joint) )?((length|twist|offset|angle),? )?"
"""Before a symbol, as in ``Link length a``."""
NUMBERS = {
    "theta": rf"{LONG}(theta|θ)|offset|theta[ _-]?(offset|0|\(offset\))|q[ _-]?offset",
    "d": f"{LONG}d",
    "a": f"{LONG}a",
    "alpha": f"{LONG}(alpha|α)",
}
INDEX = re.compile(
    r"^((?:theta|θ|q)[ _-]?offset|theta|θ|alpha|α|sigma|σ|[adr])[ _-]*[({\[]?[ijkn]( ?[-−–_] ?1)?[)}\]]?(?![^\W_])",
    re.IGNORECASE,
)
"""``theta_i``, ``d(i)``, ``aᵢ₋₁``: the symbol, and whether it is of the link before."""
VARIABLE = r"(?i)(?:\+ *)?\\?(?:{}|q)[ _]?\{{?(?:\d+|i)\}}?\*?(?= *(?:[+−–-]|$))|\*$"
"""The joint's coordinate in a cell, as in ``q2``, ``θ2 - 90``, ``90 + \\theta_2``, ``0*``; what is left is added to it."""
RANGE = re.compile(r"(?i)±|(?:[\d.)π°]|pi) *(?:[-−–<~→…]|\\?to|bis|\.{2,}) *[-−–+]?\.?(?:[\d(π]|pi)")
"""``0 \\to 1``, ``-170...170``, ``0 - 1``."""
WORDS = {
    "name": r"name|joint|axis|achse|gelenk|id|link",
    "type": r"type|kind|art|sigma|σ",
    "low": r"((q|theta|θ)[ _]?)?(low|min|lower)([ _]limit)?",
    "high": r"((q|theta|θ)[ _]?)?(high|max|upper)([ _]limit)?",
}
FIXED = re.compile(r"(?i)tool|tcp|(tool )?flange|flansch|werkzeug|eef?|end[ _-]?effector|gripper|greifer")
"""Names of a row that is no joint; a last one is the fixed frame of the tool where the joints have coordinates."""
MODIFIED = re.compile(
    r"(?i)modified[ -]?(dh|denavit)|(dh|denavit|convention)\W+modified\b|\b(mdh|craig|khalil)\b"
)
"""In a line above the table."""
MORE = r"beta|β|sign|direction|dir|sense|drehsinn"
NOTHING_MORE = {"", "0", "0.0", "1", "1.0", "+1", "+"}
"""Cells of such a column that change nothing."""
TURNS = r"(r|dreh|turn|hinge|cont|0).*|d|c|"
SLIDES = r"p(ris.*)?|t(rans.*)?|s(lid.*|chub.*)?|l(in.*)?|1(\.0*)?"
IN_PI_RAD = re.compile(r"(?i)[*×x·]? *(pi|π) *\*? *(rad)?")
"""A unit of angles that are shares of π."""
LAYOUT = Layout(names="joint, theta [deg], d [mm], a [mm], alpha [deg]", options=False)
QUANTITIES = {"theta": "angle", "d": "length", "a": "length", "alpha": "angle"}
LEG = "arm"
STEP, TRIES = math.radians(30.0), 200
"""Of the coordinates among which a home is looked for, and how many are tried."""
SHORTEST, LONGEST = 0.005, 100.0
"""m: what an arm reaches whose lengths are in the unit that is said."""
LEVERS = 1.5
"""Longest lever arms, among some positions, that the lengths of an arm add up to at most."""
ROOM = 0.2
"""Half of the workspace, of the arm's reach."""


@dataclass(frozen=True)
class DHRow:
    """One joint, SI."""

    name: str
    theta: float
    d: float
    a: float
    alpha: float
    slides: bool
    range: tuple[float, float] | None = None
    behind: Floats = field(default_factory=lambda: np.eye(4), compare=False)
    """(4, 4) frame of the tool behind the last joint's own."""
    beta: float | None = None
    """Hayati's fourth parameter, given where the next axis is parallel: Rz(theta) Tx(a) Rx(alpha) Ry(beta), and d is 0."""


def read_dh(given: Table, units: Mapping[str, str], convention: str) -> list[DHRow]:
    """Rows of a table; `units` (theta, d, a, alpha -> unit) for columns without brackets.

    Raises StiffmapError that names the column which is missing or has no unit, or the columns of another convention.
    """
    header = _symbols(given)
    cells = tuple(Cells.of(map(_plain, c)) for c in given.columns)
    sheet = replace(given, header=tuple(INDEX.sub(r"\1", h) for h in header), columns=cells)
    columns = {n: sheet.find(pattern) for n, pattern in (NUMBERS | WORDS).items()}
    at = {n: i for n, i in columns.items() if i is not None}
    before = [i for i, h in enumerate(header) if h[:1] in "aAαΑ" and (found := INDEX.match(h)) and found[2]]
    if "a" not in at and (r := sheet.find("r")) is not None and len({*NUMBERS} & {*at}) == 3:
        before += _with_r(at, r, sheet)
    marks = [given.header[i] for i in before] or [w for w in given.above if MODIFIED.search(w)]
    if marks and convention != "modified":
        raise StiffmapError(
            f"{sheet.file}: {', '.join(map(repr, marks))}: of the link before its joint, which is the "
            "modified convention; say --dh-convention modified"
        )
    lost = [n for n in NUMBERS if n not in at]
    if lost:
        raise StiffmapError(
            f"{sheet.file}: no column is {', '.join(lost)}: a table of Denavit and Hartenberg has theta, d, a and alpha, one "
            f"row a joint; found {', '.join(given.header)}"
        )
    for name in NUMBERS:
        other = sheet.find(NUMBERS[name], at.values())
        if other is not None and name == "theta" and _turning(sheet, at):
            at[name] = other
        elif other is not None:
            both = f"'{given.header[at[name]]}' and '{given.header[other]}'"
            sheet.fail(
                f"{both} are both {name}; leave one, theta being what is added to the joint's coordinate"
            )
    more = sheet.find(MORE)
    if more is not None and not {*sheet.columns[more]} <= NOTHING_MORE:
        sheet.fail(f"'{given.header[more]}' says more than theta, d, a and alpha, which are all that is read")
    sheet, types = _constants(sheet, at, units)
    m = Meant(units=dict(units), sheet=sheet)
    angles = () if {"low", "high"} & {*at} else ("theta", "alpha")
    plain = [n for n in angles if not np.nan_to_num(sheet.numbers(at[n])).any()]  # zero in any unit
    units_of = {n: 1.0 if n in plain else m.unit(at[n], n, quantity=q).size for n, q in QUANTITIES.items()}
    numbers = {n: np.nan_to_num(_in_si(sheet, at[n], units_of[n], q)) for n, q in QUANTITIES.items()}
    joints = count = len(sheet.lines)
    said = [*sheet.columns[at["name"]]] if "name" in at else [""] * count
    if "type" not in at:
        each = zip(types, said, strict=True)
        whole = [w != "" or not (any(types) or FIXED.fullmatch(n.strip())) for w, n in each]
        while any(types) and not whole[joints - 1] and FIXED.fullmatch(said[joints - 1].strip()):
            joints -= 1
            whole[joints] = True
        why = (
            "no joint's coordinate, which others have: leave a fixed frame out"
            if any(types)
            else "a name that no joint has: write the joints' theta as q1, q2 - 90"
        )
        sheet.check(whole, lambda _: f"{why}, or say R or P in a column 'type'")
    slides = [re.fullmatch(SLIDES, w) is not None for w in types]
    for i, w in enumerate(types):
        if not slides[i] and not re.fullmatch(TURNS, w):
            sheet.fail(f"joint: expected R or P, one that turns or slides; found '{w}'", i)
    names = [_named(w, i) for i, w in enumerate(said)]
    if len(set(names)) < count:
        raise StiffmapError(f"{sheet.file}: joints of the same name: {', '.join(names)}")
    out = []
    for i in range(count):
        like = "d" if slides[i] else "theta"
        low, high = (_limit(m, at.get(n), i, units_of[like], QUANTITIES[like]) for n in ("low", "high"))
        known = math.isfinite(low) and math.isfinite(high)
        theta, d, a, alpha = (float(numbers[n][i]) for n in NUMBERS)
        out.append(DHRow(names[i], theta, d, a, alpha, slides[i], (low, high) if known else None))
    tool = forward(out[joints:], convention == "standard", np.zeros(count - joints))
    return [*out[: joints - 1], replace(out[joints - 1], behind=tool)]


def _turning(sheet: Table, at: Mapping[str, int]) -> bool:
    """Whether theta is nothing but the coordinates of joints that all turn, which another column is added to."""
    left = (re.sub(VARIABLE.format("theta|θ|th"), "", c) for c in sheet.columns[at["theta"]])
    plain = not any(c.strip("0., ") for c in left)
    return plain and (
        "type" not in at or all(re.fullmatch(TURNS, c.lower()) for c in sheet.columns[at["type"]])
    )


def _symbols(given: Table) -> list[str]:
    """Names of the columns without marks."""
    return [_plain(h).replace("\\", "") for h in given.header]


def left_out(given: Table) -> tuple[str, ...]:
    """Columns that `read_dh` makes nothing of, and lines that are no rows of the table."""
    known = "|".join(f"({p})" for p in (*NUMBERS.values(), *WORDS.values(), MORE, "r", "i|#|no|nr"))
    plain = (split_unit(INDEX.sub(r"\1", h))[0] for h in _symbols(given))
    each = zip(given.header, plain, given.columns, strict=True)
    unread = (h for h, n, cells in each if any(cells) and not re.fullmatch(known, n, re.IGNORECASE))
    return (*(f"column '{h}'" for h in unread), *given.left_out)


def _constants(sheet: Table, at: Mapping[str, int], units: Mapping[str, str]) -> tuple[Table, list[str]]:
    """The table of numbers without the joints' coordinates, and the types: a joint whose type nobody says slides where its d is one."""
    columns, header = list(sheet.columns), list(sheet.header)
    types = [w.lower() for w in columns[at["type"]]] if "type" in at else [""] * len(sheet.lines)
    for name, symbol, sliding in (("theta", "theta|θ|th", False), ("d", "d", True)):
        cells = [*columns[at[name]]]
        for i, cell in enumerate(cells):
            left = re.sub(VARIABLE.format(symbol), "", cell, count=1).strip()
            of_it = not types[i] or sliding == (re.fullmatch(SLIDES, types[i]) is not None)
            if of_it and left != cell and not left.endswith((*"+−–-",)):  # 90 - q2 turns the other way
                cells[i] = re.sub(r"^([+−–-]) +", r"\1", left) or "0"
                types[i] = types[i] or ("p" if sliding else "r")
        columns[at[name]] = Cells.of(cells)
    first = [re.search(r"\d{1,9}", w) for w in sheet.columns[at["name"]]] if "name" in at else []
    falls = np.diff([int(f[0]) if f else math.nan for f in first], prepend=math.nan) < 0
    sheet.check(~falls, lambda i: "expected joints in their order from the base to the tool")
    point = (lambda v: repr(v).replace(".", ",")) if sheet.decimal_comma else repr
    for name, quantity in QUANTITIES.items():
        cells = [*columns[at[name]]]
        found = f"'{header[at[name]]}': expected one number; found"
        limits = "a range or a difference; limits of a joint stand in columns low and high"
        read = [not is_nothing(c) or DASHES.fullmatch(c) or not c for c in cells]
        sheet.check(read, lambda i: f"{found} '{cells[i]}'")  # noqa: B023
        sheet.check([not RANGE.search(c) for c in cells], lambda i: f"{found} '{cells[i]}', {limits}")  # noqa: B023
        plain, own = split_unit(header[at[name]])
        said = units.get(name) or own or units.get(quantity, "rad")
        if quantity == "angle" and IN_PI_RAD.fullmatch(said.strip()):
            said = "rad"
            cells = [c if not c or IN_PI.search(c) else f"{c}*π" for c in cells]
        sums = (None if IN_PI.search(c) else sum_in(c, sheet.decimal_comma) for c in cells)
        cells = [c if v is None else point(v) for v, c in zip(sums, cells, strict=True)]
        angles = [radians(c, sheet.decimal_comma) for c in cells]
        if quantity == "angle" and (unit := unit_of(said, "angle")) and angles.count(None) < len(angles):
            cells = [c if a is None else point(a / unit.size) for a, c in zip(angles, cells, strict=True)]
            header[at[name]] = with_unit(plain, said)
        columns[at[name]] = Cells.of(cells)
    return replace(sheet, header=tuple(header), columns=tuple(columns)), types


def _plain(cell: str) -> str:
    """Without the marks of Markdown, HTML and LaTeX: ``&theta;<sub>1</sub>`` and ``$\\theta_1$`` are the angle of a joint."""
    bare = re.sub(r"(?<!\w)\*\*([^*]+)\*\*(?!\w)", r"\1", html.unescape(cell))
    text = unicodedata.normalize("NFKC", re.sub(r"</?su[bp]>|[$`]", "", bare))
    text = re.sub(r"\\d?frac *\{([^{}]*)\} *\{([^{}]*)\}", r"(\1)/(\2)", text)
    text = re.sub(r"\\(?:cdot|times)\b", "*", text)
    return re.sub(r"\\pi\b", "π", re.sub(r"\^ *\{? *\\circ *\}?", "°", text)).strip()


def _limit(m: Meant, column: int | None, row: int, size: float, quantity: str) -> float:
    """Of a joint, in the unit of its column, else in that of the joint's coordinate; NaN where there is none."""
    if column is None:
        return math.nan
    own = m.unit(column, "limit", quantity=quantity).size if m.sheet.unit(column) else size
    return float(_in_si(m.sheet, column, own, quantity)[row])


def _in_si(sheet: Table, column: int, size: float, quantity: str) -> Floats:
    values = size * sheet.numbers(column)
    turns = ~(np.abs(values) > MOST_TURNS) | (size != 1.0) | (quantity != "angle")
    sheet.check(
        turns, lambda i: f"'{sheet.header[column]}': expected radians; found {values[i]:g}, as degrees are"
    )
    return values


def _with_r(at: dict[str, int], r: int, sheet: Table) -> list[int]:
    """Which of d and r is the length a: each convention writes theta next to the shift along its axis. The columns of Khalil's
    d and alpha, which are of the link before; none where r is a, as in d, theta, r, alpha."""
    order = sorted((at["theta"], at["d"], at["alpha"], r))
    half = {i: k // 2 for k, i in enumerate(order)}
    if half[at["theta"]] == half[at["d"]]:
        at["a"] = r
        return []
    if half[at["theta"]] != half[r]:
        raise StiffmapError(
            f"{sheet.file}: columns 'd' and 'r': one is the length along x, the other the shift along z; write a and d"
        )
    at["a"], at["d"] = at["d"], r
    return [at["alpha"], at["a"]]


def arm(
    rows: Sequence[DHRow], convention: str, name: str, source: str = "", home: Floats | None = None
) -> MachineDescription:
    """The machine; `home` (joints,) m, rad of its home configuration, None: one that is far from singular."""
    if convention not in CONVENTIONS:
        raise StiffmapError(f"--dh-convention: expected {' or '.join(CONVENTIONS)}, got '{convention}'")
    standard = convention == "standard"
    if not SHORTEST < (reach := _reach(rows, standard)) < LONGEST:
        raise StiffmapError(
            f"{source or name}: the arm reaches {reach:.3g} m: say the unit of its lengths, as in --unit a=mm --unit d=mm"
        )
    q = _home(rows, standard, reach) if home is None else np.asarray(home, dtype=float)
    elements: list[Element] = []
    for i, r in enumerate(rows):
        own = _screw("z", r.theta, r.d)
        link = _screw("x", r.alpha, r.a)
        if not standard and np.any(link - np.eye(4)):
            elements.append(Offset(f"link_{i}", _pose(link)))
        kind = "prismatic" if r.slides else "revolute"
        drive = None if r.range is None else Drive(range=r.range)
        elements.append(Joint(r.name, kind, ((0.0, 0.0, 1.0),), (float(q[i]),), actuated=True, drive=drive))
        behind = (own @ link if standard else own) @ r.behind
        if np.any(behind - np.eye(4)):
            elements.append(Offset(f"link_{i + 1}" if standard else f"{r.name}_end", _pose(behind)))
    at = forward(rows, standard, q)
    room = ROOM * reach
    low, high = (tuple(float(v) for v in at[:3, 3] + side * room) for side in (-1.0, 1.0))
    return MachineDescription(
        name, (Leg(LEG, tuple(elements)),), home=_pose(at), workspace=(low, high), source=source,  # type: ignore[arg-type]
        title=f"Serial arm of {len(rows)} joints",
    )  # fmt: skip


def forward(rows: Sequence[DHRow], standard: bool, q: Floats) -> Floats:
    """(4, 4) frame behind the last row at coordinates (joints,)."""
    out = np.eye(4)
    for r, v in zip(rows, q, strict=True):
        own = _screw("z", r.theta + (0.0 if r.slides else v), r.d + (v if r.slides else 0.0))
        link = _screw("x", r.alpha, r.a)
        out = out @ (own @ link if standard else link @ own) @ r.behind
    return out


def _home(rows: Sequence[DHRow], standard: bool, reach: float) -> Floats:
    """Of coordinates in steps of 30 degrees those whose slopes are farthest from losing a direction."""
    rng = np.random.default_rng(0)
    best, where = -1.0, np.zeros(len(rows))
    for k in range(TRIES):
        q = np.array([_within(r, STEP * int(rng.integers(-4, 5)) if k else 0.0, reach) for r in rows])
        size = np.linalg.svd(_slopes(rows, standard, q, reach), compute_uv=False)
        told = float(size[min(len(rows), 6) - 1] / size[0]) if size[0] > 0 else 0.0
        if told > 1.05 * best:
            best, where = told, q
    return where


def _reach(rows: Sequence[DHRow], standard: bool) -> float:
    """Of the tool, m: at most the sum of all lengths. Between nearly parallel axes these are hundreds of metres to and fro,
    and the lever arms about the axes say how large the arm is."""
    total = sum(abs(r.a) + abs(r.d) for r in rows) or 1.0
    turning = [i for i, r in enumerate(rows) if not r.slides]
    draws = np.random.default_rng(0).uniform(-math.pi, math.pi, (TRIES // 10, len(rows)))
    draws[:, [i for i, r in enumerate(rows) if r.slides]] = 0.0
    arms = [np.linalg.norm(_slopes(rows, standard, q, 1.0)[:3, turning], axis=0) for q in draws]
    return min(total, LEVERS * float(np.max(arms, initial=0.0))) if turning else total


def _within(r: DHRow, turn: float, reach: float) -> float:
    v = turn / math.pi * 0.5 * reach if r.slides else turn
    return v if r.range is None else float(np.clip(v, *r.range))


def _slopes(rows: Sequence[DHRow], standard: bool, q: Floats, reach: float) -> Floats:
    """(6, joints) of the pose, lengths in reaches: axes of the joints, and their moments about the tool."""
    frames = [np.eye(4)]
    for r, v in zip(rows, q, strict=True):
        frames.append(frames[-1] @ forward([r], standard, np.array([v])))
    out = np.zeros((6, len(q)))
    for i, r in enumerate(rows):
        at = frames[i] if standard else frames[i] @ _screw("x", r.alpha, r.a)
        axis, lever = at[:3, 2], frames[-1][:3, 3] - at[:3, 3]
        out[:3, i] = (axis if r.slides else np.cross(axis, lever)) / reach
        out[3:, i] = 0.0 if r.slides else axis
    return out


def _screw(axis: str, angle: float, shift: float) -> Floats:
    out = np.eye(4)
    out[:3, :3] = Rotation.from_euler(axis, angle).as_matrix()
    out["xyz".index(axis), 3] = shift
    return out


def _pose(t: Floats) -> Pose:
    return Pose.of(t[:3, 3], t[:3, :3])


def _named(text: str, number: int) -> str:
    plain = re.sub(r"[^A-Za-z0-9_]+", "_", text.strip()).strip("_")
    return f"joint_{number + 1}" if not plain or plain[0].isdigit() else plain
