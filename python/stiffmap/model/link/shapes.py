"""Parametric links without CAD, made with gmsh's OpenCASCADE: bars, forks, a foot. Lengths in m.

Every link runs from the face ``fixed`` at the origin; axes as in the machine files: a bar along x with its
width along y and its height along z, a foot along -y.
"""

from __future__ import annotations

from types import ModuleType
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from stiffmap.common.broadcasting import Floats
from stiffmap.model.files.schema.base import FileModel
from stiffmap.model.link.gmshmesh import Faces, mesh_model, with_others
from stiffmap.model.link.mesh import SolidMesh

Length = Field(gt=0, allow_inf_nan=False)
Vector = tuple[float, float, float]


class _Shape(FileModel):
    def default_size(self) -> float:
        """Target edge length in m."""
        raise NotImplementedError

    def build(self, gmsh: ModuleType) -> Faces:
        """Make the solid in mm; returns the surface tags by name."""
        raise NotImplementedError

    def mesh(self, size: float | None = None) -> SolidMesh:
        """Quadratic tetrahedra with the faces ``fixed`` and ``loaded``."""
        return mesh_model(self.build, size or self.default_size())


class Bar(_Shape):
    """Solid rectangular bar."""

    shape: Literal["bar"] = "bar"
    length: float = Length
    width: float = Length
    height: float = Length

    def reference(self) -> Floats:
        """(3,) m, centre of the end face, of a fork the middle of its pin's axis."""
        return np.array([self.length, 0.0, 0.0])

    def default_size(self) -> float:
        """Half the smaller side."""
        return min(self.width, self.height) / 2

    def build(self, gmsh: ModuleType) -> Faces:
        """One box."""
        _box(gmsh, 0, self.length, self.width, self.height)
        gmsh.model.occ.synchronize()
        return _end_faces(gmsh, 0, 1e3 * self.length)


class HollowBar(Bar):
    """Rectangular tube with a constant wall."""

    shape: Literal["hollow-bar"] = "hollow-bar"  # type: ignore[assignment]
    wall: float = Length

    @model_validator(mode="after")
    def _wall_fits(self) -> HollowBar:
        if 2 * self.wall >= min(self.width, self.height):
            raise ValueError(f"wall: expected less than half of the smaller side, got {self.wall}")
        return self

    def default_size(self) -> float:
        """Three times the wall: one quadratic element through it."""
        return 3 * self.wall

    def build(self, gmsh: ModuleType) -> Faces:
        """Box less box."""
        outer = _box(gmsh, 0, self.length, self.width, self.height)
        hole = _box(gmsh, 0, self.length, self.width - 2 * self.wall, self.height - 2 * self.wall)
        gmsh.model.occ.cut(outer, hole)
        gmsh.model.occ.synchronize()
        return _end_faces(gmsh, 0, 1e3 * self.length)


