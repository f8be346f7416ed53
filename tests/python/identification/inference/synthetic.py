"""Columns without a machine: random parts of known covariance."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from stiffmap.experiment.channels import Channel
from stiffmap.identification.inference.columns import Columns, across
from stiffmap.identification.inference.parts import Part

READINGS, FREE = 40, 3
CHANNELS = (Channel("dx", "m"), Channel("rx", "rad"))


def columns(rng: np.random.Generator, residual: np.ndarray | None = None, repeats: float = 0.0) -> Columns:
    """40 readings of which three directions are unknown frames."""
    taken = np.linalg.qr(rng.normal(size=(READINGS, READINGS)))[0][:, :FREE]
    m = READINGS - FREE
    zero = rng.normal(size=(m, 2))
    lengths: Any = SimpleNamespace(channels=CHANNELS)
    return Columns(
        experiment=lengths,
        rows=np.arange(READINGS),
        channel=np.zeros(READINGS, dtype=np.intp),
        sigma=np.ones(READINGS),
        free=across(taken),
        frames=np.zeros((READINGS, 0)),
        residual=rng.normal(size=m) * 2.0 if residual is None else residual,
        zero=0.1 * zero @ zero.T,
        unknowns=(),
        numbers=np.zeros((m, 0)),
        gaps=(),
        places=(),
        use=np.arange(READINGS),
        travel=(),
        repeats=(repeats * 10.0, 10.0 if repeats else 0.0),
    )


def parts(rng: np.random.Generator, m: int = READINGS - FREE) -> tuple[Part, ...]:
    """Numbers, a smooth gap and an effect of two directions."""
    x = rng.uniform(-1, 1, m)
    smooth = np.exp(-0.5 * (x[:, None] - x) ** 2 / 0.3)
    u = np.linalg.qr(rng.normal(size=(m, 2)))[0] * np.sqrt(m / 2)
    d = rng.normal(size=(m, 4))
    return (
        Part("numbers", "number", d),
        Part("gap", "field", full=smooth),
        Part("effect", "effect", factor=u),
    )
