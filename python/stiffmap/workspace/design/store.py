"""Evaluations kept on disk, so that a search that was killed goes on where it was."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError
from stiffmap.common.fingerprints import code, digest, file_digest, named_files
from stiffmap.common.json_text import parse_json
from stiffmap.common.outputs import add_lines
from stiffmap.model.files.shipped import find
from stiffmap.workspace.design.judging import Judged
from stiffmap.workspace.design.problem import DesignProblem


class Evaluations:
    """Judged designs by their exact variables; one line of JSON each, written per generation.

    A search is deterministic, so that replaying it from the start with these answers at hand leads to
    the same state without a single evaluation.
    """

    def __init__(self, design: DesignProblem, path: Path | None) -> None:
        self.path, self.known = path, dict[bytes, Judged]()
        self.mark = fingerprint(design)
        self._sizes = (len(design.model.objectives),), (len(design.constraints),)
        if path is not None and path.exists():
            self._read(path)

    def _read(self, path: Path) -> None:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
        if not lines:
            return
        self._same_design(lines[0], path)
        for line in lines[1:]:
            try:
                row = parse_json(line)
                f, g, x = (np.array(row[k], dtype=float) for k in "fgx")
                if (f.shape, g.shape) != self._sizes:
                    raise ValueError
                self.known[x.tobytes()] = Judged(f, g, dict(row["values"]), str(row["reason"]))
            except (ValueError, KeyError, TypeError, OverflowError):
                continue  # the line at which the process was killed, or a damaged one: judged again

    def _same_design(self, line: str, path: Path) -> None:
        try:
            mark = parse_json(line)["design"]
        except (ValueError, KeyError, TypeError) as error:
            raise FileError(
                "is damaged: expected the mark of the design whose evaluations these are; delete the file, or give "
                "another folder",
                file=str(path),
                line=1,
            ) from error
        if mark != self.mark:
            raise FileError("holds evaluations of another design; give another folder", file=str(path))

    def missing(self, x: Floats) -> list[int]:
        """Rows that nobody judged yet."""
        return [i for i, row in enumerate(x) if row.tobytes() not in self.known]

    def add(self, x: Floats, judged: list[Judged]) -> None:
        """Keep, and write at once."""
        lines: list[dict[str, Any]] = []
        for row, one in zip(x, judged, strict=True):
            self.known[row.tobytes()] = one
            f, g = one.objectives.tolist(), one.violations.tolist()
            lines.append({"x": row.tolist(), "f": f, "g": g, "values": one.values, "reason": one.reason})
        if self.path is None or not lines:
            return
        if not (self.path.exists() and self.path.stat().st_size):
            lines.insert(0, {"design": self.mark})
        add_lines(self.path, [json.dumps(line) for line in lines])

    def get(self, x: Floats) -> Judged:
        """The judgement of one row."""
        return self.known[x.tobytes()]


def fingerprint(design: DesignProblem) -> str:
    """Of everything that the answers depend on: the files as read, those that they name, code."""
    near, beside = Path(design.file).parent, Path(design.machine_file).parent
    return digest(
        design.model.model_dump(),
        design.document.data,
        design.requirements,
        design.constraints,
        named_files(design.model.model_dump(), near),
        named_files(design.document.data, beside),
        [file_digest(find(name)) for name in design.model.beside if not (near / name).is_file()],
        design.toolpath,
        code(),
    )[:16]
