"""Standard uncertainties that a machine file gives for its numbers, as those of the unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stiffmap.experiment.experiment import Floats
from stiffmap.model.description import Joint, MachineDescription, Offset, Spring

Run = Sequence[tuple[str, Offset]]
"""Offsets that follow each other, with their full names."""


@dataclass(frozen=True)
class Declared:
    """What the file says, by full name and field, SI."""

    given: dict[str, float]

    @staticmethod
    def of(description: MachineDescription) -> Declared:
        """Of a machine without its effects."""
        return Declared({k: u for k, u in description.uncertainty if u > 0.0})

    def mass(self, name: str, mass: float, default: float) -> float:
        """Relative."""
        u = self.given.get(f"{name}/mass")
        return u / mass if u else default

    def law(self, name: str, joint: Joint, default: float) -> float:
        """Relative, of a joint's compliance."""
        assert joint.law is not None
        u = self.given.get(f"{name}/stiffness", self.given.get(f"{name}/law.stiffness"))
        return u / joint.law.stiffness if u else default

    def spring(self, name: str, spring: Spring, default: float) -> float:
        """Relative, of a 6x6 spring as a whole: the widest of the entries that have an uncertainty."""
        word, matrix = (
            ("compliance", spring.compliance) if spring.compliance else ("stiffness", spring.stiffness)
        )
        found = [
            u / abs(matrix[i][j])
            for i in range(6)
            for j in range(i, 6)
            if matrix is not None
            and (u := self.given.get(f"{name}/{word}.k{i + 1}{j + 1}")) is not None
            and matrix[i][j] != 0.0
        ]
        return max(found, default=default)

    def zero(self, name: str, default: float) -> float:
        """Of a drive: of its home, or of the offset that its command errors have already."""
        return self.given.get(f"{name}/home", self.given.get(f"{name}/command_errors.offset", default))

    def gain(self, name: str, default: float) -> float:
        """Of a drive: of the slope that its command errors have already."""
        return self.given.get(f"{name}/command_errors.slope", default)

    def length(self, names: Sequence[str], offset: Offset) -> float | None:
        """Of an offset along itself, mean of those of `names` (independent of each other); None: not given."""
        way = offset.nominal.p / np.linalg.norm(offset.nominal.p)
        each = []
        for name in names:
            u = np.array([self.given.get(f"{name}/translation.{c}", 0.0) for c in "xyz"])
            each.append(float(np.linalg.norm(way * u)))
        return float(np.sqrt(np.mean(np.square(each)))) if all(v > 0.0 for v in each) else None

    def position(self, run: Run, default: float) -> Floats:
        """(3,) of the place of the frame behind a run of offsets, along its own axes.

        Components with an uncertainty add in squares; directions that none of them covers have the default.
        """
        turn = np.eye(3)
        variance, covered = np.zeros(3), np.zeros(3)
        for name, offset in reversed(run):
            turn = offset.nominal.r @ turn
            for c in range(3):
                u = self.given.get(f"{name}/translation.{'xyz'[c]}")
                if u is not None:
                    variance += (turn[c] * u) ** 2
                    covered += turn[c] ** 2
        return np.asarray(np.sqrt(variance + default**2 * np.clip(1.0 - covered, 0.0, 1.0)))
