"""How a pose ended, and what else is to be known of it."""

from __future__ import annotations

from enum import IntEnum, IntFlag

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.broadcasting import real_number


class Status(IntEnum):
    """Status of one pose; failed poses hold NaN as well, UNSTABLE ones the numbers of an equilibrium that gives way (NaN in maps)."""

    CONVERGED = 0
    UNREACHABLE = 1
    SINGULAR = 2
    UNSTABLE = 3
    NOT_CONVERGED = 4


class Flag(IntFlag):
    """Bits in addition to the status; a value with a flag is kept."""

    LEG_SINGULAR = 1 << 0
    FREE_SPIN = 1 << 1
    PLATFORM_SINGULAR = 1 << 2
    INTERNAL_WRENCH_UNDETERMINED = 1 << 3
    CONFIGURATION_UNDETERMINED = 1 << 4
    RIGID_DIRECTION = 1 << 5
    JOINT_LIMIT = 1 << 6
    DRIVE_RANGE = 1 << 7
    DRIVE_FORCE = 1 << 8
    NONCONSERVATIVE = 1 << 9
    BRANCH_UNVERIFIED = 1 << 10
    FREE_PLAY = 1 << 11
    LOAD_STEPPED = 1 << 12
    REFERENCE_PATH = 1 << 13
    GIMBAL_LOCK = 1 << 14
    SLACK = 1 << 15


def counted(status: NDArray[np.uint8]) -> dict[str, int]:
    """Number of poses per status, for those that there are."""
    return {s.name: int((status == s).sum()) for s in Status if (status == s).any()}


def status_of_one(status: NDArray[np.uint8], name: str = "status", what: str = "that of one pose") -> Status:
    """The status of a result of one pose; StiffmapError, which begins with `name`, for one of several."""
    return Status(int(real_number(status, name, what)))
