"""Files of frequency responses: CSV, and universal files (UFF58) through pyuff."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain
from os import PathLike
from pathlib import Path

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError, StiffmapError, needed, refuse_folder
from stiffmap.common.tables.lines import complex_number
from stiffmap.common.tables.named import WORD, Known, NamedTable, sets_of
from stiffmap.common.tables.workbook import TABLES
from stiffmap.common.units import FREQUENCIES, unit_of
from stiffmap.workspace.vibration.response import Complex, frequency_axis
from stiffmap.workspace.vibration.response_units import ResponseUnit, response_unit

LEVEL = re.compile(r"(?i)db(?: ?re[fl]?[.:]?)? ?([\d.]+(?:e-?\d+)?)? ?(.*)")
MEANT = {
    "accelerance": (2, 1), "inertance": (2, 1), "mobility": (1, 1), "receptance": (0, 1), "compliance": (0, 1), "nachgiebigkeit": (0, 1),
    "stiffness": (0, -1), "steifigkeit": (0, -1), "impedance": (1, -1), "apparent_mass": (2, -1),
}  # fmt: skip
"""Names of responses -> derivatives of the displacement, and 1 by force or -1 of a force by it."""
COLUMNS = Known(
    {**dict.fromkeys(("frequency", "real", "imag", "magnitude", "coherence"), ""), "phase": "rad", "response": WORD},
    {"frequency": "frequency_Hz", **{n: f"{n}_m/N" for n in ("real", "imag", "magnitude")}, "phase": "phase_deg"},
    {
        "frequency": r"f|freq\.?|hz|frequenz|linear|n|drehzahl|(rotational_)?speed|omega|ω|kreisfrequenz|angular_frequency",
        "coherence": "coh|kohärenz", "phase": "phase_angle|arg_h|phi|φ", "response": r"h[12]?|frf|h\(f\)|complex",
        "real": "re|real_part|realteil", "imag": "im|imaginary(_part)?|imag_part|imaginär(teil)?",
        "magnitude": "|".join(["mag|amplitude|betrag|gain", *MEANT]),
    },
    lambda name, unit: _meant(name, unit),
    options=False,
)  # fmt: skip
FORMS = (("real", "imag"), ("magnitude", "phase"))
OF_IT = re.compile(
    r"(?P<magnitude>\|[^|]+\|/?|(abs|mag)[({\[].*)|(?P<real>re(al)?[({\[].*)|(?P<imag>im(ag)?[({\[].*)|(?P<phase>(arg|phase|angle|∠).*)"
)
"""A name of a part of a complex number."""


def _meant(name: str, unit: str) -> tuple[str, str]:
    """A unit alone, or of frequencies, says what it is of; a name ends with what is known, as in ``H1 Ch2/Ch1 Real``, or is a part of
    something: ``|Y|``, ``Re{H}``, ``arg(Y)``."""
    if (alone := unit or name).lower() in FREQUENCIES:
        return "frequency", alone
    if not unit and unit_of(name, "angle"):
        return "phase", name
    if part := OF_IT.fullmatch(name):
        return next(n for n, found in part.groupdict().items() if found), unit
    if not name:
        return "imag" if any((response_unit(unit) or ())[1:]) else "phase", unit
    name, unit = (name[:-3], f"dB {unit}") if name.endswith("_db") else (name, unit)
    ends = (name[m.end() :] for m in re.finditer("^|[_/]", name))
    return next((e for e in ends if COLUMNS.has(e)), name), unit


EXAMPLES = "m/N, mm/N, um/N, m/s/N, m/s2/N, g/N and the like, N/m, N/um"
HEAD = "frequency_Hz, real_UNIT, imag_UNIT (or magnitude_UNIT, phase_deg) and, where there is one, coherence"


@dataclass(frozen=True, eq=False)
class MeasuredResponse:
    """One measured response, as a receptance."""

    name: str
    frequency: Floats  # (frequencies,) Hz, rising
    receptance: Complex  # (frequencies,) m/N
    coherence: Floats  # (frequencies,) 0 to 1; NaN where none was measured
    response: str = ""
    """Where and along what it was measured, as the file says: point and direction such as 3 +z."""
    reference: str = ""  # the same of the hammer

    def variance(self, averages: int = 1) -> Floats:
        """(frequencies,) relative variance of the size, from the coherence of so many averages (Bendat and Piersol)."""
        c = np.clip(self.coherence, 1e-6, 1.0)
        return np.asarray((1 - c) / (2 * averages * c))


def read_responses(path: str | PathLike[str]) -> list[MeasuredResponse]:
    """All responses of a file: a table (a text or a workbook), or a universal file (.uff, .unv, or marks -1; data sets 58).

    Raises FileError naming file, row and what was expected: frequencies that do not rise, a coherence outside 0 to 1, units.
    """
    p = Path(path)
    refuse_folder(path, "a file of frequency responses")
    if not p.is_file():
        raise FileError("no such file of frequency responses", file=str(path))
    try:
        universal = p.suffix.lower() in UNIVERSAL or MARK.search(p.read_bytes())
        found = _universal(p) if universal and p.suffix.lower() not in TABLES else _tables(p)
        for one in found:
            _check(one)
    except StiffmapError as problem:
        if type(problem) is not StiffmapError:  # it says its file already, or what is not installed
            raise
        raise FileError(str(problem), file=str(path)) from None
    return found


def _tables(path: Path) -> list[MeasuredResponse]:
    sets = sets_of(path, COLUMNS, "frequency")
    if len({"coherence" in t.values for t in sets}) > 1:
        sets[0].fail(f"expected a coherence of each of {len(sets)} responses, or of none", "coherence")
    return [_table(t, f"{path.stem} {k}" if len(sets) > 1 else path.stem) for k, t in enumerate(sets, 1)]


def _table(t: NamedTable, name: str) -> MeasuredResponse:
    if words := t.values.pop("response", None):
        split = [(a, "real") for a, b in FORMS if b in t.values]  # FRF over two columns of numbers
        parts = [complex_number(f"{c}+0i" if split else c) for c in words]
        if None in parts:
            t.fail("expected complex numbers, such as 0.1+0.2i", "response", parts.index(None))
        for n, part in split or [("real", "real"), ("imag", "imag")]:
            t.values[n], t.units[n] = getattr(np.array(parts, complex), part), t.units["response"]
    if t.units.get("coherence", "").endswith(("%", "percent")):
        t.values["coherence"] = t.values["coherence"] / 100
    if len(t.lines) < 2:
        t.fail("expected two rows or more below the header")
    given = {*t.values} - {"coherence", "frequency"}
    forms = [pair for pair in FORMS if given >= {*pair}]
    if not forms or "frequency" not in t.values or given != {*chain(*forms)}:
        forms = [("", "")]
    hertz = FREQUENCIES.get(t.units.get("frequency", "hz").lower())
    if hertz is None:
        t.fail("expected frequencies in Hz, kHz, rad/s or rpm, as in frequency_Hz", "frequency")
    f = hertz * np.asarray(t.values.get("frequency", 0.0))
    found = second = _in_form(t, forms[0], f)
    with suppress(FileError, IndexError):  # none, or a size that nobody can read, such as decibels of what
        second = _in_form(t, forms[1], f)
    if np.nanmedian(np.abs(found - second)) > 0.1 * np.nanmedian(np.abs(found)):
        t.fail(
            f"expected one response, found two: {' and '.join(t.header[a] for a, _ in forms)}; leave one out"
        )
    return MeasuredResponse(name, f, found, t.values.get("coherence", np.full(len(f), np.nan)))


def _in_form(t: NamedTable, form: tuple[str, str], frequency: Floats) -> Complex:
    """(frequencies,) m/N, by the two columns of a form."""
    polar, unit = form == FORMS[1], t.units.get(form[0], "")
    if polar and (level := LEVEL.fullmatch(unit)):
        unit = level[2] or t.fail("expected what 0 dB is, as in [dB re 1 m/N]", "magnitude")
        t.values["magnitude"] = float(level[1] or 1) * 10 ** (t.values["magnitude"] / 20)
    t.check(
        form[0],
        lambda v: (v >= 0) | (not polar),
        "a size of zero or more ([dB re 1 m/N] where it is in decibels)",
    )
    known = response_unit(unit)
    kind, power = (None, 1) if known is None else _kind(known)
    if known is None or kind is None or (not polar and t.units["imag"] != unit):
        t.fail(f"expected the columns {HEAD}, UNIT one of {EXAMPLES}; found {', '.join(t.header.values())}")
    words = re.sub(r"[\W_]+", "_", t.header.get(form[0], "").lower())
    if wrong := [n for n, meant in MEANT.items() if n in words and meant != (kind, power)]:
        t.fail(f"expected a unit of {wrong[0].replace('_', ' ')}; found {unit}", form[0])
    a, b = (t.values[n] for n in form)
    if polar:
        steps = np.abs(np.diff(b, prepend=b[:1])) <= 2 * np.pi + 0.01
        t.check(
            "phase", lambda _: steps & (np.abs(b) < 100), "steps of a turn at most (phase_deg: in degrees)"
        )
    values = np.asarray(known.size * (a * np.exp(1j * b) if polar else a + 1j * b), complex)
    if power < 0:
        t.check(form[0], lambda _: values != 0, "a force by a motion above zero")
        values = 1 / values
    out = _receptance(frequency, values, kind)
    if polar:  # over a peak by 90 to 180 deg: 2 to 3 rad, or 57 times as much
        ends = _about_peak(out)
        turn, degrees = np.ptp(b[slice(*ends) if len(ends) == 2 else slice(None)]), t.units["phase"] != "rad"
        if len(ends) == 2 and turn < 0.1 if degrees else bool(ends) and turn > 20:
            found, other = f"{turn / t.size['phase']:.3g}", "rad" if degrees else "deg"
            t.fail(
                f"expected a turn by 90 to 180 deg over the peak, found {found}: is it in {other}?", "phase"
            )
    return out


def _about_peak(receptance: Complex) -> list[int]:
    """The nearest frequencies below and above the largest size at which it has half the power, as far as there are any."""
    top = np.argmax(np.nan_to_num(size := np.abs(receptance)))
    low = np.flatnonzero(size < size[top] / np.sqrt(2))
    return [*low[low < top][-1:], *low[low > top][:1]]


def _gains_energy(frequency: Floats, receptance: Complex) -> bool:
    """Whether the lines over the largest peak, three are enough, are those of one mode whose damping is below zero by more than three
    standard uncertainties: with x the frequency by that of their middle, H (k - x² + i c x) = R."""
    ends = _about_peak(receptance)
    lines = [k for k in range(ends[0], ends[-1] + 1) if np.isfinite(receptance[k])] if len(ends) == 2 else []
    if len(lines) < 3:
        return False
    H, x = receptance[lines] / np.nanmax(np.abs(receptance)), frequency[lines] / frequency[lines].mean()
    A = np.stack([H, 1j * x * H, np.ones_like(H), 1j * np.ones_like(H)], axis=1)
    A, y = np.concatenate([A.real, A.imag]), np.concatenate([(x**2 * H).real, (x**2 * H).imag])
    found, inverse = np.linalg.pinv(A) @ y, np.linalg.pinv(A.T @ A)
    return bool(found[1] < -3 * np.sqrt(((y - A @ found) ** 2).sum() / (len(y) - 4) * inverse[1, 1]))


def _kind(unit: ResponseUnit) -> tuple[int | None, int]:
    """The derivatives, and 1 of a motion by force, -1 of a force by motion: dynamic stiffness, impedance, apparent mass."""
    inverse = _derivatives(ResponseUnit().over(unit))
    return (_derivatives(unit), 1) if inverse is None else (inverse, -1)


def _derivatives(unit: ResponseUnit, length: int = 1) -> int | None:
    """0, 1, 2 for displacement, velocity, acceleration by force; None for what is none of them."""
    return -unit.time if unit[1:3] == (length, -1) and -unit.time in MOTIONS.values() else None


def _receptance(frequency: Floats, values: Complex, derivatives: int) -> Complex:
    if not derivatives:
        return values
    w = 2j * np.pi * frequency
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(w == 0, np.nan, values / w**derivatives))


UNIVERSAL = (".uff", ".unv", ".uf", ".u58")
DataSet = dict[str, int | float | str | np.ndarray]
"""A data set of a universal file, as pyuff names its fields."""
MOTIONS = {8: 0, 11: 1, 12: 2}  # of universal files: displacement, velocity, acceleration
WAYS = {0: "", 1: "+x", -1: "-x", 2: "+y", -2: "-y", 3: "+z", -3: "-z", 4: "+rx", 5: "+ry", 6: "+rz", -4: "-rx", -5: "-ry", -6: "-rz"}  # fmt: skip
RESPONSE, COHERENCE = 4, 6
UNITS, FUNCTION = 164, 58
MARK = re.compile(rb"    -1 *(?=[\r\n]|\Z)")
"""Before and after each data set; not a whole line, as one may follow binary numbers."""
UNKNOWN, FORCES, FREQUENCY = (0, 1), (9, 13), 18
WANTED = "displacement, velocity or acceleration (types 8, 11, 12) by force"
QUANTITIES = {
    0: "an unknown quantity", 1: "a general one", 8: "a displacement", 9: "a reaction force", 11: "a velocity",
    12: "an acceleration", 13: "a force", 15: "a pressure", 17: "a time", 18: "a frequency", 19: "a speed of rotation",
}  # fmt: skip


def _universal(path: Path) -> list[MeasuredResponse]:
    with needed("reading universal files", "vibration"):
        import pyuff  # type: ignore[import-untyped]
    try:
        file = pyuff.UFF(str(path))
        sets = file.read_sets()
        marks = MARK.findall(path.read_bytes())
        if not marks:
            raise ValueError(f"found no mark -1 in it; a table ends in {', '.join(TABLES)}")
        if len(marks) != 2 * file.get_n_sets():
            raise ValueError(f"found {len(marks)} marks -1 for {file.get_n_sets()}: it is cut off")
    except Exception as problem:  # the reader raises whatever its parsing meets
        raise StiffmapError(f"expected a universal file with data sets 58; {problem}") from None
    base: DataSet = {}
    functions = []
    for s in sets if isinstance(sets, list) else [sets]:
        if s.get("type") == UNITS:  # those of all that follows
            base = s
        elif s.get("type") == FUNCTION:
            _check_whole(s)
            functions.append((s, base))
    responses = [(s, base) for s, base in functions if s["func_type"] == RESPONSE]
    if not responses:
        raise StiffmapError("no frequency response (data set 58, function type 4) in it")
    ends = [_ends(s) for s, _ in responses]
    coherence = _coherence(ends, [s for s, _ in functions if s["func_type"] == COHERENCE])
    out = []
    for (s, base), (response, reference), of in zip(responses, ends, coherence, strict=True):
        name = f"response {s.get('id1', '')}".strip()
        x = np.asarray(s["x"], dtype=float)
        try:
            f, (size, kind) = x * _hertz(s), _in_si(s, base)
        except StiffmapError as problem:
            raise StiffmapError(f"{name}: {problem}") from None
        if of is not None and not np.array_equal(of["x"], x):
            raise StiffmapError(f"{name}: expected its coherence at the same {len(f)} frequencies")
        known = np.full(len(f), np.nan) if of is None else np.real(of["data"])
        out.append(
            MeasuredResponse(
                str(s.get("id1", path.stem)), f, _receptance(f, np.asarray(size * np.asarray(s["data"]), complex), kind),
                np.asarray(known, dtype=float), response, reference,
            )
        )  # fmt: skip
    return out


def _coherence(ends: list[tuple[str, str]], given: list[DataSet]) -> list[DataSet | None]:
    """The coherence of each response, by its ends: of several there one after the other, or one for all."""
    of = {e: [c for c in given if _ends(c) == e] for e in ends}
    for e, found in of.items():
        if len(found) not in (0, 1, ends.count(e)):
            where = " by ".join(e)
            raise StiffmapError(f"{where}: found {len(found)} coherences of {ends.count(e)} responses")
    return [of[e][ends[:k].count(e) % len(of[e])] if of[e] else None for k, e in enumerate(ends)]


def _hertz(s: DataSet) -> float:
    """Hz of one unit of the abscissa."""
    kind, label = int(s.get("abscissa_spec_data_type") or 0), _label(s, "abscissa")
    if kind not in (*UNKNOWN, FREQUENCY):
        raise _unlike("frequencies along the abscissa (type 18)", _quantity(kind))
    if label and label.lower() not in FREQUENCIES:
        raise _unlike("frequencies in Hz, kHz, rad/s or rpm", repr(label))
    return FREQUENCIES[label.lower()] if label else 1.0


def _in_si(s: DataSet, base: DataSet) -> tuple[float, int]:
    """What the ordinate is multiplied by to be in SI, and 0, 1, 2 for displacement, velocity, acceleration.

    Units that stand at the axes count before those of the file (data set 164), as the format says.
    """
    kind, by = int(s.get("ordinate_spec_data_type") or 0), int(s.get("orddenom_spec_data_type") or 0)
    if by not in (*UNKNOWN, *FORCES):
        raise _unlike("a response divided by a force (types 9, 13)", f"one by {_quantity(by)}")
    if kind not in (*UNKNOWN, *MOTIONS):
        raise _unlike(WANTED, _quantity(kind))
    turns, moment = (abs(int(s[key])) > 3 for key in ("rsp_dir", "ref_dir"))
    length = 1 - turns - moment
    above, below = _unit_of(s, "ordinate"), _unit_of(s, "orddenom")
    if above is None and kind in MOTIONS:
        above = ResponseUnit(_base(base, "length") if not turns else 1.0, int(not turns), 0, -MOTIONS[kind])
    if below is None and by in FORCES and (above is None or above.force == 0):
        size = _base(base, "force") * (_base(base, "length") if moment else 1.0)
        below = ResponseUnit(size, int(moment), 1)
    if above is None:
        raise _unlike(WANTED, f"{_quantity(kind)} without a unit")
    if above.force == 0 and below is None:
        raise _unlike("the force that the response is divided by, as type 13 or with its unit", "neither")
    whole = above.over(below) if below is not None and above.force == 0 else above  # else its label has both
    found = _derivatives(whole, length)
    if found is None or MOTIONS.get(kind, found) != found:
        wanted = _quantity(kind) if kind in MOTIONS else "displacement, velocity or acceleration"
        raise _unlike(f"the unit of {wanted} by force, such as {EXAMPLES}", _written(s))
    return whole.size, found


def _unit_of(s: DataSet, axis: str) -> ResponseUnit | None:
    """The unit at an axis; None where there is none."""
    label = _label(s, axis)
    unit = response_unit(label) if label else None
    if label and unit is None:
        raise _unlike(f"a unit that is known, such as {EXAMPLES}", repr(label))
    return unit


def _label(s: DataSet, axis: str) -> str:
    """The unit as it is written at an axis: in its own field, or in brackets after the axis's name."""
    own, name = (str(s.get(f"{axis}_{field}") or "").strip() for field in ("axis_units_lab", "axis_lab"))
    if own.upper() not in ("", "NONE"):
        return own.strip("[]")
    inside = re.fullmatch(r".*[^)\]]\s*[(\[]([^()\[\]]+)[)\]]", name)
    return inside[1].strip() if inside else ""


