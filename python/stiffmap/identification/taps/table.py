"""A table of tap tests: one row per mode that a modal program found, or per measured response, at a pose of the machine."""

from __future__ import annotations

from dataclasses import dataclass, fields
from os import PathLike
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.arguments import checked
from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError
from stiffmap.common.tables.named import WORD, Known, NamedTable, read_named
from stiffmap.model.files.load import Source
from stiffmap.solve.machine import Machine, as_machine
from stiffmap.workspace.vibration.extraction import extract_modes
from stiffmap.workspace.vibration.files import MeasuredResponse, read_responses

POSE, WAY = ("x", "y", "z"), ("dir_x", "dir_y", "dir_z")
ABOVE_ZERO = ("frequency", "u", "u_damping", "u_dir", "q", "loss")
NUMBERS = (*POSE, *ABOVE_ZERO, "damping", *WAY)
UNITS = {
    **dict.fromkeys(POSE, "m"), "frequency": "Hz", "u": "Hz", "u_damping": "percent", "u_dir": "", "damping": "percent", "q": "", "loss": "",
    **dict.fromkeys(WAY, ""), **dict.fromkeys(("response", "along", "hammer", "mode"), WORD),
}  # fmt: skip
USUAL = {n: f"{n}_{ {'m': 'mm'}.get(u, u) }" for n, u in UNITS.items() if u not in ("", WORD)}
SPELLED = {
    "frequency": "f_?n?|freq\\.?|(natural|resonan(ce|t)|modal|damped|undamped)_freq(uency)?|resonance|eigenfrequency|(eigen|resonanz)?frequenz|omega|ω",
    "damping": "ζ|zeta|d|damp|(modal_)?damping(_ratio)?|dämpfung(sgrad)?|lehr", "loss": "loss_factor|eta|η|verlustfaktor",
    "q": "(q|quality)_factor|güte(faktor)?", "mode": r"mode_(no\.?|number|nr)",
    "u": r"(u|σ|sigma|std\.?_?(dev\.?)?|uncertainty)(_(f|freq|frequency))?", "u_damping": "(u|σ|sigma|std)_(d|damping|zeta)",
    **{f"dir_{a}": f"(mode_shape|shape|phi|direction)_{a}" for a in "xyz"},
}  # fmt: skip
ASIDE = r"modal_(mass|stiffness|damping_coefficient)|(modal)?_?(phase_)?(collinearity|complexity)|residue|amplitude"
KNOWN = Known(
    UNITS,
    USUAL,
    SPELLED,
    blank=True,
    aside=ASIDE,
    titled="xyz",
    stacked={"frequency", "damping", "loss", "q", "u"},
)
SHARE = 0.01
"""Standard uncertainty of a frequency where none is given, relative."""
DAMPING_SHARE = 0.2
"""Standard uncertainty of a damping ratio where none is given, relative."""
AXES = {f"{sign}{a}": (i, 1.0 - 2 * (sign == "-")) for sign in "+-" for i, a in enumerate("xyz")}
REPEATS = {"frequency": 0.002, "ratio": 0.1, "flexibility": 0.05}
"""Standard uncertainty, relative, of what one fit does not see: mounting, hits, calibration of hammer and accelerometer."""
SMALL = 0.01
"""Of the largest flexibility at the pose: what models of small modes may be off by."""
NEAR = 0.05
"""Difference of the logarithms of two frequencies from which on each mode has a shape of its own."""
NOISE = 3.0
"""Standard uncertainties that a shape has at least, or it is noise."""


