"""Values to try for parameters that mean nothing while the effect is absent, as a knee.

The sensitivities at the null are taken once for each; the fit goes on from the best of them.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stiffmap.diagnosis.candidates.candidates import Candidate
from stiffmap.experiment.prediction.predict import Predictor

Shape = tuple[tuple[str, float], ...]
KNEES = (0.1, 0.25, 0.5, 0.8)
"""Shares of the largest load at which a drive's compliance may change."""


def shapes(candidate: Candidate, predictor: Predictor) -> Iterator[Shape]:
    """Shapes of a candidate; the empty one where all parameters have a null."""
    if not candidate.shape:
        yield ()
    elif candidate.kind == "bilinear":
        yield from _knees(candidate, predictor)


def _knees(candidate: Candidate, predictor: Predictor) -> Iterator[Shape]:
    part = slice(3, 6) if candidate.shape[0].unit == "N·m" else slice(0, 3)
    largest = float(np.abs(predictor.experiment.wrench[:, part]).max())
    for share in KNEES if largest > 0.0 else ():
        yield (("knee", share * largest),)