def _unlike(expected: str, found: str) -> StiffmapError:
    return StiffmapError(f"expected {expected}; found {found}")


def _written(s: DataSet) -> str:
    return " by ".join(repr(label) for axis in ("ordinate", "orddenom") if (label := _label(s, axis)))


def _quantity(kind: int) -> str:
    return f"{QUANTITIES.get(kind, 'another quantity')} (type {kind})"


def _base(base: DataSet, what: str) -> float:
    """SI size of the file's own unit of length or force: data set 164 has how many of them make one of SI."""
    factor = float(base.get(what, 1.0))
    if not 0 < factor < np.inf:
        raise StiffmapError(f"data set 164: expected a positive factor for {what}; found {factor:g}")
    if base.get("units_code") == 1 and factor != 1:
        raise StiffmapError(
            f"data set 164 says SI, but {factor:g} for {what}; expected a factor of 1 or units at the axes"
        )
    return 1 / factor


def _check_whole(s: DataSet) -> None:
    """What a data set 58 promises in its head against what is in it; StiffmapError."""
    name = f"data set 58 {s.get('id1', '')}".strip()
    whole = {k: s.get(k) for k in ("func_type", "num_pts", "rsp_node", "rsp_dir", "ref_node", "ref_dir")}
    lost = [k for k, v in whole.items() if not isinstance(v, int)]
    if lost:
        raise StiffmapError(f"{name}: expected a whole number for {', '.join(lost)} in its head")
    if s["func_type"] == RESPONSE and not np.iscomplexobj(s.get("data", ())):
        raise StiffmapError(f"{name}: expected complex numbers (data type 5 or 6); found real ones")
    x, data = np.atleast_1d(s.get("x", ())), np.atleast_1d(s.get("data", ()))
    s["x"], s["data"] = x, data = _without_padding(s, x), _without_padding(s, data)
    if not len(x) == len(data) == s["num_pts"]:
        raise StiffmapError(f"{name}: expected {s['num_pts']} points, as its head says; found {len(data)}")
    if not np.isfinite(data).all():
        k = int(np.flatnonzero(~np.isfinite(data))[0])
        raise StiffmapError(f"{name}: expected finite numbers; point {k + 1} has {data[k]}")


