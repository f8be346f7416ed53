"""A part as quadratic tetrahedra with named faces, and what the loads need from a face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.model.link.rigidfit import design_matrix
from stiffmap.model.link.transport import Ints

FLAT = 1e-9  # volume of a tetrahedron over its longest edge cubed
# Six-point rule of degree 4 on the triangle (Dunavant): points are (a, a, 1 - 2a) and permutations.
_DUNAVANT = ((0.445948490915965, 0.223381589678011), (0.091576213509771, 0.109951743655322))


@dataclass(frozen=True)
class SolidMesh:
    """Ten-node tetrahedra; corner nodes first, then edges 01, 12, 02, 03, 13, 23. SI, link axes."""

    nodes: Floats  # (n, 3) m
    tets: Ints  # (elements, 10)
    faces: dict[str, Ints]  # name -> (triangles, 6): corners, then edges 01, 12, 20

    def face(self, name: str) -> Ints:
        """Triangles of a face (k, 6); "a+b" joins faces.

        Raises:
            StiffmapError: no such face; lists those that exist, with area and centre in mm.
        """
        parts = name.split("+")
        for part in parts:
            if part not in self.faces:
                raise StiffmapError(f"no face {part!r} on this part; it has {self._listing()}")
        return np.concatenate([self.faces[p] for p in parts])

    def face_nodes(self, name: str) -> Ints:
        """Sorted node numbers of a face, mid-side nodes included."""
        return np.unique(self.face(name))

    def volume(self) -> float:
        """Volume in m³ of the straight-sided tetrahedra."""
        return float(_corner_volumes(self.nodes, self.tets).sum())

    def size(self) -> float:
        """Mean edge length in m, estimated from the mean volume of a tetrahedron."""
        return float((6 * np.sqrt(2) * self.volume() / len(self.tets)) ** (1 / 3))

    def _listing(self) -> str:
        words = []
        for name, triangles in self.faces.items():
            area, centre = face_area_centre(self.nodes, triangles)
            at = ", ".join(f"{1e3 * c:.3g}" for c in centre)
            words.append(f"{name} ({1e6 * area:.4g} mm² at {at})")
        return "; ".join(words)


def checked_mesh(nodes: Floats, tets: Ints, faces: dict[str, Ints]) -> SolidMesh:
    """The mesh, oriented and without unused nodes.

    Raises:
        StiffmapError: no tetrahedra, NaN coordinates, elements of zero volume (says which and how many).
    """
    if len(tets) == 0:
        raise StiffmapError("mesh: expected ten-node tetrahedra, found none (is the part a closed volume?)")
    if not np.all(np.isfinite(nodes)):
        raise StiffmapError("mesh: expected finite node coordinates, got NaN")
    volume = _corner_volumes(nodes, tets)
    corners = nodes[tets[:, :4]]
    edge = np.linalg.norm(corners[:, [1, 2, 3, 2, 3, 3]] - corners[:, [0, 0, 0, 1, 1, 2]], axis=2).max(axis=1)
    flat = np.abs(volume) <= FLAT * edge**3
    if flat.any():
        first = int(np.argmax(flat))
        raise StiffmapError(
            f"mesh: {int(flat.sum())} of {len(tets)} elements have zero volume, first element {first + 1}"
        )
    tets = tets.copy()
    swap = volume < 0
    tets[swap] = tets[swap][:, [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]]
    used = np.unique(tets)
    new = np.full(len(nodes), -1, dtype=np.int64)
    new[used] = np.arange(len(used))
    return SolidMesh(nodes[used], new[tets], {k: new[f] for k, f in faces.items() if np.all(new[f] >= 0)})


def face_loads(nodes: Floats, triangles: Ints, reference: Floats) -> tuple[Floats, Floats]:
    """Consistent nodal forces (n, 3, 6) of the six rigid traction modes on a face, and their Gram matrix.

    Mode j is the traction field ``[I, -S(p - reference)] e_j`` in Pa; the Gram matrix (6, 6) gives the
    resultant wrench of a mode at the reference, so ``loads @ inv(gram) @ wrench`` is the load of a wrench.
    """
    loads, gram = np.zeros((len(nodes), 3, 6)), np.zeros((6, 6))
    for shape, points, area in _face_quadrature(nodes, triangles):
        A = design_matrix(points, reference)
        gram += np.einsum("t,tia,tib->ab", area, A, A)
        for local in range(6):
            np.add.at(loads, triangles[:, local], shape[local] * area[:, None, None] * A)
    return loads, gram


def face_mass(nodes: Floats, triangles: Ints) -> csr_matrix:
    """Sparse (n, n) integral of the products of a face's shape functions, m²."""
    total = csr_matrix((len(nodes), len(nodes)))
    rows, columns = np.repeat(triangles, 6, axis=1).ravel(), np.tile(triangles, (1, 6)).ravel()
    for shape, _, area in _face_quadrature(nodes, triangles):
        values = (area[:, None, None] * np.outer(shape, shape)).ravel()
        total = total + csr_matrix((values, (rows, columns)), shape=total.shape)
    return total


def face_area_centre(nodes: Floats, triangles: Ints) -> tuple[float, Floats]:
    """Area in m² and centroid (3,) m of a face."""
    total, moment = 0.0, np.zeros(3)
    for _, points, area in _face_quadrature(nodes, triangles):
        total += float(area.sum())
        moment += area @ points
    return total, moment / total


def _face_quadrature(nodes: Floats, triangles: Ints) -> list[tuple[Floats, Floats, Floats]]:
    """Per quadrature point: shape values (6,), positions (t, 3), weight times area (t,)."""
    x, out = nodes[triangles], []
    for a, weight in _DUNAVANT:
        for corner in range(3):
            L = np.full(3, a)
            L[corner] = 1 - 2 * a
            after = np.roll(L, -1)
            shape = np.concatenate([L * (2 * L - 1), 4 * L * after])
            # Derivatives by L0 and L1 with L2 = 1 - L0 - L1.
            by = np.zeros((6, 3))
            by[[0, 1, 2], [0, 1, 2]] = 4 * L - 1
            for e, (i, j) in enumerate(((0, 1), (1, 2), (2, 0))):
                by[3 + e, i], by[3 + e, j] = 4 * L[j], 4 * L[i]
            g0 = np.einsum("n,tni->ti", by[:, 0] - by[:, 2], x)
            g1 = np.einsum("n,tni->ti", by[:, 1] - by[:, 2], x)
            area = weight * np.linalg.norm(np.cross(g0, g1), axis=1) / 2
            out.append((shape, np.einsum("n,tni->ti", shape, x), area))
    return out


def _corner_volumes(nodes: Floats, tets: Ints) -> Floats:
    a, b, c, d = (nodes[tets[:, i]] for i in range(4))
    return np.asarray(np.einsum("ei,ei->e", np.cross(b - a, c - a), d - a) / 6)
