"""What `stiffmap.diagnose` returns: the findings, in words and as a report."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from html import escape
from os import PathLike

from stiffmap.common.from_above import from_above
from stiffmap.common.html import titled
from stiffmap.common.short import short_repr
from stiffmap.identification.diagnosis.report.findings import Findings
from stiffmap.identification.diagnosis.report.sentences import next_step, opening
from stiffmap.identification.diagnosis.report.wording import five_lines


@short_repr
@dataclass(frozen=True, eq=False)
class Diagnosis(Findings):
    """What a diagnosis found; every number in SI, base axes. Printed, it is the verdict in five lines."""

    def lines(self) -> list[str]:
        """The verdict in five lines."""
        return five_lines(self)

    def report(
        self,
        path: str | PathLike[str],
        *,
        date: str | None = None,
        inputs: Iterable[str | PathLike[str]] = (),
    ) -> None:
        """Write one self-contained HTML file. ``date`` (the caller's, as text) and digests of the files or folders
        ``inputs`` stand under its provenance."""
        from_above("Diagnosis.report")(self, path, date=date, inputs=inputs)

    def _repr_html_(self) -> str:
        lines = "".join(f"<li>{escape(line)}</li>" for line in self.lines())
        return titled(opening(self), f"<p>{escape(next_step(self))}</p><ul>{lines}</ul>")

    def __str__(self) -> str:
        return "\n".join(self.lines())
