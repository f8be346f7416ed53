"""Tables of poses (CSV), one convention for all commands: every column with its unit in the header.

``x [mm]`` or ``x_mm``; x, y, z the commanded TCP, rx, ry, rz its rotation vector from home, fx … mz the wrench on the tool, t the
time, feed the speed along the path. Order and case are free; common/tables/named.py says what else is read. docs/machine_files.md lists the columns.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.tables.named import Known, NamedTable, read_named

COLUMNS = {
    **dict.fromkeys(("x", "y", "z"), "m"),
    **dict.fromkeys(("rx", "ry", "rz"), "rad"),
    **dict.fromkeys(("fx", "fy", "fz"), "N"),
    **dict.fromkeys(("mx", "my", "mz"), "N*m"),
    "t": "s",
    "feed": "m/s",
}
USUAL = {"m": "mm", "m/s": "mm/min", "rad": "deg"}
KNOWN = Known(COLUMNS, {n: f"{n} [{USUAL.get(si, si)}]" for n, si in COLUMNS.items()}, {"time": "t"})


class PoseTable(NamedTable):
    """Columns (n,) in SI by name, and the line of each row in the file."""

    @property
    def position(self) -> Floats:
        """(n, 3) m."""
        return self.block("xyz")

    @property
    def wrench(self) -> Floats:
        """(n, 6) N, N·m; zero where there is no column."""
        return self.block(("fx", "fy", "fz", "mx", "my", "mz"))

    @property
    def loaded(self) -> bool:
        """Whether a column is a force or a moment."""
        return any(c in self.values for c in ("fx", "fy", "fz", "mx", "my", "mz"))

    def rotation(self, home: Floats) -> Floats | None:
        """(n, 3, 3) commanded orientations, turned from `home` about base axes; None: as at home."""
        if not {"rx", "ry", "rz"} & set(self.values):
            return None
        from scipy.spatial.transform import Rotation

        turns: Floats = Rotation.from_rotvec(self.block(("rx", "ry", "rz"))).as_matrix()
        return turns @ home


def read_pose_table(place: Path, *, at_home: Floats | None = None) -> PoseTable:
    """The table of a CSV file.

    `at_home` (3,) m stands in for x, y or z that have no column, along which a planar machine is not commanded; None: all three
    are wanted. Raises FileError naming file, line, column, what was expected and what was found.
    """
    table = PoseTable(**vars(read_named(place, KNOWN)))
    missing = [c for c in "xyz" if c not in table.values]
    if missing and (at_home is None or len(missing) == 3):
        table.fail(
            f"no column {', '.join(missing)}; expected x [mm], y [mm], z [mm] and perhaps "
            "t [s], feed [mm/min], fx [N], fy [N], fz [N]"
        )
    for c in missing:
        assert at_home is not None  # refused before
        table.values[c] = np.full(len(table.lines), at_home["xyz".index(c)])
    return table
