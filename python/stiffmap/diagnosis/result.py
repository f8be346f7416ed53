"""What `stiffmap.diagnose` returns: the findings, in words and as a report."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike

from stiffmap.diagnosis.findings import Findings
from stiffmap.diagnosis.words import five_lines


@dataclass(frozen=True, eq=False)
class Diagnosis(Findings):
    """What a diagnosis found; every number in SI, base axes. Printed, it is the verdict in five lines."""

    def lines(self) -> list[str]:
        """The verdict in five lines."""
        return five_lines(self)

    def report(self, path: str | PathLike[str]) -> None:
        """Write one self-contained HTML file."""
        from stiffmap.diagnosis.report import write_report  # draws, so it loads matplotlib

        write_report(self, path)

    def __str__(self) -> str:
        return "\n".join(self.lines())
