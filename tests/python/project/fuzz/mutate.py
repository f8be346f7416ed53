"""Mutations of text files: bytes, tokens, lines and numbers, and text from scratch."""

from __future__ import annotations

import random
import re

WORDS = [
    "0", "-0.0", "1e308", "-1e308", "1e-320", ".nan", "-.inf", "NaN", "inf", "1e999", "9" * 400, "0x10", "1_000", "true", "null",
    "~", "''", '"', "[]", "{}", "[[", "{{", "]", "}", "&a", "*a", "*b", "<<: *a", "!!python/object:os.system", "!!float x", "? ",
    "---", "...", "- ", ": ", "#", "|", ">", "%YAML 1.1", "\t", "\r\n", "\x00", "\x85", "\ufeff", "\ud7ff", "é", "𝕩", ",", ";", "\n\n",
    "deg", "mm", "m", "rad", "kg", "x", "y", "z", "actuator", "legs", "x.bar_low.bar", "../..", "/dev/null", "~root", "${HOME}",
]  # fmt: skip
NUMBER = re.compile(r"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")


def mutated(rng: random.Random, text: str, times: int) -> str:
    """The text after some mutations."""
    for _ in range(times):
        text = rng.choice(KINDS)(rng, text)
    return text


def scratch(rng: random.Random, text: str) -> str:
    """Words of a file and of our own in any order."""
    words = WORDS + re.findall(r"[\w.]+|[^\w\s]|\n +|\n", text)
    return "".join(rng.choice(words) + rng.choice(("", "", " ", "\n")) for _ in range(rng.randrange(80)))


def _number(rng: random.Random, text: str) -> str:
    found = list(NUMBER.finditer(text))
    if not found:
        return text
    m = rng.choice(found)
    new = rng.choice((rng.choice(WORDS), str(-float(m[0])), str(float(m[0]) * 10 ** rng.uniform(-9, 9)), "0"))
    return text[: m.start()] + new + text[m.end() :]


def _word(rng: random.Random, text: str) -> str:
    at = rng.randrange(len(text) + 1)
    return text[:at] + rng.choice(WORDS) + text[at:]


def _cut(rng: random.Random, text: str) -> str:
    a, b = sorted(rng.randrange(len(text) + 1) for _ in range(2))
    return text[:a] + text[min(b, a + rng.choice((1, 3, 30, 3000))) :]


def _character(rng: random.Random, text: str) -> str:
    if not text:
        return text
    at = rng.randrange(len(text))
    return text[:at] + chr(rng.choice((rng.randrange(32, 127), rng.randrange(0x250)))) + text[at + 1 :]


def _line(rng: random.Random, text: str) -> str:
    lines = text.split("\n")
    a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
    how = rng.randrange(4)
    if how == 0:
        del lines[a]
    elif how == 1:
        lines.insert(a, lines[b])
    elif how == 2:
        lines[a], lines[b] = lines[b], lines[a]
    else:
        lines[a] = rng.choice(("  ", " ", "- ")) + lines[a]
    return "\n".join(lines)


def _repeat(rng: random.Random, text: str) -> str:
    a = rng.randrange(len(text) + 1)
    piece = text[a : a + rng.choice((1, 2, 20))]
    return text[:a] + piece * rng.choice((2, 50, 6000)) + text[a:]


KINDS = (_number, _number, _number, _word, _cut, _character, _line, _line, _repeat)
