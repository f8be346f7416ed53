"""The public scoreboard: every measured set that is at hand, what its authors, other packages and stiffmap reach.

    python bench/scoreboard.py --out docs/scoreboard.md
    python bench/scoreboard.py --out board.html --quick
    python bench/scoreboard.py --out docs/scoreboard.md --peer robotkinecal=VENV/bin/python --peer figaroh=VENV/bin/python

Writes the page (Markdown, or HTML where the name ends so) and FILE.json beside it with the same rows: set, authors, before, after,
unseen rows, cause, seconds. Sets that are absent are rows that say so; a set that fails is a row with its message. About ten minutes
of CPU; with --quick, some rows of each set, two. `--page-of FILE.json` writes the page again from rows that were measured before. `--speed` measures speed
beside programs on Pinocchio and adds its table.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

from board.page import markdown, page  # noqa: E402
from board.row import Row  # noqa: E402

DATA = HERE.parent / "measured"
COMMAND = "python bench/scoreboard.py --out docs/scoreboard.md"


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="page: .md or .html")
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the sets [measured]")
    parser.add_argument(
        "--peer", action="append", default=[], metavar="NAME=PYTHON", help="robotkinecal, figaroh"
    )
    parser.add_argument("--quick", action="store_true", help="some rows of each set")
    parser.add_argument(
        "--only",
        action="append",
        metavar="FOLDER",
        help="measure this set, keep the others' rows of FILE.json",
    )
    parser.add_argument("--page-of", type=Path, metavar="JSON", help="only write the page of these rows")
    parser.add_argument(
        "--speed",
        nargs="?",
        const="",
        metavar="PROGRAM",
        help="measure speed only, keep the rows of FILE.json; PROGRAM: bench/peers/pinocchio_vjm.cpp, compiled as it says",
    )
    a = parser.parse_args()
    if bad := [p for p in a.peer if "=" not in p]:
        parser.error(f"--peer: expected NAME=PYTHON, got {bad[0]!r}")
    if a.out.suffix not in (".md", ".html"):
        parser.error(f"--out: expected a name that ends in .md or .html, got {a.out}")
    beside = a.out.with_suffix(".json")
    kept = a.page_of or (beside if beside.exists() else None)
    try:
        before = json.loads(kept.read_text(encoding="utf-8")) if kept else {}
    except (OSError, ValueError) as error:
        parser.error(f"{kept}: {error}")
    if a.page_of or (a.speed is not None and kept):
        data = before
    else:
        peers = dict(p.split("=", 1) for p in a.peer)
        data = measured(a.data, a.quick, peers, a.only, before.get("rows", []))
        data["speed"] = before.get("speed", [])
    if a.speed is not None:
        from board.speed import speed

        data["speed"] = speed(a.speed or None)
    a.out.parent.mkdir(parents=True, exist_ok=True)
    a.out.with_suffix(".json").write_text(
        json.dumps(data, indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
    )
    a.out.write_text(written(data, a.out.suffix), encoding="utf-8")
    print(f"wrote {a.out} and {a.out.with_suffix('.json')}: {len(data['rows'])} rows")
    return 0


def measured(
    folder: Path, quick: bool, peers: dict[str, str], only: list[str] | None, before: list[dict[str, Any]]
) -> dict[str, Any]:
    """Rows of all sets, those that were not measured as `before`, and with what they were measured."""
    from board.sets import SETS, Asked, all_rows

    import stiffmap

    known = {s.folder: s for s in SETS}
    for name in only or ():
        if name not in known:
            raise SystemExit(f"--only: expected one of {', '.join(known)}, got {name!r}")
    if not folder.is_dir():
        print(
            f"no folder {folder}: every set is absent; what follows says where each is to be had",
            file=sys.stderr,
        )

    def say(line: str) -> None:
        print(line, file=sys.stderr, flush=True)

    rows = [r.to_json() for r in all_rows(folder, Asked(quick, peers), say, only)]
    if only:
        fresh = {known[name].source: [r for r in rows if r["source"] == known[name].source] for name in only}
        rows = []
        for r in before:
            rows += fresh.pop(r["source"], []) if r["source"] in fresh else []
            rows += [] if r["source"] in {known[name].source for name in only} else [r]
        rows += [r for some in fresh.values() for r in some]
    release = stiffmap.__version__
    about = {
        "stiffmap": release if release != "0" else "from its sources",
        "Python": platform.python_version(),
    }
    return {"about": about, "command": COMMAND + (" --quick" if quick else ""), "rows": rows}


def written(data: dict[str, Any], suffix: str) -> str:
    """The page of measured rows."""
    make = page if suffix == ".html" else markdown
    return make([Row.of(r) for r in data["rows"]], data["command"], data["about"], data.get("speed", []))


if __name__ == "__main__":
    raise SystemExit(main())