class ForkBar(Bar):
    """Tube (or solid bar, ``wall = 0``) with a fork at both ends; loads enter through the pin holes.

    Two prongs, parallel to x-z and ``gap`` apart along y, carry a pin hole along y at ``length`` between the
    axes. ``width`` and ``height`` are the tube's; the prongs are as high as the tube.
    """

    shape: Literal["fork-bar"] = "fork-bar"  # type: ignore[assignment]
    wall: float = Field(ge=0)
    fork: float = Length  # from the pin axis to the end of the tube
    prong: float = Length  # thickness of a prong
    gap: float = Length  # between the prongs
    hole: float = Length  # diameter

    @model_validator(mode="after")
    def _fits(self) -> ForkBar:
        if self.hole >= self.height:
            raise ValueError(f"hole: expected less than the height {self.height}, got {self.hole}")
        if 2 * self.fork >= self.length:
            raise ValueError(f"fork: expected less than half of the length {self.length}, got {self.fork}")
        if self.wall and 2 * self.wall >= min(self.width, self.height):
            raise ValueError(f"wall: expected less than half of the smaller side, got {self.wall}")
        return self

    def default_size(self) -> float:
        """Three times the thinnest part: one quadratic element through it."""
        return 3 * min(self.prong, self.wall or self.prong)

    def build(self, gmsh: ModuleType) -> Faces:
        """Tube, two end plates, four prongs, four pin holes."""
        occ, mm = gmsh.model.occ, 1e3
        x0, x1 = self.fork, self.length - self.fork
        body = _box(gmsh, x0, x1, self.width, self.height)
        if self.wall:
            width, height = self.width - 2 * self.wall, self.height - 2 * self.wall
            body, _ = occ.cut(body, _box(gmsh, x0 + self.prong, x1 - self.prong, width, height))
        outside = self.gap + 2 * self.prong
        prongs, holes = [], []
        ends = ((0.0, -self.height / 2, x0), (self.length, x1, self.length + self.height / 2))
        for axis, start, end in ends:
            plate = self.prong if axis == 0.0 else -self.prong
            edge = x0 if axis == 0.0 else x1
            prongs += _box(gmsh, min(edge, edge + plate), max(edge, edge + plate), outside, self.height)
            for side in (-1, 1):
                y = side * (self.gap + self.prong) / 2
                prongs += _box(gmsh, start, end, self.prong, self.height, y)
                start_y, along, radius = mm * (y - self.prong), 2 * mm * self.prong, mm * self.hole / 2
                holes.append((3, occ.addCylinder(mm * axis, start_y, 0, 0, along, 0, radius)))
        solid, _ = occ.fuse(body, prongs)
        occ.cut(solid, holes)
        occ.synchronize()
        round_faces = [t for _, t in gmsh.model.getEntities(2) if gmsh.model.getType(2, t) == "Cylinder"]
        centre = {t: float(occ.getCenterOfMass(2, t)[0]) for t in round_faces}
        return {
            "fixed": [t for t, x in centre.items() if x < 0.5 * mm * self.length],
            "loaded": [t for t, x in centre.items() if x > 0.5 * mm * self.length],
        }


class Foot(_Shape):
    """L-bracket: an upright of ``height`` along -y on a base plate that is bolted down (its whole underside).

    The plate stands ``plate`` thick on y = 0 and reaches ``base`` along x; the loaded face is its end,
    ``height`` below. ``depth`` is along z.
    """

    shape: Literal["foot"] = "foot"
    height: float = Length
    upright: float = Length  # thickness of the upright along x
    depth: float = Length
    base: float = Length  # length of the plate along x
    plate: float = Length  # its thickness

    @model_validator(mode="after")
    def _fits(self) -> Foot:
        if self.plate >= self.height or self.upright > self.base:
            raise ValueError("foot: expected plate < height and upright <= base")
        return self

    def reference(self) -> Floats:
        """(3,) m, centre of the upright's end."""
        return np.array([0.0, -self.height, 0.0])

    def default_size(self) -> float:
        """Half the smallest of upright, depth and plate."""
        return min(self.upright, self.depth, self.plate) / 2

    def build(self, gmsh: ModuleType) -> Faces:
        """Two boxes; the upright is centred on x = 0, the plate starts at its back."""
        back, side = -self.upright / 2, -self.depth / 2
        plate = _cuboid(gmsh, (back, -self.plate, side), (self.base, self.plate, self.depth))
        upright = _cuboid(gmsh, (back, -self.height, side), (self.upright, self.height, self.depth))
        gmsh.model.occ.fuse(plate, upright)
        gmsh.model.occ.synchronize()
        return _end_faces(gmsh, 1, -1e3 * self.height)


def _box(
    gmsh: ModuleType, x0: float, x1: float, width: float, height: float, y: float = 0.0
) -> list[tuple[int, int]]:
    """Box from x0 to x1, centred on (y, 0) in y and z."""
    return _cuboid(gmsh, (x0, y - width / 2, -height / 2), (x1 - x0, width, height))


def _cuboid(gmsh: ModuleType, low: Vector, size: Vector) -> list[tuple[int, int]]:
    """Box by its lowest corner and its size; arguments in m, the model in mm."""
    return [(3, gmsh.model.occ.addBox(*(1e3 * np.array([*low, *size]))))]


def _end_faces(gmsh: ModuleType, axis: int, loaded: float) -> Faces:
    """Plane faces across an axis at 0 and at another place, in mm; every other face keeps its number."""
    names: Faces = {"fixed": [], "loaded": []}
    for _, tag in gmsh.model.getEntities(2):
        box = gmsh.model.getBoundingBox(2, tag)
        low, high = box[axis], box[axis + 3]
        flat = high - low < 1e-4
        for name, place in (("fixed", 0.0), ("loaded", loaded)):
            if flat and abs(low - place) < 1e-3:
                names[name].append(tag)
    return with_others(gmsh, names)
