"""Rows of a tap test from measured frequency responses: poles, damping and flexibilities with their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError
from stiffmap.workspace.vibration.extraction import extract_modes
from stiffmap.workspace.vibration.files import MeasuredResponse, read_responses

AXES = {f"{sign}{a}": (i, 1.0 - 2 * (sign == "-")) for sign in "+-" for i, a in enumerate("xyz")}
REPEATS = {"frequency": 0.002, "ratio": 0.1, "flexibility": 0.05}
"""Standard uncertainty, relative, of what one fit does not see: mounting, hits, calibration of hammer and accelerometer."""
SMALL = 0.01
"""Of the largest flexibility at the pose: what models of small modes may be off by."""
NEAR = 0.05
"""Difference of the logarithms of two frequencies from which on each mode has a shape of its own."""
NOISE = 3.0
"""Standard uncertainties that a shape has at least, or it is noise."""


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

    def axis(self, given: str, own: str, column: str) -> str:
        """Of the accelerometer or the hammer: the table's word, or the end of the file's own."""
        word = given or own.rpartition(" ")[2]
        word = f"+{word}" if word in ("x", "y", "z") else word
        if word not in AXES:
            found = f"'{word}'" if word else "none"
            raise FileError(
                f"expected one of {', '.join(AXES)}; found {found}",
                file=self.file,
                line=self.line,
                key=column,
            )
        return word

    def read(self) -> list[tuple[str, str, MeasuredResponse]]:
        """Axes of accelerometer and hammer, and the response."""
        found = read_responses(self.place)
        points = sorted({r.response.split(" ")[0] for r in found})
        if len(points) > 1:
            raise FileError(
                f"expected responses at one point, the TCP; found points {', '.join(points)}", file=str(self.place)
            )  # fmt: skip
        return [
            (self.axis(self.along, r.response, "along"), self.axis(self.hammer, r.reference, "hammer"), r)
            for r in found
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
