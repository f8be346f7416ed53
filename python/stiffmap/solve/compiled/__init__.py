"""The seam to the C++ core: the only package that imports `stiffmap._core`."""

from stiffmap.solve.compiled.machine import Answer, CompiledMachine, kernel_levels, multipliers
from stiffmap.solve.compiled.names import Names, Role
from stiffmap.solve.status import Flag, Status, counted

__all__ = [
    "Answer",
    "CompiledMachine",
    "Flag",
    "Names",
    "Role",
    "Status",
    "counted",
    "kernel_levels",
    "multipliers",
]
