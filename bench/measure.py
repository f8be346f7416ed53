"""Interleaved timing, and rows of the table."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from statistics import median
from typing import Any, NamedTuple


class Stats(NamedTuple):
    """Median, smallest and largest of repeated measurements."""

    median: float
    min: float
    max: float

    @classmethod
    def of(cls, values: list[float]) -> Stats:
        return cls(median(values), min(values), max(values))


def interleaved(works: Mapping[str, tuple[Callable[[], object], int]], rounds: int) -> dict[str, list[float]]:
    """Seconds per item of each work, all of them once per round: a disturbance meets every one of them."""
    times: dict[str, list[float]] = {name: [] for name in works}
    for work, _ in works.values():
        work()
    for _ in range(rounds):
        for name, (work, items) in works.items():
            start = time.perf_counter()
            work()
            times[name].append((time.perf_counter() - start) / items)
    return times


class Row(NamedTuple):
    """One line of the table; no value: it could not be measured, `detail` says why."""

    name: str
    value: Stats | None
    target: float | None
    sense: str
    detail: str

    @classmethod
    def against(
        cls, name: str, times: Mapping[str, list[float]], slow: str, fast: str, target: float, module: Any
    ) -> Row:
        """How many times `fast` is quicker than `slow`, round by round."""
        if slow not in times:
            return cls(name, None, target, ">=", f"left out: {module}")
        ratio = Stats.of([a / b for a, b in zip(times[slow], times[fast], strict=True)])
        figures = [1e6 * median(times[k]) for k in (slow, fast)]
        return cls(name, ratio, target, ">=", f"{figures[0]:.1f} µs / {figures[1]:.2f} µs ({module.NAME})")

    def reached(self) -> str:
        """Verdict on the median."""
        if self.value is None or self.target is None:
            return "-"
        good = self.value.median >= self.target if self.sense == ">=" else self.value.median <= self.target
        return "reached" if good else "MISSED"

    def as_dict(self) -> dict[str, Any]:
        value = self.value._asdict() if self.value else None
        return {"name": self.name, "value": value, "target": self.target, "sense": self.sense,
                "verdict": self.reached(), "detail": self.detail}  # fmt: skip

    @staticmethod
    def table(rows: list[Row]) -> str:
        """All rows as aligned text."""
        lines = [f"{'case':<54}{'median':>9}{'min':>9}{'max':>9}  {'target':<9}{'':<9}"]
        for r in rows:
            values = "".join(f"{v:>9.3g}" for v in r.value) if r.value else f"{'-':>9}" * 3
            target = f"{r.sense} {r.target:g}" if r.target is not None else "-"
            lines.append(f"{r.name:<54}{values}  {target:<9}{r.reached():<9}{r.detail}")
        return "\n".join(lines)
