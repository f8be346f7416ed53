"""What the effects of a measurement do to the wrench that acts and to what is read."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.model.description import AppliedEffect
from stiffmap.model.effects import registry


def true_wrench(experiment: Experiment, terms: Iterable[AppliedEffect]) -> Floats:
    """(n, 6) the wrench that acts, from the one that was noted."""
    w = experiment.wrench
    for term in terms:
        load = registry.get(term.kind).load
        w = w if load is None else load(w, experiment, term)
    return w


def readings(experiment: Experiment, motion: Floats, terms: Sequence[AppliedEffect]) -> Floats:
    """(n, c) what the instruments show for the true `motion` (n, c). A motor stands, unless an effect says that part
    of its drive yields before the encoder."""
    seen = np.array([0.0 if c.side == "motor" else 1.0 for c in experiment.channels])
    out: Floats = motion * seen
    for term in terms:
        reading = registry.get(term.kind).reading
        out = out if reading is None else reading(out, motion, experiment, term)
    return out
