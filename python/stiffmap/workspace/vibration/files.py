"""Files of frequency responses: CSV, and universal files (UFF58) through pyuff."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError, MissingPartError
from stiffmap.common.tables.named import Known, read_named
from stiffmap.common.units import ACCELERATIONS, LENGTHS, size_of
from stiffmap.workspace.vibration.poles import Complex

KINDS = {"m/N": 0, "um/N": 0, "µm/N": 0, "mm/N": 0, "m/s/N": 1, "m/s2/N": 2, "m/s²/N": 2, "g/N": 2}
COLUMNS = Known(
    {"frequency": "Hz", "real": "", "imag": "", "coherence": ""}, {"frequency": "frequency_Hz"}, {}
)
HEAD = "frequency_Hz, real_UNIT, imag_UNIT and, where there is one, coherence"


@dataclass(frozen=True, eq=False)
class MeasuredResponse:
    """One measured response, as a receptance."""

    name: str
    frequency: Floats
    """(frequencies,) Hz, rising."""
    receptance: Complex
    """(frequencies,) m/N."""
    coherence: Floats
    """(frequencies,) 0 to 1; NaN where none was measured."""
    response: str = ""
    """Where and along what it was measured, as the file says: point and direction such as 3 +z."""
    reference: str = ""
    """The same of the hammer."""

    def variance(self, averages: int = 1) -> Floats:
        """(frequencies,) relative variance of the size, from the coherence of so many averages (Bendat and Piersol)."""
        c = np.clip(self.coherence, 1e-6, 1.0)
        return np.asarray((1 - c) / (2 * averages * c))


def read_responses(path: str | PathLike[str]) -> list[MeasuredResponse]:
    """All responses of a file: .csv, or .uff, .unv (data sets 58).

    Raises FileError naming file, row and what was expected: frequencies that do not rise, a coherence outside 0 to 1, units.
    """
    p = Path(path)
    if not p.is_file():
        raise FileError("no such file of frequency responses", file=str(path))
    found = [_csv(p)] if p.suffix.lower() == ".csv" else _universal(p)
    for one in found:
        _check(one, str(path))
    return found


def _csv(path: Path) -> MeasuredResponse:
    t = read_named(path, COLUMNS)
    unit = t.units.get("real", "")
    if unit not in KINDS or t.units.get("imag") != unit or "frequency" not in t.values:
        t.fail(
            f"expected the columns {HEAD}, UNIT one of {', '.join(KINDS)}; found {', '.join(t.header.values())}"
        )
    if len(t.lines) < 2:
        t.fail("expected two rows or more below the header")
    f, real, imag = (t.values[n] for n in ("frequency", "real", "imag"))
    motion = unit.removesuffix("/N")
    scale = 1.0 if motion == "m/s" else size_of(motion, LENGTHS, ACCELERATIONS)
    values = np.asarray(scale * (real + 1j * imag), complex)
    coherence = t.values.get("coherence", np.full(len(f), np.nan))
    return MeasuredResponse(path.stem, f, _receptance(f, values, KINDS[unit]), coherence)


def _receptance(frequency: Floats, values: Complex, derivatives: int) -> Complex:
    if not derivatives:
        return values
    w = 2j * np.pi * frequency
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(w == 0, np.nan, values / w**derivatives))


MOTIONS = {8: 0, 11: 1, 12: 2}
"""Of universal files: displacement, velocity, acceleration."""
WAYS = {0: "", 1: "+x", -1: "-x", 2: "+y", -2: "-y", 3: "+z", -3: "-z", 4: "+rx", 5: "+ry", 6: "+rz", -4: "-rx", -5: "-ry", -6: "-rz"}  # fmt: skip
RESPONSE, COHERENCE = 4, 6


def _universal(path: Path) -> list[MeasuredResponse]:
    try:
        import pyuff  # type: ignore[import-untyped]
    except ImportError:
        raise MissingPartError(
            "universal files need the package pyuff; install it with: pip install 'stiffmap[vibration]'"
        ) from None
    try:
        sets = pyuff.UFF(str(path)).read_sets()
    except Exception as problem:  # the reader raises whatever its parsing meets
        raise FileError(f"expected a universal file with data sets 58; {problem}", file=str(path)) from None
    sets = [s for s in (sets if isinstance(sets, list) else [sets]) if s.get("type") == 58]
    for s in sets:
        _check_whole(s, path)
    responses = [s for s in sets if s["func_type"] == RESPONSE]
    if not responses:
        raise FileError("no frequency response (data set 58, function type 4) in it", file=str(path))
    coherence = {_ends(s): s for s in sets if s["func_type"] == COHERENCE}
    out = []
    for s in responses:
        kind = int(s.get("ordinate_spec_data_type", 0))
        if kind not in MOTIONS:
            raise FileError(
                f"response {s.get('id1', '')}: expected displacement, velocity or acceleration (types 8, 11, 12) by "
                f"force; found type {kind}", file=str(path)
            )  # fmt: skip
        f = np.asarray(s["x"], dtype=float)
        response, reference = _ends(s)
        of = coherence.get((response, reference))
        if of is not None and not np.array_equal(of["x"], f):
            raise FileError(
                f"response {s.get('id1', '')}: expected its coherence at the same {len(f)} frequencies; found "
                f"{len(of['x'])}, which are others", file=str(path)
            )  # fmt: skip
        known = np.full(len(f), np.nan) if of is None else np.real(of["data"])
        out.append(
            MeasuredResponse(
                str(s.get("id1", path.stem)), f, _receptance(f, np.asarray(s["data"], complex), MOTIONS[kind]),
                np.asarray(known, dtype=float), response, reference,
            )
        )  # fmt: skip
    return out


def _check_whole(s: dict[str, Any], path: Path) -> None:
    """What a data set 58 promises in its head against what is in it; FileError."""
    name = f"data set 58 {s.get('id1', '')}".strip()
    whole = {k: s.get(k) for k in ("func_type", "num_pts", "rsp_node", "rsp_dir", "ref_node", "ref_dir")}
    lost = [k for k, v in whole.items() if not isinstance(v, int)]
    if lost:
        raise FileError(f"{name}: expected a whole number for {', '.join(lost)} in its head", file=str(path))
    x, data = np.atleast_1d(s.get("x", ())), np.atleast_1d(s.get("data", ()))
    if not len(x) == len(data) == s["num_pts"]:
        raise FileError(
            f"{name}: expected {s['num_pts']} points, as its head says; found {len(data)}: a line is lost, or one too many",
            file=str(path),
        )
    if not np.isfinite(data).all():
        k = int(np.flatnonzero(~np.isfinite(data))[0])
        raise FileError(f"{name}: expected finite numbers; point {k + 1} has {data[k]}", file=str(path))


def _ends(s: dict[str, object]) -> tuple[str, str]:
    def end(prefix: str) -> str:
        return f"{s.get(prefix + '_node', 0)} {WAYS.get(int(s.get(prefix + '_dir', 0)), '')}".strip()  # type: ignore[call-overload]

    return end("rsp"), end("ref")


def _check(one: MeasuredResponse, file: str) -> None:
    f, c = one.frequency, one.coherence
    where = f"response {one.name}" if one.name else "response"
    if not np.isfinite(f).all() or f[0] < 0:
        raise FileError(f"{where}: expected finite frequencies (Hz) from 0 on", file=file)
    fall = np.flatnonzero(np.diff(f) <= 0)
    if fall.size:
        k = int(fall[0])
        raise FileError(
            f"{where}: expected rising frequencies; point {k + 2} has {f[k + 1]:g} Hz after {f[k]:g} Hz",
            file=file,
        )
    bad = np.flatnonzero(np.isfinite(c) & ((c < 0) | (c > 1 + 1e-9)))
    if bad.size:
        k = int(bad[0])
        raise FileError(f"{where}: expected a coherence from 0 to 1; point {k + 1} has {c[k]:g}", file=file)
    known = c[np.isfinite(c)]
    if known.size > 2 and (known >= 1).all():
        raise FileError(
            f"{where}: the coherence is 1 at every frequency, as that of one hit without averages is; it is no measure of "
            "noise: leave the column out, or average several hits", file=file
        )  # fmt: skip
