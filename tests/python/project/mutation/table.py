"""Which tests judge which room first: a mutant that they miss meets all others where `--wide` is given."""

from __future__ import annotations

import re
from pathlib import Path

TESTS = Path(__file__).parents[2]
CORE = (
    "solve",
    "solve/compiled",
    "model/machines",
    "workspace/performance",
    "model/effects",
    "workspace/maps",
)
OTHERS = ("solve", "model/files", "model/machines", "solve/compiled")
BELOW = ("common", "model", "solve")
"""Rooms that tests of `OTHERS` reach; what lies above them they do not import."""
#: Not of a machine's numbers, or slow for what they say of them.
NEVER = {"project", "project/docs", "project/fuzz", "project/mutation"}


def folders(file: str) -> tuple[str, ...]:
    """The folders of tests for one source, the nearest first: its package, the other packages of its room."""
    if file.startswith("cpp/"):
        return CORE
    room, package, *_ = Path(file.removesuffix(".py")).parts[2:]
    whole = sorted(p.parent.relative_to(TESTS).as_posix() for p in (TESTS / room).rglob("test_*.py"))
    near = (f"{room}/{package}", room, *whole, *(OTHERS if room in BELOW else ()))
    return tuple(dict.fromkeys(f for f in near if any((TESTS / f).glob("test_*.py"))))


def all_folders(file: str) -> tuple[str, ...]:
    """Those, then all others."""
    near = folders(file)
    rest = sorted({p.parent.relative_to(TESTS).as_posix() for p in TESTS.rglob("test_*.py")})
    return near + tuple(f for f in rest if f not in near and f not in NEVER)


def test_files(file: str, source: str, start: int, chosen: tuple[str, ...]) -> list[str]:
    """Test files of these folders, of the other packages of its room those that name its own; those first that name the
    function or the module of the mutant, shortest first."""
    functions = re.findall(r"^\s*(?:def|class) (\w+)", source[:start], flags=re.MULTILINE)
    names = {Path(file).stem, *functions[-1:]}
    room, package = Path(file.removesuffix(".py")).parts[2:4] if file.startswith("python/") else ("", "")
    near = chosen == folders(file)
    found = []
    for rank, folder in enumerate(chosen):
        for path in sorted((TESTS / folder).glob("test_*.py")):
            text = path.read_text(encoding="utf-8")
            if near and rank and folder.startswith(f"{room}/") and package not in text:
                continue
            named = sum(
                bool(re.search(rf"(?<![a-zA-Z]){re.escape(n.strip('_'))}(?![a-zA-Z])", text)) for n in names
            )
            found.append((-named, rank, len(text), str(path)))
    return [path for *_, path in sorted(found)]
