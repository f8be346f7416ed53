"""A controller for tests, by the rules of LinuxCNC and nothing of stiffmap: it starts where nobody knows and records what it does."""

from __future__ import annotations

import itertools
import re
from math import atan2, cos, hypot, pi, sin

UNKNOWN = (-200.0, 313.0, -71.0)
"""mm: where it was left."""


class Controller:
    """Runs a program in mm; `cuts` are polylines of the moves at feed, `events` what else it did after how many of them."""

    def __init__(
        self,
        text: str,
        offsets: dict[str, tuple[float, ...]] | None = None,
        modes: str = "G19 G91 G93 G90.1 G0",
        skip: bool = False,
    ) -> None:
        self.p = list(UNKNOWN)
        self.unit, self.motion, self.feed = 25.4, "", 0.0
        self.modes = set(modes.split())
        self.offset, self.offsets = "G54", offsets or {}
        self.cuts: list[tuple[list[tuple[float, ...]], float]] = []
        self.events: list[tuple[str, int]] = []
        self.spindle, self.on = "", False
        percents = 0
        for line in text.splitlines():
            line = "".join(re.sub(r"\([^()]*\)|;.*", "", line).upper().split())
            if line == "%":
                percents += 1
                if percents == 2:
                    break
                continue
            if line.startswith("/"):
                if skip:
                    continue
                line = line[1:]
            if self.line(re.findall(r"([A-Z])([-+]?[\d.]+)", line)):
                break

    def group(self, codes: set[str], new: str) -> None:
        self.modes = (self.modes - codes) | {new}

    def line(self, words: list[tuple[str, str]]) -> bool:
        v = {k: float(x) for k, x in words if k not in "GM"}
        g = [f"G{float(x):g}" for k, x in words if k == "G"]
        m = [f"M{float(x):g}" for k, x in words if k == "M"]
        for x in m:
            if x not in ("M0", "M1", "M2", "M30"):
                self.events.append((x, len(self.cuts)))
        if "G4" in g:
            self.events.append(("G4", len(self.cuts)))
        if {"G93", "G94"} & set(g):
            self.feed = 0.0
        for codes in ({"G17", "G18", "G19"}, {"G90", "G91"}, {"G93", "G94"}, {"G90.1", "G91.1"}):
            for x in codes & set(g):
                self.group(codes, x)
        self.feed = v.get("F", self.feed)
        for x in g:
            if x in ("G20", "G21"):
                new = 25.4 if x == "G20" else 1.0
                self.feed *= self.unit / new
                self.unit = new
            if x in ("G54", "G55", "G56"):
                self.offset = x
            if x in ("G0", "G1", "G2", "G3"):
                self.motion = x
        if "G4" not in g and any(a in v for a in "XYZIJKR"):
            self.move(v, "G53" in g)
        for x in m:
            if x in ("M0", "M1", "M2", "M30"):
                self.events.append((x, len(self.cuts)))
        return "M2" in m or "M30" in m

    def move(self, v: dict[str, float], machine: bool) -> None:
        shift = (0, 0, 0) if machine else self.offsets.get(self.offset, (0, 0, 0))
        a, b = tuple(self.p), list(self.p)
        absolute = "G90" in self.modes or machine
        for i, x in enumerate("XYZ"):
            if x in v:
                b[i] = v[x] * self.unit + (1e3 * shift[i] if absolute else self.p[i])
        points = [a, tuple(b)]
        if self.motion in ("G2", "G3"):
            i, j, k = (0, 1, 2) if "G17" in self.modes else (2, 0, 1) if "G18" in self.modes else (1, 2, 0)
            c = [
                v.get("IJK"[n], 0.0) * self.unit + (1e3 * shift[n] if "G90.1" in self.modes else a[n])
                for n in (i, j)
            ]
            if "R" in v:
                r, s = v["R"] * self.unit, 1 if self.motion == "G2" else -1
                d = hypot(b[i] - a[i], b[j] - a[j])
                h = s * (max(r * r - d * d / 4, 0.0)) ** 0.5 * (1 if r > 0 else -1)
                c = [(a[i] + b[i]) / 2 + h * (b[j] - a[j]) / d, (a[j] + b[j]) / 2 - h * (b[i] - a[i]) / d]
            t0, t1 = atan2(a[j] - c[1], a[i] - c[0]), atan2(b[j] - c[1], b[i] - c[0])
            sense = 1 if self.motion == "G3" else -1
            turn = (sense * (t1 - t0)) % (2 * pi)
            turn = (2 * pi if turn < 1e-9 else turn) + 2 * pi * (v.get("P", 1.0) - 1)
            r = hypot(a[i] - c[0], a[j] - c[1])
            points = []
            for q in range(101):
                p = [0.0, 0.0, 0.0]
                t = t0 + sense * turn * q / 100
                p[i], p[j], p[k] = c[0] + r * cos(t), c[1] + r * sin(t), a[k] + (b[k] - a[k]) * q / 100
                points.append(tuple(p))
        self.p = b
        if self.motion != "G0":
            size = sum(
                sum((x - y) ** 2 for x, y in zip(p, q, strict=True)) ** 0.5
                for p, q in itertools.pairwise(points)
            )
            self.cuts.append((points, self.feed * size if "G93" in self.modes else self.feed * self.unit))

    @property
    def length(self) -> float:
        """mm at feed."""
        return sum(
            sum((x - y) ** 2 for x, y in zip(p, q, strict=True)) ** 0.5
            for c, _ in self.cuts
            for p, q in itertools.pairwise(c)
        )

    @property
    def way(self) -> list[tuple[float, ...]]:
        """Points of all moves at feed, mm."""
        return [p for c, _ in self.cuts for p in c]
