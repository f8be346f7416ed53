"""``stiffmap link``: a part or a displacement field to a spring with error bars. mm, N at this boundary."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, cast

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.model.link.gmshmesh import CAD, MESH, mesh_file
from stiffmap.model.link.identify import identify_link
from stiffmap.model.link.inputs import UNIT_WRENCHES, read_cases, read_material, read_part
from stiffmap.model.link.linkfile import LinkFile, check_semidefinite, save_link
from stiffmap.model.link.mesh import face_area_centre
from stiffmap.model.link.pipeline import PartLink, Solver, Support, link_from_part
from stiffmap.model.link.readers import FIELDS, read_field
from stiffmap.model.link.result import Link
from stiffmap.model.link.solve import Material, Setup
from stiffmap.model.link.transport import standard_errors
from stiffmap.ui.cli.inputs import in_si
from stiffmap.ui.cli.options import argument, flag, option, written
from stiffmap.ui.cli.output import Answer


def command(
    part: Path = argument("beam.yaml, .step, .msh, or a field: .csv .dat .f06 .frd .lis .pch .rpt .vtu"),
    fixed: str = option("Face that is held; a+b joins faces.", "fixed"),
    loaded: str = option("Face that carries the load and the spring.", "loaded"),
    material: str | None = option("A name (steel, aluminium, ...) or 70GPa,0.33."),
    cases: Path | None = option("CSV of wrenches: fx [N] ... mz [N*mm]."),
    reference: str | None = option("x,y,z of the spring in mm; else the face's centre."),
    size: float | None = option("Edge length of the elements in mm."),
    unit: str | None = option("Length unit of a file that does not carry it."),
    nodes: Path | None = option(
        "Coordinates for files of node numbers (.dat, .f06, .lis, .pch, .rpt): node x y z."
    ),
    solver: str = option("auto, ccx or skfem.", "auto"),
    quick: bool = flag("One mesh, one boundary: no share of these.", "--quick"),
    support: str = option(
        "Besides clamped, for the boundary's share: bed (bolted down), soft (pin in hole).", "bed"
    ),
    zeros: bool = flag("Set insignificant entries to zero.", "--zeros"),
    out: Path | None = written("Link file to write (YAML).", None, "-o", "--out"),
    picture: Path | None = written("PNG to write.", None, "--picture"),
) -> Answer:
    """Identify a link's 6x6 spring, with error bars, from a part or a displacement field.

    Examples:
      [cyan]stiffmap link bar.yaml --out bar-link.yaml --picture bar.png[/cyan]
      [cyan]stiffmap link bracket.step --fixed face3 --loaded face7 --material aluminium --size 4[/cyan]
      [cyan]stiffmap link field.csv --cases cases.csv --reference 310,0,0[/cyan]
    """
    wrenches = UNIT_WRENCHES if cases is None else read_cases(cases)
    place, edge = in_si(reference, "reference", 3), in_si(size)
    if size is not None and not size > 0:
        raise StiffmapError(f"--size: expected an edge length above 0, got {size:g}")
    found: PartLink | None = None
    if part.suffix.lower() in FIELDS:
        if cases is None or place is None:
            raise StiffmapError(f"{part}: a displacement field needs --cases FILE and --reference x,y,z")
        name = part.stem
        points, displacements = read_field(part, unit, nodes)
        if len(displacements) != len(wrenches):
            raise StiffmapError(f"{part}: has {len(displacements)} load cases, --cases has {len(wrenches)}")
        link = identify_link(points, displacements, wrenches, reference=place)
    else:
        mesher, made_of, name, centre = _part(
            part, unit, None if material is None else read_material(material)
        )
        setup = Setup(fixed, loaded, _reference(mesher, loaded, place, centre, edge))
        found = link_from_part(
            mesher, made_of, setup, wrenches, size=edge, solver=cast(Solver, solver), study=not quick,
            other_support=cast(Support, support), refine=not quick and part.suffix.lower() not in MESH,
        )  # fmt: skip
        link = found.link
    link = link.with_zeros() if zeros else link
    if found is None:
        even = (link.compliance + link.compliance.T) / 2
        file = LinkFile(even, link.covariance, link.reference, {"source": "field"}, name)
    else:
        found = replace(found, link=link)
        file = found.file(name)
    if out is not None:
        save_link(file, out)
    if picture is not None:
        from stiffmap.ui.plot.link import draw_link

        draw_link(link, picture, found)
    told = [link.report(), *([] if found is None else _of_part(found))]
    told += [f"wrote {path}" for path in (out, picture) if path is not None]
    problem = ""
    try:
        check_semidefinite(part, "compliance", file.compliance)
    except StiffmapError as error:
        problem = str(error)
    data = {**as_data(link, found, file), "problem": problem}
    return Answer(data, [*told, problem or None], finding=bool(problem))


def _part(
    path: Path, unit: str | None, material: Material | None
) -> tuple[Any, Material, str, Floats | None]:
    """Mesher, material, name, and the reference point of a parametric part."""
    suffix = path.suffix.lower()
    mesher: Any
    if suffix in {".yaml", ".yml"}:
        shape, own, name = read_part(path)
        mesher, material, centre = shape.mesh, material or own, shape.reference()
    elif suffix in CAD | MESH:
        mesher, name, centre = partial(mesh_file, path, unit=unit), path.stem, None
    else:
        known = ", ".join(sorted({".yaml", *CAD, *MESH, *FIELDS}))
        raise StiffmapError(f"{path}: expected one of {known}, got {suffix!r}")
    if material is None:
        raise StiffmapError(
            f"{path}: the part has no material; give --material, for example --material steel"
        )
    return mesher, material, name, centre


def _reference(
    mesher: Any, loaded: str, place: Floats | None, centre: Floats | None, size: float | None
) -> Floats:
    if place is not None:
        return place
    if centre is not None and loaded == "loaded":
        return centre
    mesh = mesher(size)
    return face_area_centre(mesh.nodes, mesh.face(loaded))[1]


def _of_part(part: PartLink) -> Iterator[str]:
    yield f"\n{part.solver}, {len(part.mesh.nodes)} nodes, {len(part.mesh.tets)} ten-node tetrahedra"
    yield "relative standard uncertainty of the diagonal, by source (fit: which nodes, by block bootstrap):"
    yield part.table()
    if part.refinement is not None:
        yield f"observed order of the mesh error: {part.refinement.words}"


def as_data(link: Link, part: PartLink | None, file: LinkFile) -> dict[str, Any]:
    """What ``--json`` prints, SI."""
    data: dict[str, Any] = {
        "units": "SI (m, N, rad)",
        "reference": link.reference,
        "compliance": file.compliance,
        "standard_error": file.standard_error,
        **{n: getattr(link, n) for n in ("insignificant", "level", "sigma", "dof")},
        "outliers": int(link.outliers.sum()),
        "asymmetry": link.asymmetry,
    }
    if part is not None:
        data["solver"] = part.solver
        data["uncertainty"] = {k: standard_errors(V) for k, V in part.covariances.items()}
        r = part.refinement
        data["order"] = None if r is None or r.why else r.order
        data["order_note"] = "one mesh" if r is None else r.why
    return data
