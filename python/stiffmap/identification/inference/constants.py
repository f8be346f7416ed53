"""Every constant of the inference, with its reason."""

from __future__ import annotations

import numpy as np

ODDS = 20.0
"""The one threshold of decisions: a name, an equivalent, a world, the largest of many."""
RARE = 1e-3
"""The one threshold of tests: the same everywhere, something unexplained."""
DEGREES = 4.0
"""Of freedom of heavy tails, as usual."""
NOISE_SD = 0.2
"""Of ln κ: noise is declared to a fifth, with the tail of Cauchy above, since some is ten times as large."""
FEWEST_REPEATS = 5
"""Degrees of freedom from which repeats say how large the noise is, instead of the declaration."""
NUMBERS_SD = 1.5
"""Of ln s: tolerances are known to a factor of four."""
WIDEST = 4.0
"""Of ln variance, in the price of an amplitude: flat over what can matter."""
SIZES = np.geomspace(0.02, 3000.0, 30)
"""Noise, rms: sizes of an effect, from invisible to beyond the range of a sensor."""
STANDS_OUT = 4.0
"""Noise: beyond it heavy tails are asked for."""
SHRINK = 0.1
"""Damping with which Newton steps begin."""
MOST_EFFECTS = 4
"""Effects that are named."""
REFITS = 2
"""Candidates that are fitted anew in a step; effort only."""
EQUAL_SHARE = 1.0
"""Scatter of an effect's strength from block to block, relative, beyond which it has no name."""
TOLERANCES = 2.0
"""Standard uncertainties beyond which a declared number is out of tolerance."""
LARGEST_ERROR = {"m": 0.01, "rad": 0.05}
"""Of a length or an angle: what is off by more was seen when the machine was built."""
ALIKE = 0.99
"""Squared cosine from which a declared number shows the same as an effect."""
