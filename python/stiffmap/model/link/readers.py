"""Displacement fields that users already have: CSV, CalculiX .dat, .frd, listings of Ansys and Abaqus, VTK/VTU."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError, StiffmapError, needed, refuse_folder
from stiffmap.common.number_text import number_in
from stiffmap.common.tables.header import meaning_of, split_unit, with_unit
from stiffmap.common.tables.named import Known, named
from stiffmap.common.tables.sheet import Layout, read_sheet
from stiffmap.common.tables.table import Table
from stiffmap.common.texts import text_of
from stiffmap.model.link.gmshmesh import UNITS
from stiffmap.model.link.transport import Ints

Rows = tuple[Ints, Floats]
Nodes = dict[int, list[float]]
FIELDS = (".csv", ".dat", ".f06", ".frd", ".lis", ".pch", ".rpt", ".txt", ".vtk", ".vtu")
_HEAD = re.compile(
    r"^\s*(?:(displacements)\s*\(.*|(?:D I S P L A C E M E N T +V E C T O R\s+POINT ID\.\s+TYPE|NODE)\s+(?:FOOT-\s+)?(\S.*)(?:\n\s*(?:NOTE|LABEL)\b.*)?|"
    r"\$DISPLACEMENTS.*\n\$REAL.*(?:\n\$.*)*)$", re.MULTILINE | re.IGNORECASE,
)  # fmt: skip
"""Above rows of nodes, with the names of their columns: CalculiX, Abaqus and Ansys, Nastran; its punch files have none."""
_MOVED = re.compile(r"(?i)(?:U[.-])?(?:[UD]([XYZ])|[UT]([123])(?!\d))")
_CASE = re.compile(rf"{_MOVED.pattern}(?:[ _]?(?:lc|case)?[ _]?(\d+))?(?![^\W_])")
_BLOCK = re.compile(r"(?i)\W*(?:load[ _]?case|sub[ _]?case|case|lc|load step|step|lastfall)\W*(\d+)\b")
_WITH_UNITS = re.compile(r"(?im)^\W*(?:node|knoten)\b.*[\[(] ?(?:mm|cm|m|in|inch|[uµμ]m) ?[\])]")
_WORDS = re.compile(r"(?m)^(?:\s*[A-Za-z*$]|[01] {3,}[A-Z]{2})")  # a page of Nastran begins with 0 or 1
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[Ee][-+]?\d+)?")
_FORTRAN = re.compile(r"(?<=[\d.])(?:[Dd](?=[-+\d])|(?=[-+]\d+(?![\d.])))")
"""Where an E belongs: 1.0D-05, and 1.0-105, which Fortran writes with three digits. In -1.0-2.0 two numbers touch."""


def read_csv_field(path: str | Path, unit: str | None = None) -> tuple[Floats, Floats]:
    """Points (n, 3) m and displacements (cases, n, 3) m of a CSV with units in its header, else in `unit`.

    Columns ``node, x [mm], y [mm], z [mm]`` and then ``ux [mm], uy [mm], uz [mm]`` once per load case, next to or below each other.

    Raises:
        StiffmapError: no such file, a column or its unit missing, cells that are not numbers.
    """
    axes = ("x", "y", "z", "ux", "uy", "uz")
    table, found = known_columns(
        path, {"node": ("", "node")} | {axis: ("m", f"{axis} [mm]") for axis in axes}, unit
    )
    counts = {axis: len(columns) for axis, columns in found.items()}
    if any(counts[a] != 1 for a in "xyz") or {counts["ux"], counts["uy"], counts["uz"]} - {counts["ux"] or 1}:
        raise FileError(
            f"expected x, y, z once and ux, uy, uz once per load case, got {', '.join(table.names)}",
            file=table.file, line=table.top,
        )  # fmt: skip
    points = np.stack([found[a][0] for a in "xyz"], axis=-1)
    fields = np.stack([np.array(found[a]) for a in ("ux", "uy", "uz")], axis=-1)
    rows: dict[int, list[float]] = {}
    nodes = found["node"][0] if found["node"] else np.zeros(0)
    n = len({*nodes.tolist()}) if len(fields) == 1 else 0
    blocks = np.column_stack([nodes, points]).reshape(-1, n, 4) if n and len(nodes) % n == 0 else nodes[:0]
    if (blocks[1:] == blocks[:1]).all() and len(blocks) > 1:
        cases_rise(table, r"(load[^a-z]?|sub)?case|lc|step", repeated=True)
        nodes, points, fields = nodes[:n], points[:n], fields.reshape(-1, n, 3)
    for node, point, moved in zip(nodes, points, fields.swapaxes(0, 1), strict=False):
        _put(path, rows, int(node), [*point.tolist(), *moved.ravel().tolist()])
    return points, fields


def cases_rise(table: Table, names: str, repeated: bool = False) -> None:
    """FileError where a column of such a name numbers load cases, and they do not rise."""
    at = table.find(names)
    number = re.compile(r"(?i)(?:lc|lf|(?:load ?)?case|step)?[ _-]*(\d+)(?:[.,]0*)?")
    cases = [number.fullmatch(c.strip()) for c in (table.columns[at] if at is not None else ())]
    if at is not None and all(cases):
        falls = np.diff([int(c[1]) for c in cases if c], prepend=-1) < (not repeated)
        table.check(~falls, lambda i: f"'{table.header[at]}': expected cases in the order of the field")


def _without_case_titles(sheet: Table) -> Table:
    """Without lines that number load cases, one block below the other; FileError where they do not rise."""
    texts = {n: " ".join(filter(None, map(str.strip, cells))) for n, cells in sheet.titles}
    found = {n: m for n, text in texts.items() if (m := _BLOCK.match(text))}
    if wrong := [
        n
        for n, fall in zip(found, np.diff([int(m[1]) for m in found.values()], prepend=0) <= 0, strict=True)
        if fall
    ]:
        raise FileError("expected load cases in rising order", file=sheet.file, line=wrong[0])
    return sheet.without_titles(found)


def _axis_of(name: str, axes: Collection[str]) -> str:
    """``ux`` of ``Deformation X`` and the like, where that is one of the axes; else the name."""
    meant = re.sub("^d(?=[xyz]$)", "u", meaning_of(name))
    return meant if meant in axes and name.lower() not in axes else name


def known_columns(
    path: str | Path, units: Mapping[str, tuple[str, str]], unit: str | None = None
) -> tuple[Table, dict[str, list[Floats]]]:
    """The table, and the numbers (SI) of each column that has one of these names, each with its SI unit and how it is
    usually written, in `unit` where it names none; other columns are left alone. Raises FileError."""
    refuse_folder(path, "a table")
    if not Path(path).is_file():
        raise FileError("no such file", file=str(path))
    layout = Layout(lambda name: name.lower() in units, strict=True, repeated=True, options=False)
    sheet = read_sheet(Path(path), None, layout)
    _without_case_titles(sheet).refuse_remarks()
    cases = [_CASE.match(h) for h in sheet.header]
    names = [f"u{m[1] or 'xyz'[int(m[2]) - 1]}{h[m.end() :]}" if m else h for m, h in zip(cases, sheet.header, strict=True)]  # fmt: skip
    names = [re.sub(r"(?i)^COORD[-.]COOR([123])", lambda m: "xyz"[int(m[1]) - 1], n) for n in names]
    names = [with_unit(_axis_of(split_unit(n)[0], units), split_unit(n)[1]) for n in names]
    names = [re.sub(r"(?i)^(node|knoten)[ _]?(label|number|id|n[or]\.?|nummer)?$", "node", n) for n in names]
    names = [re.sub(r"(?i)^(u?[xyz])_m$", r"\1 [m]", n) for n in names]  # x as measured is no column here
    order = sorted(range(len(names)), key=lambda i: int(m[3] or 0) if (m := cases[i]) else 0)
    header = tuple(names[i] for i in order)
    sheet = replace(sheet, header=header, columns=tuple(sheet.columns[i] for i in order))
    found: dict[str, list[Floats]] = {name: [] for name in units}
    for head, cells, name in zip(sheet.header, sheet.columns, map(str.lower, sheet.names), strict=True):
        if name in units:
            usual = {name: units[name][1]}
            known = Known({name: units[name][0]}, usual, {}, assumed={name: unit or ""}, options=False)
            found[name].append(named(replace(sheet, header=(head,), columns=(cells,)), known).values[name])
    return sheet, found


def read_listing(path: str | Path) -> Rows:
    """Node numbers (n,) and displacements (cases, n, 3), in the deck's unit, below each line of names of a listing: .dat of CalculiX or
    Abaqus, field reports of Abaqus, PRNSOL of Ansys, .f06 and .pch of Nastran; magnitudes and rotations are left out."""
    text = text_of(Path(path))
    if turned := re.search(r"RESULTS ARE IN (?!(THE )?GLOBAL COORDINATE|COORDINATE SYSTEM +0\b).*", text):
        raise StiffmapError(f"{path}: expected results in the global system (RSYS,0), found: {turned[0]}")
    if len(parts := {*re.findall(r"at nodes for (part: .*\S)", text)}) > 1:
        raise StiffmapError(
            f"{path}: expected nodes of one part, which numbers its own; found {', '.join(sorted(parts))}"
        )
    # One load case may be printed in several pages or sets of nodes; each repeats the header, not the load step.
    cases: list[dict[int, list[float]]] = []
    for head in _HEAD.finditer(text):
        names = (head[2] or ("UX UY UZ" if head[1] else "T1 T2 T3 line")).upper().split()
        moved = [i for i, name in enumerate(names) if _MOVED.fullmatch(name)]
        if len(moved) != 3:
            continue
        words = _WORDS.search(text, head.end())
        listed = text[head.end() : words.start() if words else None]
        rows = _node_rows(path, listed, (len(names) + 1, 7), moved[0])
        if cases and not cases[-1].keys() & rows.keys():
            cases[-1].update(rows)
        else:
            cases.append(rows)
    return _same_nodes(path, cases)


def read_frd(path: str | Path) -> tuple[Floats, Floats]:
    """Coordinates (n, 3) and displacements (cases, n, 3), in the deck's unit, of a CalculiX .frd (ASCII)."""
    nodes: dict[int, list[float]] = {}
    cases: list[dict[int, list[float]]] = []
    into: dict[int, list[float]] | None = None
    for line in text_of(Path(path)).splitlines():
        key = line[:5].strip()
        if re.match(r" {4}2C +\d+ +[23]\s*$", line):
            raise StiffmapError(f"{path}: expected ASCII, found a binary .frd; *NODE FILE writes ASCII")
        if line.startswith("    2C"):
            into = nodes
        elif line.startswith(" -4"):
            into = None
            if line[5:13].strip() == "DISP":
                cases.append({})
                into = cases[-1]
        elif key.startswith("-1") and into is not None:
            row = line.rstrip()  # a node of five (short format) or ten characters, then three values
            try:
                node, values = int(row[3:-36]), [number_in(row[-36 + i :][:12]) for i in (0, 12, 24)]
            except ValueError:
                raise StiffmapError(
                    f"{path}: expected fixed columns of twelve characters, got {line.strip()[:60]}"
                ) from None
            _put(path, into, node, values)
        elif line.startswith(" -3"):
            into = None
    numbers, fields = _same_nodes(path, cases)
    missing = [i for i in numbers if int(i) not in nodes]
    if missing:
        raise StiffmapError(f"{path}: node {missing[0]} has a displacement and no coordinates")
    return np.array([nodes[int(i)] for i in numbers]), fields