@dataclass(frozen=True, eq=False)
class TapTest:
    """Modes (n) found by tapping, base axes, SI; NaN where a number was not measured."""

    position: Floats
    """(n, 3) m, commanded TCP."""
    frequency: Floats
    """(n,) Hz."""
    u: Floats
    """(n,) Hz, standard uncertainty."""
    ratio: Floats
    """(n,) damping ratio."""
    direction: Floats
    """(n, 3) unit vectors along which the tool moves; NaN also where the shape is noise."""
    u_ratio: Floats = None  # type: ignore[assignment]
    """(n,) standard uncertainty of the damping ratio; 20 % where left out."""
    flexibility: Floats = None  # type: ignore[assignment]
    """(n, 3) m/N, motion of the TCP by a force of the hammer, as far as the mode carries it."""
    u_flexibility: Floats = None  # type: ignore[assignment]
    hammer: Floats = None  # type: ignore[assignment]
    """(n, 3) unit vectors of the hammer's force."""
    lever: Floats = None  # type: ignore[assignment]
    """(n, 3) m from the TCP to the point that it strikes."""

    def __post_init__(self) -> None:
        unknown = np.full((len(self.frequency), 3), np.nan)
        for name, value in (
            ("u_ratio", DAMPING_SHARE * self.ratio), ("flexibility", unknown), ("u_flexibility", unknown),
            ("hammer", unknown), ("lever", 0 * self.position),
        ):  # fmt: skip
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.frequency)

    @property
    def poses(self) -> tuple[Floats, NDArray[np.intp]]:
        """Distinct positions, and which of them each row is at."""
        once, back = np.unique(self.position, axis=0, return_inverse=True)
        return once, back.reshape(-1)


@checked
def load_taps(path: str | PathLike[str], machine: Machine | Source | None = None) -> TapTest:
    """Table of tap tests from a CSV file.

    Columns x_mm, y_mm, z_mm (commanded TCP) and frequency_Hz; where known u_Hz (else 1 %), damping_percent or Q, u_damping_percent (else
    20 % of it), dir_x, dir_y, dir_z (along which the tool moves in the mode, any length) and u_dir (of each of them). In place of
    frequency_Hz, `response` names a file of `read_responses` next to the table, measured at the TCP along the axis `along` (+x to -z;
    +x +y +z of three responses in one table) with the hammer along the axis `hammer`; universal files may say both themselves. Rows of
    one pose and hammer share their modes.

    machine: whose workspace the poses are checked against; None: they are not. Raises FileError naming line and column.
    """
    p, file = Path(path), str(path)
    if not p.is_file():
        raise FileError("no such table of tap tests", file=file)
    t = read_named(path, KNOWN)
    missing = [USUAL[c] for c in POSE if c not in t.values]
    if not {"frequency", "response"} & set(t.values):
        missing.append("frequency_Hz or response")
    if missing:
        t.fail(
            f"expected the columns {', '.join(USUAL.get(c, c) for c in UNITS)}, all but the pose where known; missing "
            f"{', '.join(missing)}"
        )
    for name in ABOVE_ZERO:
        t.check(name, lambda v: v > 0, "a number above zero")
    given = [n for n in ("q", "loss", "damping") if n in t.values]
    if len(given) > 1:
        t.fail(f"expected the damping once, found it as '{t.header[given[1]]}' as well", given[0])
    if "q" in given:
        t.values["damping"] = 50 / t.values["q"]
    elif "loss" in given:
        t.values["damping"] = 50 * t.values["loss"]
    # in %, where all are below they may as well be ratios
    least = 0.1 if t.size.get("damping", 1.0) == 1 else 0.0
    expected = "from 0 to below 100 %, and not all below 0.1 (a ratio of 0.02 is 2 %)"
    t.check(
        "damping", lambda v: (v == 0) | ((v > 0) & (v < 100) & (np.nanmax(v, initial=0) >= least)), expected
    )
    typed: list[dict[str, object]] = []
    measured: list[Measured] = []
    places = [(float(x), float(y), float(z)) for x, y, z in t.block(POSE)]
    for i, at in enumerate(places):
        n, response = _numbers(t, i)
        along, hammer = (t.values[c][i] if c in t.values else "" for c in ("along", "hammer"))
        if response:
            measured.append(Measured(at, p.parent / response, along, hammer, file, t.lines[i]))
        else:
            typed.append(_typed(n, at))
    if machine is not None:
        _check_unit(np.array(places), as_machine(machine), file, t.lines)
    found = typed + modes_of(measured)
    return TapTest(**{f.name: np.array([row[f.name] for row in found], float) for f in fields(TapTest)})


