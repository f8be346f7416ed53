"""The one place that writes files: whole or not at all, one job at a time, space asked for before."""

from stiffmap.outputs.alone import only_job, reserved
from stiffmap.outputs.pictures import write_picture
from stiffmap.outputs.space import mapped_array, needs_space
from stiffmap.outputs.tables import guarded, unguarded, write_rows
from stiffmap.outputs.writing import (
    add_lines,
    make_folder,
    put_files,
    put_folder,
    synced,
    write_text,
    writing,
)

__all__ = [
    "add_lines",
    "guarded",
    "make_folder",
    "mapped_array",
    "needs_space",
    "only_job",
    "put_files",
    "put_folder",
    "reserved",
    "synced",
    "unguarded",
    "write_picture",
    "write_rows",
    "write_text",
    "writing",
]