def read_vtk(path: str | Path) -> tuple[Floats, Floats]:
    """Points and displacements, in the file's unit, of a VTK/VTU: every (n, 3) point array is a case."""
    with needed("reading VTK files", "fea"):
        import meshio
    try:
        mesh = meshio.read(path)
    except (Exception, SystemExit) as error:
        raise StiffmapError(f"{path}: meshio cannot read it ({' '.join(str(error).split())[:80]})") from None
    in_order = sorted(mesh.point_data, key=lambda n: [part.zfill(12) for part in re.split(r"(\d+)", n)])
    vectors = [mesh.point_data[n] for n in in_order if np.shape(mesh.point_data[n])[1:] == (3,)]
    fields = [np.asarray(v, dtype=float) for v in vectors]
    if not fields:
        raise StiffmapError(
            f"{path}: expected point arrays with three components, got {sorted(mesh.point_data)}"
        )
    return np.asarray(mesh.points, dtype=float), np.array(fields)


def read_field(
    path: str | Path, unit: str | None = None, nodes: str | Path | None = None
) -> tuple[Floats, Floats]:
    """Points (n, 3) m and displacements (cases, n, 3) m of any of the formats, by suffix.

    Args:
        path: .csv, .dat, .frd, .vtk, .vtu, or .lis/.txt from Ansys, .rpt/.txt from Abaqus, .f06/.pch from Nastran.
        unit: length unit of a file that does not carry it.
        nodes: coordinates for .dat and listings, which hold numbers only: rows "node x y z", in the unit that their
            header names, else in `unit`.

    Raises:
        StiffmapError: unknown suffix, unit missing, coordinates missing, no displacements.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".csv" or (suffix == ".txt" and _WITH_UNITS.search(text_of(Path(path)))):
        return read_csv_field(path, unit)
    if suffix not in FIELDS:
        raise StiffmapError(f"{path}: expected {', '.join(FIELDS)}, got {suffix!r}")
    if unit not in UNITS:
        raise StiffmapError(f"{path}: this format has no units; give --unit, one of {', '.join(UNITS)}")
    if suffix in {".frd", ".vtk", ".vtu"}:
        points, fields = read_frd(path) if suffix == ".frd" else read_vtk(path)
        return UNITS[unit] * points, UNITS[unit] * fields
    numbers, fields = read_listing(path)
    if nodes is None:
        raise StiffmapError(f"{path}: it holds node numbers only; give the coordinates with --nodes")
    given = re.sub(r"^\*\*.*$", "", text_of(Path(nodes)), flags=re.MULTILINE)
    if turned := re.search(
        r"^(\*(SYSTEM|INSTANCE.*\n *[-+.\d]|NODE\b.*SYSTEM *= *[CS])|.*\bDSYS *= *[1-9]).*$",
        given,
        re.MULTILINE | re.I,
    ):
        raise StiffmapError(
            f"{nodes}: expected coordinates in the global frame, found {turned[0].splitlines()[0]}"
        )
    sections = re.findall(r"^\*NODE\b(?!\s+[A-Z]).*\n([^*]*)", given, flags=re.MULTILINE | re.IGNORECASE)
    table = "".join(sections or [given])
    table = table.replace(",", ".") if ";" in table else table  # decimal commas
    place = _node_rows(nodes, table, (7,) if "THXY" in table else (4,))  # NLIST has the axes of a node, too
    said = unit if sections else _unit_above(nodes, given, unit)
    absent = [int(i) for i in numbers if int(i) not in place]
    if absent:
        raise StiffmapError(f"{nodes}: no coordinates for node {absent[0]} ({len(absent)} missing)")
    points = np.array([place[int(i)] for i in numbers])
    return UNITS[said] * points, UNITS[unit] * fields


def _unit_above(path: str | Path, text: str, other: str) -> str:
    """Length unit in the header of a table of x, y, z or in a line of units above its rows; `other` where neither says one."""
    unit = r"(?<![^\W_])(?:mm|cm|m|inch|in(?=\s*(?:[\])]|$)))(?![^\W_])"  # not the in of: x in mm
    above = re.split(r"^\s*\d", text, maxsplit=1, flags=re.MULTILINE)[0]
    named = r"(?i)coordinates|(?<![^\W_])[xyz](?![^\W_])"
    lines = [n for n in above.splitlines() if re.search(named, n) or not re.sub(rf"{unit}|[\W_]", "", n)]
    for line in lines:
        axes = "".join(re.findall(r"(?<![^\W_])[xyz](?![^\W_])", line.lower()))
        if {*axes} == {*"xyz"} and not axes.endswith("xyz"):
            raise StiffmapError(
                f"{path}: expected columns in the order node, x, y, z; found {line.strip()[:60]}"
            )
    found = {u for n in lines for u in re.findall(unit, n)}
    if len(found) > 1:
        raise StiffmapError(f"{path}: expected coordinates in one unit, found {' and '.join(sorted(found))}")
    return min(found, default=other)


def _node_rows(path: str | Path, text: str, columns: tuple[int, ...] = (4,), first: int = 0) -> Nodes:
    """Rows "node a b c": three numbers from the first on behind an integer. Columns may touch: 12-1.0E-03-2.0E-04."""
    rows: Nodes = {}
    for line in _FORTRAN.sub("E", text).splitlines():
        head = re.match(r"\s*(\d+)(?:\s+G\s+|[\s,;]+|(?=-\d*\.))([^\s,;].*)", line)
        if not head:
            continue
        cells = _NUMBER.findall(head[2])
        if len(cells) + 1 not in columns or re.search(r"[A-CF-Za-cf-z]", head[2]):
            raise StiffmapError(f"{path}: expected a node and three numbers, found {line.strip()[:60]}")
        _put(path, rows, int(head[1]), [number_in(c) for c in cells[first : first + 3]])
    return rows


def _put(path: str | Path, rows: dict[int, list[float]], node: int, values: list[float]) -> None:
    if rows.setdefault(node, values) != values:
        raise StiffmapError(f"{path}: node {node} is there twice, with {rows[node]} and with {values}")


def _same_nodes(path: str | Path, cases: list[dict[int, list[float]]]) -> Rows:
    if not cases or not cases[0]:
        raise StiffmapError(
            f"{path}: expected nodal displacements, found none: 'displacements (' heads them in a .dat, NODE UX UY UZ in an Ansys listing, Node U.U1 U.U2 U.U3 in a report of Abaqus, $DISPLACEMENTS in a .pch; a table with units in its header is a .csv"
        )
    numbers = sorted(cases[0])
    for k, case in enumerate(cases):
        if sorted(case) != numbers:
            raise StiffmapError(
                f"{path}: load case {k + 1} has {len(case)} nodes, case 1 has {len(numbers)} or others"
            )
    return np.array(numbers, dtype=np.int64), np.array([[case[i] for i in numbers] for case in cases])
