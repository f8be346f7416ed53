"""Where the measured sets are to be had; none of them is part of stiffmap."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Source:
    """A folder of the data, and the public repository that it comes from."""

    repository: str
    """On GitHub: owner/name."""
    commit: str
    licence: str
    files: str
    """What the folder holds, or what makes it of a clone."""

    def __str__(self) -> str:
        return f"github.com/{self.repository}@{self.commit}, {self.licence}"


CONVERTED = "`python bench/convert_set.py {} CLONE`"
SOURCES = {
    "ur5_tracker": Source("pauljac7700/serial_robots_datasets", "759068d", "MIT", CONVERTED),
    "ipa_ur10_accuracy": Source("christianlandgraf/ipa-robot-accuracy", "507fba6", "MIT", CONVERTED),
    "flsun_v400_delta": Source(
        "fzechert/FLSun-V400",
        "221f53d",
        "CC0 1.0",
        "sessions.csv, heights.csv and distances.csv by hand from the saved blocks of printer-config/*.cfg (613f830, 9ef6cb5, b664043) and "
        "the calibration sheet (435b357); examples/measured_delta_files.py reads them",
    ),
    "cycloidal_actuator_play": Source(
        "JelmerV/Anti-Backlash-Cycloidal-Actuator",
        "5cd956f",
        "CC BY-SA 4.0",
        "tests.csv and torque_ramps.csv by hand from Code/test_data, means over bins of the commanded torque; "
        "examples/measured_actuator_files.py reads them",
    ),
    "franka_board": Source(
        "PhilNad/robot-arm-kinematic-calibration",
        "6e0292a",
        "MIT",
        "poses.csv by hand from Examples/calib_data.pickle; bench/measured.py reads it",
    ),
    "ball_in_socket": Source("platonics-delft/kinematics_calibration", "05a05ab", "MIT", CONVERTED),
}
"""By the folder's name."""


def absent(folder: str) -> str:
    """What is missing, where it is to be had, and what makes it."""
    s = SOURCES[folder]
    return f"no folder {folder} among the data: {s}; {s.files.format(folder)}"