def _without_padding(s: DataSet, values: np.ndarray) -> np.ndarray:
    """The values less the zeros that fill the last line."""
    line = 6 if s.get("ord_data_type") in (2, 5) else 4
    count, data = int(s["num_pts"]), np.atleast_1d(s["data"])
    surplus = values[count:]
    padded = len(surplus) * (1 + np.iscomplexobj(data)) < line and not np.any(data[count:])
    return values[:count] if padded else values


def _ends(s: DataSet) -> tuple[str, str]:
    def end(prefix: str) -> str:
        return f"{s.get(prefix + '_node', 0)} {WAYS.get(int(s.get(prefix + '_dir', 0)), '')}".strip()

    return end("rsp"), end("ref")


def _check(one: MeasuredResponse) -> None:
    c, where = one.coherence, f"response {one.name}" if one.name else "response"
    frequency_axis(one.frequency, where)
    bad = np.flatnonzero(np.isfinite(c) & ((c < 0) | (c > 1 + 1e-9)))
    if bad.size:
        k = int(bad[0])
        raise StiffmapError(f"{where}: expected a coherence from 0 to 1; point {k + 1} has {c[k]:g}")
    if _gains_energy(one.frequency, one.receptance):
        what = "expected a phase that falls over the peak, found one that rises: turn its sign"
        raise StiffmapError(f"{where}: {what}")
    known = c[np.isfinite(c)]
    if known.size > 2 and (known >= 1).all():
        raise StiffmapError(
            f"{where}: the coherence is 1 at every frequency, as that of one hit without averages is; it is no measure of "
            "noise: leave the column out, or average several hits"
        )
