"""Columns of data.csv, each declared once: which are read and written together, and what quantity their units are of.

Reading, writing, the units that a header may name and the keys of ``units`` and ``noise`` follow from it.
"""

from __future__ import annotations

from stiffmap.common.units import QUANTITIES as by_unit
from stiffmap.experiment.channels import AXES
from stiffmap.experiment.experiment import ASKED, WRENCH
from stiffmap.experiment.readings import kinds

WORDS = {
    "id": "ids",
    "branch": "branch",
    "setup": "setup",
    "instrument": "instrument",
    "target": "target",
    "point": "points",
    "load_point": "load_points",
}
"""Columns of words, and the fields of an `Experiment` that hold them."""
COUNTED = ("repeat", "order", "hours", "temperature")
"""Columns of numbers that are fields of an `Experiment` by the same names."""
POSE, POSE2 = ("x", "y", "z"), ("x2", "y2", "z2")
APPROACH = ("approach_x", "approach_y", "approach_z")
SEEN, SEEN_TURNED, SEEN_QUATERNION = ("px", "py", "pz"), ("prx", "pry", "prz"), ("pqx", "pqy", "pqz", "pqw")
READ = dict(zip((*SEEN, *SEEN_TURNED), AXES, strict=True))
"""Columns of places and turns that were seen -> their readings."""
VECTOR = ("rotx", "roty", "rotz")
QUATERNION = ("qw", "qx", "qy", "qz")
EULER = ("euler1", "euler2", "euler3")
MATRIX = tuple(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))
FORMS = (VECTOR, QUATERNION, EULER, MATRIX)
"""Of an orientation."""
TURNED = tuple(c for form in FORMS for c in form)
TURNED2 = tuple(f"{c}2" if form is not MATRIX else f"{c}_2" for form in FORMS for c in form)
PLAN = (*WORDS, *POSE, *TURNED, *POSE2, *TURNED2, *APPROACH, *WRENCH, *ASKED, *COUNTED)
"""Columns of a plan: all but readings."""

QUANTITIES = {
    **dict.fromkeys((*POSE, *POSE2, *AXES[:3], *SEEN), "length"),
    **dict.fromkeys((*VECTOR, *EULER, *AXES[3:], *SEEN_TURNED), "angle"),
    **dict.fromkeys((f"{c}2" for c in (*VECTOR, *EULER)), "angle"),
    **dict.fromkeys(WRENCH[:3], "force"),
    **dict.fromkeys(WRENCH[3:], "moment"),
    "temperature": "temperature",
}
DECLARED = (*POSE, *POSE2, *AXES, *VECTOR, *WRENCH)
"""Columns whose unit experiment.yaml may declare, in addition to kinds of readings."""


def quantity_of(column: str) -> str | None:
    """Quantity of a column, of its standard deviation or of its commanded value; None for words and plain numbers."""
    base = base_of(column)
    return QUANTITIES.get(base) or {k.name: by_unit[k.unit] for k in kinds()}.get(base)


def base_of(column: str) -> str:
    """The column in whose unit another one is: a standard deviation, a commanded value, a reading in coordinates of its own."""
    base = column.removeprefix("u_").removesuffix("_cmd")
    return {k.absolute: k.name for k in kinds() if k.absolute}.get(base, base)


def read() -> tuple[str, ...]:
    """Columns of readings, measured minus commanded."""
    return (*AXES, *(k.name for k in kinds()))


def absolute() -> tuple[str, ...]:
    """Columns of readings in coordinates of their own."""
    return (*SEEN, *SEEN_TURNED, *SEEN_QUATERNION, *(k.absolute for k in kinds() if k.absolute))


def known() -> tuple[str, ...]:
    """All columns that have a meaning."""
    return (*PLAN, *read(), *(f"u_{a}" for a in read()), *absolute())