def _numbers(t: NamedTable, i: int) -> tuple[dict[str, float], str]:
    """Numbers of a row by column, NaN where a cell that may be empty is, and the file of its response."""
    n = {c: float(t.values[c][i]) if c in t.values else np.nan for c in NUMBERS}
    response = str(t.values["response"][i]) if "response" in t.values else ""
    needed = {*POSE} if response else {*POSE, "frequency"}
    if not all(np.isnan(n[c]) for c in WAY):
        needed |= {*WAY}
    for c in NUMBERS:
        if c in needed and np.isnan(n[c]):
            t.fail("expected a number, found an empty cell", c, i)
        if response and c not in POSE and not np.isnan(n[c]):
            t.fail(f"expected no {t.header[c]} with a response", c, i)
    return n, response


def _typed(n: dict[str, float], at: tuple[float, float, float]) -> dict[str, object]:
    f, way = n["frequency"], np.array([n[c] for c in WAY])
    size, ratio = float(np.linalg.norm(way)), n["damping"] / 100 or np.nan
    shape = size > 0 and not size < NOISE * n["u_dir"]
    share = n["u_damping"] / 100
    unknown = np.full(3, np.nan)
    return {
        "position": at, "frequency": f, "u": SHARE * f if np.isnan(n["u"]) else n["u"], "ratio": ratio,
        "direction": way / size if shape else unknown,
        "u_ratio": DAMPING_SHARE * ratio if np.isnan(share) else share,
        "flexibility": unknown, "u_flexibility": unknown, "hammer": unknown, "lever": np.zeros(3),
    }  # fmt: skip


def _check_unit(position: Floats, machine: Machine, file: str, lines: list[int]) -> None:
    """FileError where poses are plainly metres (or micrometres) in columns of millimetres."""
    low, high = machine.workspace
    span = np.linalg.norm(high - low)
    at_origin = len(np.unique(position, axis=0)) > 1 and (np.abs(position) < 2e-3 * span).all()
    for unit, factor in (("metres", 1e3), ("micrometres", 1e-3)):
        other = _far(factor * position, low, high) < 0.5 * span
        wrong = other & ((_far(position, low, high) > 0.5 * span) | (factor > 1 and at_origin))
        if wrong.any():
            i = int(np.argmax(wrong))
            x, y, z = 1e3 * position[i]
            box = ", ".join(
                f"{a} {1e3 * u:g} to {1e3 * v:g}" for a, u, v in zip("xyz", low, high, strict=True)
            )
            raise FileError(
                f"expected a pose in mm near the workspace ({box}); found {x:g}, {y:g}, {z:g}, which are {unit}",
                file=file, line=lines[i], key="x_mm, y_mm, z_mm",
            )  # fmt: skip


def _far(position: Floats, low: Floats, high: Floats) -> Floats:
    """(n,) m, distance from a box."""
    return np.asarray(np.linalg.norm(position - np.clip(position, low, high), axis=1))


