"""The messages that the page of troubleshooting explains are messages of stiffmap."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

from stiffmap import Flag, Status

ROOT = Path(__file__).parents[4]
PAGE = (ROOT / "docs/troubleshooting.md").read_text(encoding="utf-8")
MESSAGES = [m for line in PAGE.splitlines() for m in re.findall(r"^\| (?:verdict )?`([^`]+)`", line)]
SOURCES = "stiffmap"


@cache
def texts() -> list[str]:
    """Every text of the sources, `…` where something is put in."""
    out = []
    for path in (ROOT / "python" / SOURCES).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.JoinedStr):
                parts = (str(v.value) if isinstance(v, ast.Constant) else "…" for v in node.values)
                out.append("".join(parts))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                out.append(node.value)
    return out


NAMES = {s.name for s in Status} | {f.name for f in Flag}


def known(message: str) -> bool:
    """Whether one text holds the parts of a message, in order."""
    pattern = re.compile(".*".join(re.escape(part.strip()) for part in message.split("…")), re.DOTALL)
    return message in NAMES or any(pattern.search(t) for t in texts())


def test_the_messages_exist() -> None:
    assert [m for m in MESSAGES if not known(m)] == []
    assert len(MESSAGES) > 25
    assert not known("this leg is … tired")  # one that nobody writes
