"""Programs as people and post-processors write them, made at random: units, relative words, arcs by centre and radius in three
planes, work offsets, stops, dwell, coolant, remarks, numbered lines, blanks and lower case."""

from __future__ import annotations

import random
from math import cos, hypot, pi, sin


class Program:
    """`text` of one seed, in which every cut stays within 150 mm of the origin and is longer than 2 mm."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)
        self.p, self.unit, self.relative, self.plane = [0.0, 0.0, 0.0], 1.0, False, "G17"
        self.offset, self.shift = "G54", (0.0, 0.0, 0.0)
        self.lines = [
            "%",
            "O0042 (made at random)",
            "G21 G90 G94 G17 G91.1 G54 S18000 M3",
            "G0 Z5",
            "G0 X0 Y0",
            "G0 Z0",
        ]
        self.feed()
        for _ in range(self.rng.randint(6, 14)):
            self.block()
        self.lines += [
            "G90 G0 Z20" if self.unit == 1 else "G90 G0 Z1",
            self.rng.choice(["M2", "M30"]),
            "%",
            "after the end",
        ]
        self.text = "\n".join(self.dressed(i, line) for i, line in enumerate(self.lines)) + "\n"

    def feed(self) -> None:
        self.lines.append(f"F{self.rng.choice([600, 1200.5, 6000]) / self.unit:.5g}")

    def block(self) -> None:
        kind = self.rng.choice(
            ["line", "line", "line", "arc", "arc", "rapid", "unit", "mode", "plane", "offset", "aside"]
        )
        if kind == "line":
            self.words("G1", self.away(), self.stop())
        elif kind == "arc":
            self.arc()
        elif kind == "rapid":
            self.words("G0", [*self.p[:2], 10.0], "")
            self.words("G0", [*self.away()[:2], 10.0], "")
            self.words("G0", [*self.p[:2], 0.0], "")
        elif kind == "unit":
            self.unit = 25.4 if self.unit == 1 else 1.0
            self.lines.append("G20" if self.unit != 1 else "G21")
            self.feed()
        elif kind == "mode":
            self.relative = not self.relative
            self.lines.append("G91" if self.relative else "G90")
        elif kind == "plane":
            self.plane = self.rng.choice(["G17", "G17", "G18", "G19"])
            self.lines.append(self.plane)
        elif kind == "offset":
            self.offset = self.rng.choice(["G54", "G55"])
            self.shift = (0.0, 0.0, 0.0) if self.offset == "G54" else (10.0, -5.0, 1.0)
            self.lines.append(self.offset)
            was, self.relative = self.relative, False
            self.lines.append("G90")
            self.words("G0", [*self.away()[:2], self.p[2]], "", everything=True)
            self.relative = was
            self.lines.append("G91" if was else "G90")
        else:
            self.lines.append(
                self.rng.choice(["G4 P0.25", "M8", "M9", "(a remark; G1 X99)", "", "S17000 M3"])
            )

    def stop(self) -> str:
        return self.rng.choice(["", "", "", "", " M0", " M1", " M8"])

    def away(self) -> list[float]:
        while True:
            to = [self.rng.uniform(0, 100), self.rng.uniform(0, 100), self.rng.choice([0.0, 0.0, -1.0])]
            if hypot(to[0] - self.p[0], to[1] - self.p[1]) > 2:
                return to

    def number(self, axis: int, value: float) -> str:
        said = value - (self.p[axis] if self.relative else self.shift[axis])
        return f"{'XYZ'[axis]}{said / self.unit:.{self.rng.choice([4, 5])}f}"

    def words(self, code: str, to: list[float], more: str, everything: bool = False) -> None:
        moved = [i for i in range(3) if everything or abs(to[i] - self.p[i]) > 1e-9]
        words = [self.number(i, to[i]) for i in moved]
        if words:
            self.lines.append(f"{code} {' '.join(words)}{more}")
            for i in moved:  # as the controller reads the rounded word
                said = float(words[moved.index(i)][1:]) * self.unit
                self.p[i] = said + (self.p[i] if self.relative else self.shift[i])

    def arc(self) -> None:
        first, second = {"G17": (0, 1), "G18": (2, 0), "G19": (1, 2)}[self.plane]
        radius, t0 = self.rng.uniform(5, 20), self.rng.uniform(-pi, pi)
        sense = self.rng.choice([1, -1])
        turn = sense * self.rng.uniform(0.4, 2.8)
        c = [self.p[first] - radius * cos(t0), self.p[second] - radius * sin(t0)]
        to = list(self.p)
        to[first], to[second] = c[0] + radius * cos(t0 + turn), c[1] + radius * sin(t0 + turn)
        code = "G3" if sense > 0 else "G2"
        start = list(self.p)
        if self.rng.random() < 0.4:
            self.words(code, to, f" R{radius / self.unit:.6f}{self.stop()}")
        else:
            centre = [(c[k] - start[i]) / self.unit for k, i in enumerate((first, second))]
            ijk = " ".join(f"{'IJK'[i]}{v:.6f}" for i, v in zip((first, second), centre, strict=True))
            self.words(code, to, f" {ijk}{self.stop()}")

    def dressed(self, number: int, line: str) -> str:
        if line in ("%", "", "after the end") or line.startswith(("O", "(")):
            return line
        line = self.rng.choice(
            [line, line, line.lower(), line.replace(" ", ""), f"{line} (cut)", f"{line} ; cut"]
        )
        return f"N{10 * number} {line}" if self.rng.random() < 0.3 else line
