"""What is left over time: drift, creep and warming are smooth courses that do not depend on the machine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.experiment.noise.whitening import LinearProblem, basis

SELDOM = 1e-4
"""p-value below which what is left goes with time."""
FEWEST = 12
"""Rows of a set-up over which a course is distinguished from noise."""
SETTLING = 5.0
"""Time constants of a set-up that settles, within the session."""


@dataclass(frozen=True)
class OverTime:
    """Of whitened residuals."""

    p: float
    """Of such a course if rows were independent."""
    size: float
    """rms of the course over that of the rest."""
    clock: str
    """``hours``, ``temperature`` or ``order``: what the rows have."""

    @property
    def moves(self) -> bool:
        """Whether what is left goes with time."""
        return self.p < SELDOM

    def __str__(self) -> str:
        if self.moves:
            return (
                f"what is left goes with time ({self.clock}; {self.size:.2g} times the rest, p = {self.p:.1g}): drift, creep or "
                "warming of the instrument or of the machine, or noise that goes on from row to row"
            )
        return f"over time ({self.clock}) what is left shows no drift, creep or warming (p = {self.p:.2g})"


def over_time(problem: LinearProblem, residual: Floats) -> OverTime | None:
    """Of a residual (N,), whitened; None where no times were recorded or there are too few rows. By an F-test: noise may have
    any size."""
    q = courses(problem)
    freedom = problem.freedom - q.shape[1]
    if not q.shape[1] or freedom < FEWEST:
        return None
    gain = float(np.sum((q.T @ residual) ** 2))
    rest = float(residual @ residual) - gain
    p = float(fdtrc(q.shape[1], freedom, (gain / q.shape[1]) / max(rest / freedom, 1e-300)))
    return OverTime(p, float(np.sqrt(gain / max(rest, 1e-300))), _clock(problem.experiment)[0])


def courses(problem: LinearProblem) -> Floats:
    """(N, k) orthonormal courses, whitened: linear, quadratic, cubic, settling, and with the temperature where it is recorded;
    each set-up and channel has its own."""
    e = problem.experiment
    name, t = _clock(e)
    columns = []
    for run in np.unique(e.runs) if name else ():
        here = e.runs == run
        if here.sum() < FEWEST or not np.ptp(t[here]) > 0.0:
            continue
        s = (t[here] - t[here].min()) / np.ptp(t[here])
        waves = [s, s**2, s**3, np.exp(-SETTLING * s)]
        if e.temperature is not None and np.ptp(e.temperature[here]) > 0.0:
            waves.append(e.temperature[here] - e.temperature[here].mean())
        for c in np.flatnonzero(e.axis_read):
            for w in waves:
                column = np.zeros(e.reading.shape)
                column[here, c] = w - w.mean()
                columns.append(problem.white(column))
    return basis(np.column_stack(columns)) if columns else np.zeros((len(problem), 0))


def _clock(e: Experiment) -> tuple[str, Floats]:
    for name in ("hours", "order"):
        t = getattr(e, name)
        if t is not None and np.isfinite(t).all():
            return name, np.asarray(t, dtype=float)
    return "", np.zeros(len(e))
