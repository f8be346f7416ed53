"""Which tests judge which room first: a mutant that they miss meets all others where `--wide` is given."""

from __future__ import annotations

import re
from pathlib import Path

TESTS = Path(__file__).parents[1]
CORE = ("core", "fast", "loads", "machines", "performance", "oracle", "effects", "maps")
ROOMS = {
    "calibration": ("calibration",),
    "compensation": ("compensation",),
    "compiled": ("core", "fast"),
    "derivatives": ("fast", "effects"),
    "description": ("files", "machines", "core"),
    "design": ("performance",),
    "diagnosis": ("diagnosis",),
    "effects": ("effects",),
    "experiment": ("experiment", "diagnosis"),
    "files": ("files",),
    "link": ("link",),
    "maps": ("maps", "cli_maps"),
    "performance": ("performance",),
    "planning": ("planning",),
    "urdf": ("urdf",),
    "budget": ("first_hour",),
    "trial": ("first_hour",),
    "beams": ("files", "core"),
}
OTHERS = ("core", "files", "loads", "machines", "first_hour", "fast")
#: Not of a machine's numbers, or slow for what they say of them.
NEVER = {"project", "docs", "fuzz", "mutation"}


def folders(file: str) -> tuple[str, ...]:
    """The folders of tests for one source, the nearest first."""
    if file.startswith("cpp/"):
        return CORE
    return ROOMS.get(Path(file).parts[2].removesuffix(".py"), OTHERS)


def all_folders(file: str) -> tuple[str, ...]:
    """Those, then all others."""
    near = folders(file)
    rest = sorted(p.name for p in TESTS.iterdir() if p.is_dir() and any(p.glob("test_*.py")))
    return near + tuple(f for f in rest if f not in near and f not in NEVER)


def test_files(file: str, source: str, start: int, chosen: tuple[str, ...]) -> list[str]:
    """Test files of these folders; those first that name the function or the module of the mutant, shortest first."""
    functions = re.findall(r"^\s*(?:def|class) (\w+)", source[:start], flags=re.MULTILINE)
    names = {Path(file).stem, *functions[-1:]}
    found = []
    for rank, folder in enumerate(chosen):
        for path in sorted((TESTS / folder).glob("test_*.py")):
            text = path.read_text(encoding="utf-8")
            named = sum(
                bool(re.search(rf"(?<![a-zA-Z]){re.escape(n.strip('_'))}(?![a-zA-Z])", text)) for n in names
            )
            found.append((-named, rank, len(text), str(path)))
    return [path for *_, path in sorted(found)]
