"""The application of the paper (§5): its figures, and every quantitative statement of §5.2 and §5.3.

Source: A. Pashkevich, A. Klimchik, S. Briot, D. Chablat, "Performance evaluation of parallel
manipulators for milling application".
"""

from stiffmap.ui.paper.results import Results, compute
from stiffmap.ui.paper.statement import Statement, Verdict
from stiffmap.ui.paper.statements import all_statements

__all__ = ["Results", "Statement", "Verdict", "all_statements", "compute"]
