"""From gmsh's model to a SolidMesh: CAD files, mesh files and parametric links."""

from __future__ import annotations

import ctypes
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import numpy as np

from stiffmap.common.errors import StiffmapError, needed, refuse_folder
from stiffmap.common.units import size_of
from stiffmap.model.link.mesh import SolidMesh, checked_mesh
from stiffmap.model.link.transport import Ints

CAD, MESH = {".step", ".stp", ".iges", ".igs", ".brep"}, {".msh", ".inp", ".unv", ".bdf", ".med", ".stl"}
UNITS = {u: size_of(u) for u in ("mm", "m", "cm", "in", "inch")}
_GMSH_TO_OURS = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]  # gmsh lists edge 23 before 13

Faces = dict[str, list[int]]


@contextmanager
def gmsh_session() -> Iterator[ModuleType]:
    """A fresh, silent gmsh model; its errors become :class:`StiffmapError`.

    Lengths in the model are millimetres, since OpenCASCADE's tolerances are absolute.
    """
    try:
        with needed("a finite-element mesh", "fea"):
            import gmsh
    except OSError as error:  # gmsh's wheel loads libGLU and libX11 libraries of the system
        raise StiffmapError(
            f"gmsh is installed but misses a system library ({error}); on Debian: "
            "apt install libglu1-mesa libxcursor1 libxft2 libxinerama1"
        ) from None
    with _same_action("SIGPIPE"):  # by gmsh's own, a connection that closes ends the process
        gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.NumThreads", 1)  # meshes repeat bit for bit
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        yield gmsh
    except StiffmapError:
        raise
    except Exception as error:
        if type(error) is not Exception:  # gmsh raises bare Exception; anything else is ours
            raise
        raise StiffmapError(f"gmsh: {' '.join(str(error).split())}") from None
    finally:
        gmsh.finalize()


@contextmanager
def _same_action(name: str) -> Iterator[None]:
    """What the process does on a signal is the same before and after, in any thread, whatever a library sets meanwhile."""
    if not hasattr(signal, name):  # a system without it
        yield
        return
    number, sigaction = int(getattr(signal, name)), ctypes.CDLL(None).sigaction
    action = ctypes.create_string_buffer(512)  # a struct sigaction has some 150 bytes
    sigaction(number, None, action)
    try:
        yield
    finally:
        sigaction(number, action, None)


def mesh_model(build: Callable[[ModuleType], Faces], size: float) -> SolidMesh:
    """Mesh what ``build`` makes in gmsh's OpenCASCADE kernel, in mm; it returns named surface tags.

    Args:
        build: called with the gmsh module, returns face name -> surface tags.
        size: target edge length in m.
    """
    with gmsh_session() as gmsh:
        names = build(gmsh)
        _generate(gmsh, size)
        return _extract(gmsh, names, 1e-3)


def mesh_file(path: str | Path, size: float | None = None, unit: str | None = None) -> SolidMesh:
    """Mesh a CAD file (lengths from the file), or read a volume mesh (lengths in ``unit``).

    Args:
        path: STEP, IGES, BREP, or a mesh file that gmsh reads.
        size: target edge length in m for CAD; 2 V/A of the part when not given.
        unit: "mm", "m", "cm" or "inch" for a mesh file, which does not carry its unit.

    Raises:
        StiffmapError: no such file, unknown suffix, unit missing, no volume, elements of zero volume.
    """
    path = Path(path)
    refuse_folder(path, "a mesh or a solid")
    if not path.is_file():
        raise StiffmapError(f"{path}: no such file")
    suffix = path.suffix.lower()
    if suffix not in CAD | MESH:
        raise StiffmapError(f"{path}: expected {', '.join(sorted(CAD | MESH))}, got {suffix!r}")
    if suffix in MESH and unit not in UNITS:
        raise StiffmapError(f"{path}: a mesh file has no units; give --unit, one of {', '.join(UNITS)}")
    with gmsh_session() as gmsh:
        gmsh.open(str(path))
        if not gmsh.model.getEntities(3):
            raise StiffmapError(f"{path}: expected a part with a volume, found none")
        if suffix in CAD:
            _generate(gmsh, size or default_size(gmsh))
            return _extract(gmsh, named_surfaces(gmsh), 1e-3)
        gmsh.model.mesh.setOrder(2)
        return _extract(gmsh, named_surfaces(gmsh), UNITS[str(unit)])


def default_size(gmsh: ModuleType) -> float:
    """Edge length in m that suits the part: 2 V/A is half the side of a square bar, the wall of a tube."""
    volume = sum(gmsh.model.occ.getMass(*e) for e in gmsh.model.getEntities(3))
    area = sum(gmsh.model.occ.getMass(*e) for e in gmsh.model.getEntities(2))
    return float(2e-3 * volume / area)


def named_surfaces(gmsh: ModuleType) -> Faces:
    """Surface tags by physical group name; surfaces in no named group are ``face<tag>``."""
    names: Faces = {}
    for dim, group in gmsh.model.getPhysicalGroups(2):
        tags = [int(t) for t in gmsh.model.getEntitiesForPhysicalGroup(dim, group)]
        names[gmsh.model.getPhysicalName(dim, group) or f"group{group}"] = tags
    return with_others(gmsh, names)


def with_others(gmsh: ModuleType, names: Faces) -> Faces:
    """The named faces, and every other surface as ``face<tag>``."""
    used = {t for tags in names.values() for t in tags}
    return names | {f"face{t}": [t] for _, t in gmsh.model.getEntities(2) if t not in used}


def _generate(gmsh: ModuleType, size: float) -> None:
    gmsh.option.setNumber("Mesh.MeshSizeMax", 1e3 * size)
    gmsh.option.setNumber("Mesh.MeshSizeMin", 0.1e3 * size)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 8)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(2)


def _extract(gmsh: ModuleType, names: Faces, unit: float) -> SolidMesh:
    tags, xyz, _ = gmsh.model.mesh.getNodes()
    number = np.full(int(tags.max(initial=0)) + 1, -1, dtype=np.int64)
    number[tags] = np.arange(len(tags))
    tets = number[gmsh.model.mesh.getElementsByType(11)[1]].reshape(-1, 10)[:, _GMSH_TO_OURS]
    faces: dict[str, Ints] = {}
    for name, surfaces in names.items():
        parts = [gmsh.model.mesh.getElementsByType(9, s)[1] for s in surfaces]
        triangles = number[np.concatenate(parts).astype(np.int64)].reshape(-1, 6)
        if len(triangles):
            faces[name] = triangles
    return checked_mesh(unit * np.asarray(xyz).reshape(-1, 3), tets, faces)
