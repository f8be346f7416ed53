"""The application of the paper (§5): its figures, and every quantitative statement of §5.2 and §5.3.

Source: A. Pashkevich, A. Klimchik, S. Briot, D. Chablat, "Performance evaluation of parallel
manipulators for milling application".
"""

from __future__ import annotations

from stiffmap.ui.paper.directions import direction_statements
from stiffmap.ui.paper.forces import force_statements, workspace_statements
from stiffmap.ui.paper.machine import machine_statements
from stiffmap.ui.paper.results import Results, compute
from stiffmap.ui.paper.statement import Statement, StatementVerdict

__all__ = ["Results", "Statement", "StatementVerdict", "all_statements", "compute"]


def all_statements(results: Results) -> list[Statement]:
    """§5.2, then §5.3: table 1, force direction, force size, workspace."""
    return [
        *machine_statements(results),
        *direction_statements(results),
        *force_statements(results),
        *workspace_statements(results),
    ]
