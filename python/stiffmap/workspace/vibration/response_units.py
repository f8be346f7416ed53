"""Units of measured responses as analysers write them: m/s2, g/N, (1/N)*(m/s2), mm/s^2, lbf."""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from stiffmap.common.units import FORCES, GRAVITY, LENGTHS, POUND


class ResponseUnit(NamedTuple):
    """Size in SI and exponents of length, force and time; angles are numbers, in radians."""

    size: float = 1.0
    length: int = 0
    force: int = 0
    time: int = 0

    def over(self, other: ResponseUnit, exponent: int = 1) -> ResponseUnit:
        """This unit divided by ``other`` to a power."""
        a, b = self[1:], other[1:]
        left = [p - exponent * q for p, q in zip(a, b, strict=True)]
        return ResponseUnit(self.size / other.size**exponent, *left)


UNITS = {
    "1": ResponseUnit(),
    **{name: ResponseUnit(float(size), length=1) for name, size in LENGTHS.items()},
    **{name: ResponseUnit(float(size), force=1) for name, size in FORCES.items()},
    **{name: ResponseUnit(size, length=1) for name, size in {"nm": 1e-9, "mil": 2.54e-5, "mils": 2.54e-5, "ft": 0.3048}.items()},
    "ips": ResponseUnit(0.0254, length=1, time=-1),
    **{name: ResponseUnit(float(POUND), force=1) for name in ("lbf", "lb", "lbs")},
    **{name: ResponseUnit(float(GRAVITY), force=1) for name in ("kgf", "kp")},
    "mN": ResponseUnit(1e-3, force=1),
    "Nm": ResponseUnit(length=1, force=1),
    "kg": ResponseUnit(length=-1, force=1, time=2),
    **{name: ResponseUnit(float(GRAVITY), length=1, time=-2) for name in ("g", "gn", "g_n", "g's")},
    **{name: ResponseUnit(time=1) for name in ("s", "sec")},
    "ms": ResponseUnit(1e-3, time=1),
    "rad": ResponseUnit(),
    "mrad": ResponseUnit(1e-3),
    "deg": ResponseUnit(math.pi / 180),
}  # fmt: skip
SPELLINGS = {
    "µ": "u", "μ": "u", "·": "*", "×": "*", ".": "*", "²": "^2", "⁻¹": "^-1", "⁻²": "^-2", "**": "^", "inch": "in", "_per_": "/", " per ": "/",
}  # fmt: skip
UNREADABLE = "\ufffd"  # what a reader of UTF-8 makes of µ and ² in another encoding
LONGEST = 80  # characters
TOKEN = re.compile(r"\s*([A-Za-z_]+(?:'s)?|\^?-?\d+|[*/()])")


def response_unit(text: str) -> ResponseUnit | None:
    """The unit that a text says, in whatever order; None where it says none that is known."""
    text = re.sub(f"{UNREADABLE}(?=m)", "u", re.sub(rf"(?<=s|c){UNREADABLE}", "^2", text))
    for written, ours in SPELLINGS.items():
        text = text.replace(written, ours)
    tokens, at = [], 0
    text = text.rstrip()
    while at < len(text) <= LONGEST:
        match = TOKEN.match(text, at)
        if match is None:
            return None
        tokens.append(match[1])
        at = match.end()
    try:
        unit = _product(tokens)
    except (KeyError, IndexError, ValueError):
        return None
    return None if tokens else unit


def _product(tokens: list[str]) -> ResponseUnit:
    """Units that are multiplied and divided from left to right, up to the end or a closing parenthesis."""
    unit, sign = _power(tokens), -1
    while tokens and tokens[0] != ")":
        sign = {"*": -1, "/": 1}.get(tokens[0], 0)
        if sign:
            tokens.pop(0)
        unit = unit.over(_power(tokens), sign or -1)
    return unit


def _power(tokens: list[str]) -> ResponseUnit:
    word = tokens.pop(0)
    if word == "(":
        unit = _product(tokens)
        tokens.pop(0)
    else:
        unit = _named(word)
    if tokens and re.fullmatch(r"\^?-?\d", tokens[0]):
        unit = ResponseUnit().over(unit, -int(tokens.pop(0).lstrip("^")))
    return unit


def _named(word: str) -> ResponseUnit:
    """By its name, or in other capitals where these leave no choice: MM and KN, but neither mN nor MN for Mn."""
    if word in UNITS:
        return UNITS[word]
    (only,) = {unit for name, unit in UNITS.items() if name.lower() == word.lower()} or {UNITS[word]}
    return only
