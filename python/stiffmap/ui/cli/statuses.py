"""How failed poses are reported."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from rich.text import Text

from stiffmap.solve.compiled import Status, counted

MEANINGS = {
    "UNREACHABLE": "the joints cannot get there, or a limit forbids it",
    "SINGULAR": "the machine can move freely there",
    "UNSTABLE": "it gives way before the whole load acts; a slender rod between balls in one piece does so "
    "early: docs/machine_files.md",
    "NOT_CONVERGED": "no equilibrium was found under the whole load",
}


def failed(status: NDArray[np.uint8]) -> dict[str, int]:
    """Number of poses per status but CONVERGED."""
    return {name: n for name, n in counted(status).items() if name != Status.CONVERGED.name}


def failed_in_words(failed: Mapping[str, int], what: str = "poses") -> list[Text]:
    """``12 poses: UNSTABLE (…)``, a line per status."""
    return [Text(f"{count} {what}: {name} ({MEANINGS[name]})", "yellow") for name, count in failed.items()]