@dataclass(frozen=True)
class Measured:
    """One file of responses, as a row of the table names it."""

    position: tuple[float, float, float]
    """m."""
    place: Path
    along: str
    hammer: str
    file: str
    line: int

    def fail(self, message: str, column: str) -> NoReturn:
        raise FileError(message, file=self.file, line=self.line, key=column)

    def axis(self, given: str, own: str, column: str) -> str:
        """Of the accelerometer or the hammer: the table's word, or the end of the file's own."""
        word = given or own.rpartition(" ")[2]
        word = f"+{word}" if word in ("x", "y", "z") else word
        if word not in AXES:
            self.fail(f"expected one of {', '.join(AXES)}; found {repr(word) if word else 'none'}", column)
        return word

    def read(self) -> list[tuple[str, str, MeasuredResponse]]:
        """Axes of accelerometer and hammer, and the response."""
        found = read_responses(self.place)
        points = sorted({r.response.split(" ")[0] for r in found})
        if len(points) > 1:
            raise FileError(
                f"expected responses at one point, the TCP; found points {', '.join(points)}", file=str(self.place)
            )  # fmt: skip
        words = self.along.split() or [""] * len(found)
        words *= len(found) if len(words) == 1 and found[0].response else 1
        if len(words) != len(found):
            each = f"an axis for each of {len(found)} responses, as in '+x +y +z'"
            self.fail(f"expected {each}; found '{self.along}'", "along")
        return [
            (self.axis(word, r.response, "along"), self.axis(self.hammer, r.reference, "hammer"), r)
            for word, r in zip(words, found, strict=True)
        ]


def modes_of(measured: list[Measured]) -> list[dict[str, object]]:
    """Fields of a `TapTest`, row by row; FileError."""
    groups: dict[tuple[object, ...], list[tuple[Measured, str, MeasuredResponse]]] = {}
    for m in measured:
        for along, hammer, r in m.read():
            groups.setdefault((m.position, hammer), []).append((m, along, r))
    return [row for (_, hammer), group in groups.items() for row in _modes(str(hammer), group)]


def _modes(hammer: str, group: list[tuple[Measured, str, MeasuredResponse]]) -> list[dict[str, object]]:
    first, responses = group[0][0], [r for _, _, r in group]
    for m, _, r in group:
        if not np.array_equal(r.frequency, responses[0].frequency):
            raise FileError(
                f"expected the frequencies of {first.place.name}, of the same pose and hammer; found others",
                file=str(m.place),
            )
    found = extract_modes(responses)
    if not len(found.frequency):
        raise FileError("no mode stands out of the noise", file=str(first.place))
    motion, u = _by_axis([a for _, a, _ in group], found.flexibility, found.u_flexibility)
    size, scatter = np.sqrt(np.nansum(motion**2, axis=1)), np.sqrt(np.nansum(u**2, axis=1))
    apart = np.abs(np.log(found.frequency[:, None] / found.frequency)) + 9 * np.eye(len(size))
    blow = np.zeros(3)
    blow[AXES[hammer][0]] = AXES[hammer][1]
    rows: list[dict[str, object]] = []
    for i, (f, ratio) in enumerate(zip(found.frequency, found.ratio, strict=True)):
        shape = size[i] > NOISE * scatter[i]
        own = shape and apart[i].min() > NEAR
        total = np.sqrt(u[i] ** 2 + (REPEATS["flexibility"] * size[i]) ** 2 + (SMALL * size.max()) ** 2)
        rows.append({
            "position": first.position, "frequency": f, "ratio": ratio, "hammer": blow, "lever": np.zeros(3),
            "u": np.hypot(found.u_frequency[i], REPEATS["frequency"] * f),
            "u_ratio": np.hypot(found.u_ratio[i], REPEATS["ratio"] * ratio),
            "direction": motion[i] / size[i] if shape else np.full(3, np.nan),
            "flexibility": motion[i] if own else np.full(3, np.nan), "u_flexibility": total,
        })  # fmt: skip
    return rows


def _by_axis(along: list[str], flexibility: Floats, u: Floats) -> tuple[Floats, Floats]:
    """(modes, 3) m/N, the mean of the responses along each axis, and its uncertainty; NaN where there is none."""
    out = np.full((2, len(flexibility), 3), np.nan)
    for a in range(3):
        own = [j for j, word in enumerate(along) if AXES[word][0] == a]
        if own:
            out[0, :, a] = (flexibility[:, own] * [AXES[along[j]][1] for j in own]).mean(axis=1)
            out[1, :, a] = np.sqrt((u[:, own] ** 2).sum(axis=1)) / len(own)
    return out[0], out[1]
