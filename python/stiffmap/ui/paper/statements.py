"""All statements, in the order of the paper."""

from __future__ import annotations

from stiffmap.ui.paper.directions import direction_statements
from stiffmap.ui.paper.forces import force_statements
from stiffmap.ui.paper.machine import machine_statements
from stiffmap.ui.paper.results import Results
from stiffmap.ui.paper.statement import Statement
from stiffmap.ui.paper.workspace import workspace_statements


def all_statements(results: Results) -> list[Statement]:
    """§5.2, then §5.3: table 1, force direction, force size, workspace."""
    return [
        *machine_statements(results),
        *direction_statements(results),
        *force_statements(results),
        *workspace_statements(results),
    ]
