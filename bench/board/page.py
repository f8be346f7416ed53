"""The scoreboard as a page, from its rows alone."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import Any

from board.row import Row
from board.sources import SOURCES

HEAD = ("set", "authors", "before", "after", "unseen rows", "cause", "s")
SPEED = ("case", "program", "µs a pose", "times stiffmap's", "note")
PEERS = ("set", "package", "after", "s", "note")
TITLE = "Scoreboard"
ABOUT = """Public measured sets with an open licence: what the authors of the data reached, and what stiffmap leaves on rows that no fit
saw, before and after, with the cause that it names. Misses are shown like hits. `before` is the declared machine, with unknown frames
and tools fitted; seconds are CPU time with all folds and the verdict."""
REPEAT = """This page and the JSON file next to it are written by

```text
{command}
```

The data are no part of stiffmap. Each set has a folder in `measured`, or where `--data` says. CLONE is a clone of the authors' repository
at the commit that is named. The C++ peer of the speed is `bench/peers/pinocchio_vjm.cpp`, which says how to build it; `--speed PROGRAM` runs it."""
FOLDERS = ("folder", "source, licence", "made by")


def number(x: float | None) -> str:
    """Three significant digits, or a dash."""
    return "–" if x is None else f"{x:.3g}"


def tables(rows: Sequence[Row]) -> list[tuple[str, tuple[str, ...], list[list[str]]]]:
    """Title, head and cells of each table."""
    main = []
    for r in rows:
        note = r.note if r.status == "absent" else f"{r.status}: {r.note}"
        cause = r.cause if r.status == "measured" else note
        counted = "–" if r.unseen_rows is None else f"{r.unseen_rows} ({r.unseen_by})"
        unit = r.quantity.rpartition(", ")[2]
        before, after = (f"{number(x)} {unit}".strip() for x in (r.before, r.after))
        seconds = number(r.seconds)
        main.append([r.set, r.authors, before, after, counted, cause, seconds])
    peers = [[r.set, p.name, number(p.after), number(p.seconds), p.note] for r in rows for p in (*r.peers,)]
    for r in rows:
        if r.peers:
            at = next(i for i, p in enumerate(peers) if p[0] == r.set)
            peers.insert(
                at, [r.set, "**stiffmap**", number(r.after), number(r.seconds), "all folds and the verdict"]
            )
    sources = [list(x) for x in dict.fromkeys((r.source, r.quantity) for r in rows)]
    out = [("Before and after", HEAD, main)]
    if peers:
        out.append(("Comparison with other packages, same rows", PEERS, peers))
    out.append(("Sources and quantities", ("source, licence", "quantity"), sources))
    return out


def speed_table(
    speed: Sequence[dict[str, Any]],
) -> list[tuple[str, tuple[str, ...], list[list[str]]]]:
    """One thread on the same computer in one run; nothing where speed was not measured."""
    if not speed:
        return []
    own = {r["case"]: r["microseconds"] for r in speed if r["package"] == "stiffmap"}
    cells = []
    for r in speed:
        t, ratio = r["microseconds"], ""
        if t is not None and r["package"] != "stiffmap":
            ratio = f"{t / own[r['case']]:.3g}"
        name = "**stiffmap**" if r["package"] == "stiffmap" else r["package"]
        cells.append([r["case"], name, number(t), ratio, r["note"]])
    return [("Speed: a Tripteron, one thread", SPEED, cells)]


def markdown(
    rows: Sequence[Row], command: str, about: dict[str, Any], speed: Sequence[dict[str, Any]] = ()
) -> str:
    """The page for the documentation."""
    lines = [f"# {TITLE}", "", ABOUT, "", made(about)]
    for title, head, cells in [*tables(rows), *speed_table(speed)]:
        lines += ["", f"## {title}", "", _line(head), _line(["---"] * len(head))]
        lines += [_line(c) for c in cells]
    folders = [_line([f"`{k}`", str(s), s.files.format(k)]) for k, s in SOURCES.items()]
    lines += ["", "## Repeat it", "", REPEAT.format(command=command), "", _line(FOLDERS), _line(["---"] * 3)]
    return "\n".join([*lines, *folders, ""])


def page(
    rows: Sequence[Row], command: str, about: dict[str, Any], speed: Sequence[dict[str, Any]] = ()
) -> str:
    """The page by itself, as HTML."""
    parts = [f"<h1>{TITLE}</h1>", f"<p>{_plain(ABOUT)}</p>", f"<p>{_plain(made(about))}</p>"]
    for title, head, cells in [*tables(rows), *speed_table(speed)]:
        body = "".join("<tr>" + "".join(f"<td>{_plain(c)}</td>" for c in row) + "</tr>" for row in cells)
        top = "".join(f"<th>{_plain(h)}</th>" for h in head)
        parts.append(f"<h2>{title}</h2><div><table><tr>{top}</tr>{body}</table></div>")
    style = "body{font:16px/1.5 sans-serif;max-width:75rem;margin:auto;padding:1rem;color-scheme:light dark}div{overflow-x:auto}td,th{text-align:left;vertical-align:top;padding:.2rem .8rem .2rem 0;border-bottom:1px solid #8886}"
    head = f'<meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{TITLE}</title><style>{style}</style>'
    repeat = f"<h2>Repeat it</h2><pre>{html.escape(command)}</pre>"
    return f'<!doctype html><html lang="en"><head>{head}</head><body>{"".join(parts)}{repeat}</body></html>\n'


def made(about: dict[str, Any]) -> str:
    """By what and on what the figures were measured."""
    return "Measured with " + ", ".join(f"{k} {v}" for k, v in about.items()) + "."


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(c.replace("|", "\\|") for c in cells) + " |"


def _plain(text: str) -> str:
    return html.escape(text).replace("**", "").replace("`", "")
