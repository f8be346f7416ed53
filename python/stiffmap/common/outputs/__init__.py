"""The one place that writes files: whole or not at all, one job at a time, space asked for before."""

from stiffmap.common.outputs.alone import only_job, reserved
from stiffmap.common.outputs.keeping import asked_to_replace, new_file, one_command
from stiffmap.common.outputs.tables import guarded, number_cells, unguarded, write_rows
from stiffmap.common.outputs.writing import (
    add_lines,
    bytes_text,
    make_folder,
    mapped_array,
    needs_space,
    put_folder,
    putting,
    write_picture,
    write_text,
    writing,
)

__all__ = [
    "add_lines",
    "asked_to_replace",
    "bytes_text",
    "guarded",
    "make_folder",
    "mapped_array",
    "needs_space",
    "new_file",
    "number_cells",
    "one_command",
    "only_job",
    "put_folder",
    "putting",
    "reserved",
    "unguarded",
    "write_picture",
    "write_rows",
    "write_text",
    "writing",
]
