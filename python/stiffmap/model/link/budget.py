"""Total uncertainty of a finite-element link: fit, mesh, node region and boundary condition apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stiffmap.model.link.arrays import Floats


@dataclass(frozen=True)
class Budget:
    """Covariance (36, 36) by source; each systematic source is one common scale on its matrix of shifts."""

    parts: dict[str, Floats]

    @property
    def total(self) -> Floats:
        """(36, 36) sum over the sources."""
        return np.asarray(sum(self.parts.values()))

    def standard_error(self, source: str | None = None) -> Floats:
        """(6, 6) standard uncertainty of one source, or of all."""
        V = self.total if source is None else self.parts[source]
        return np.sqrt(np.maximum(np.diag(V), 0.0)).reshape(6, 6)

    def table(self, compliance: Floats) -> str:
        """Relative standard uncertainty of the diagonal entries, a line per source."""
        size = np.diag(compliance)
        lines = ["source    " + "".join(f"{f'k{i}{i}':>10}" for i in range(1, 7))]
        for source in [*self.parts, None]:
            relative = np.diag(self.standard_error(source)) / size
            lines.append(f"{source or 'total':<10}" + "".join(f"{r:>10.1e}" for r in relative))
        return "\n".join(lines)


def shift_covariance(shifts: list[Floats]) -> Floats:
    """(36, 36) mean square of alternative estimates' deviations (6, 6) from the one that is kept.

    A deviation is a systematic error of unknown size and sign, common to all entries: rank one each.
    """
    if not shifts:
        return np.zeros((36, 36))
    return np.asarray(np.mean([np.outer(s.ravel(), s.ravel()) for s in shifts], axis=0))
