"""Springs and force laws of a file to SI."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.units import ANGLE, BENDING, DENSITY, FORCE, LENGTH, MODULUS, MOMENT, NONE, Dimension
from stiffmap.model import beams
from stiffmap.model.addresses.beam import SECTIONS
from stiffmap.model.description import BeamNumbers, Law, Spring
from stiffmap.model.description.elements import Matrix6
from stiffmap.model.files.context import Context, LinkUse, StrokeUse
from stiffmap.model.files.schema.base import Number
from stiffmap.model.files.schema.elements import SpringModel
from stiffmap.model.files.schema.springs import DIRECTIONS, Beam, LawModel, Matrix

_COMPLIANCE = {
    0: Dimension(length=1, force=-1),
    1: Dimension(force=-1, angle=1),
    2: Dimension(length=-1, force=-1, angle=1),
}
_STIFFNESS = {turns: Dimension(*(-n for n in d)) for turns, d in _COMPLIANCE.items()}


def build_spring(model: SpringModel, context: Context) -> Spring:
    """SI spring; raises `FileError` for an asymmetric or indefinite matrix and for a law on a direction
    that is coupled to others."""
    laws = tuple(
        (DIRECTIONS.index(d), build_law(law, DIRECTIONS.index(d) > 2, context.at("laws", d), f"laws.{d}"))
        for d, law in (model.laws or {}).items()
    )
    rest = tuple(
        context.si(n, ANGLE if i > 2 else LENGTH, f"rest.{DIRECTIONS[i]}")
        for i, n in enumerate(model.rest or [])
    )
    word = "stiffness" if model.stiffness is not None else "compliance"
    matrix = _spring_matrix(model, context)
    for i, _ in laws:
        if any(matrix[i][j] != 0.0 for j in range(6) if j != i):
            context.at("laws", DIRECTIONS[i]).fail(
                f"the {word} couples this direction to others; it has no law alone"
            )
    stiffness, compliance = (matrix, None) if word == "stiffness" else (None, matrix)
    if model.stroke is not None:
        context.gathered.strokes.append(StrokeUse(context.full, model, context.at("stroke")))
    beam = None if model.beam is None else _beam_numbers(model.beam, context.at("beam"))
    loss = None if model.loss_factor is None else context.si(model.loss_factor, NONE, "loss_factor")
    if loss is not None and loss < 0.0:
        context.at("loss_factor").fail(f"must not be negative; found {loss:g}")
    return Spring(model.spring, compliance, stiffness, laws, rest or (0.0,) * 6, beam=beam, loss_factor=loss)


def _spring_matrix(model: SpringModel, context: Context) -> Matrix6:
    if model.beam is not None:
        return as_rows(build_beam(model.beam, context.at("beam")))
    if model.link is not None:
        return load_link(model.link, context.at("link"))
    if model.stiffness is not None:
        return build_matrix(model.stiffness, "stiffness", context.at("stiffness"))
    if model.compliance is None:  # the schema asks for one of the four, or a table
        assert model.stroke is not None and model.stroke.table is not None
        here = context.at("stroke", "table", 0, "compliance")
        return build_matrix(model.stroke.table[0].compliance, "compliance", here)
    return build_matrix(model.compliance, "compliance", context.at("compliance"))


def build_matrix(model: Matrix, word: str, context: Context) -> Matrix6:
    """Symmetric positive semidefinite 6x6 in SI, exactly as written."""
    dimensions = _COMPLIANCE if word == "compliance" else _STIFFNESS
    matrix = np.zeros((6, 6))

    def read(number: Number, i: int, j: int) -> float:
        low, high = sorted((i, j))
        return context.si(number, dimensions[(i > 2) + (j > 2)], f"{word}.k{low + 1}{high + 1}")

    for i, row in enumerate(model.rows or []):
        matrix[i] = [read(number, i, j) for j, number in enumerate(row)]
    for i, number in enumerate(model.diagonal or []):
        matrix[i, i] = read(number, i, i)
    for key, number in (model.entries or {}).items():
        i, j = int(key[1]) - 1, int(key[2]) - 1
        matrix[i, j] = matrix[j, i] = read(number, i, j)
    _check(matrix, word, context)
    return as_rows(matrix)


def _check(matrix: NDArray[np.float64], word: str, context: Context) -> None:
    size, i, j = asymmetry(matrix)
    if size > 0.0:
        context.fail(
            f"the {word} is not symmetric: k{i + 1}{j + 1} and k{j + 1}{i + 1} differ by {size:.3g} "
            "of the geometric mean of their diagonal terms"
        )
    lowest = lowest_eigenvalue(matrix)
    if lowest < 0.0:
        context.fail(
            f"the {word} is indefinite: its lowest eigenvalue, scaled to unit diagonal, is {lowest:.3g}; "
            "it must not be negative"
        )


def build_beam(beam: Beam, context: Context) -> NDArray[np.float64]:
    """Compliance (6, 6) of a beam, SI."""
    length = _positive(beam.length, LENGTH, "length", context)
    if beam.EA is not None:
        dims = (FORCE, BENDING, BENDING, BENDING)
        given = [(name, getattr(beam, name), dim) for name, dim in zip(beam.products, dims, strict=True)]
        values = [_positive(number, dim, name, context) for name, number, dim in given]
    else:
        e, g = _moduli(beam, context)
        s = _section(beam, context)
        values = [e * s.area, g * s.torsion, e * s.about_width, e * s.about_height]
    return beams.cantilever_compliance(length, beam.along, *values)


def _beam_numbers(beam: Beam, context: Context) -> BeamNumbers:
    """What a beam that has been built was computed from, SI."""
    given: list[tuple[str, Number, Dimension]] = [("length", beam.length, LENGTH)]
    material = context.materials[beam.material] if isinstance(beam.material, str) else beam.material
    if material is None:
        dimensions = (FORCE, BENDING, BENDING, BENDING)
        pairs = zip(beam.products, dimensions, strict=True)
        given += [(name, getattr(beam, name), dimension) for name, dimension in pairs]
    else:
        sort = next(s for s in SECTIONS if getattr(beam, s) is not None)
        given += [(f"{sort}.{k}", getattr(getattr(beam, sort), k), LENGTH) for k in SECTIONS[sort][0]]
        given.append(("material.E", material.E, MODULUS))
        second, dimension = ("G", MODULUS) if material.G is not None else ("nu", NONE)
        given.append((f"material.{second}", getattr(material, second), dimension))
    return BeamNumbers(beam.along, tuple((name, context.si(n, d)) for name, n, d in given))


def beam_body(beam: Beam, context: Context) -> tuple[float, float, NDArray[np.float64]]:
    """Mass, length and inertia (3, 3) about its centre, SI, of a uniform beam with a section and a density."""
    material = beam.material
    if isinstance(material, str):
        material = context.materials.get(material)  # an unknown one is refused where the spring is built
    if beam.EA is not None or material is None or material.density is None:
        lacks = "a section" if beam.EA is not None else "a material with a density"
        context.fail(f"no mass: the beam has not {lacks}; give one, or the body's mass")
    density = _positive(material.density, DENSITY, "material.density", context)
    length, section = _positive(beam.length, LENGTH, "length", context), _section(beam, context)
    mass = density * section.area * length
    i = "xyz".index(beam.along[-1])
    about = np.zeros(3)
    about[i] = density * length * (section.about_width + section.about_height)
    about[(i + 1) % 3] = mass * length**2 / 12 + density * length * section.about_width
    about[(i + 2) % 3] = mass * length**2 / 12 + density * length * section.about_height
    return mass, length, np.diag(about)


def _moduli(beam: Beam, context: Context) -> tuple[float, float]:
    material = beam.material
    if isinstance(material, str):
        if material not in context.materials:
            known = ", ".join(context.materials) or "none"
            context.at("material").fail(f"unknown material '{material}'; declared under materials: {known}")
        material = context.materials[material]
    assert material is not None  # the schema asks for it next to a section
    e = _positive(material.E, MODULUS, "material.E", context)
    if material.G is not None:
        return e, _positive(material.G, MODULUS, "material.G", context)
    assert material.nu is not None
    return e, e / (2 * (1 + context.si(material.nu, NONE, "beam.material.nu")))


def _section(beam: Beam, context: Context) -> beams.Section:
    if beam.round is not None:
        return beams.round_section(_positive(beam.round.diameter, LENGTH, "round.diameter", context))
    if beam.tube is not None:
        outer = _positive(beam.tube.outer, LENGTH, "tube.outer", context)
        inner = _positive(beam.tube.inner, LENGTH, "tube.inner", context)
        if inner >= outer:
            context.at("tube").fail("the inner diameter must be smaller than the outer one")
        return beams.tube_section(outer, inner)
    shape, sort = (beam.rectangle, "rectangle") if beam.rectangle is not None else (beam.hollow, "hollow")
    assert shape is not None
    width = _positive(shape.width, LENGTH, f"{sort}.width", context)
    height = _positive(shape.height, LENGTH, f"{sort}.height", context)
    if beam.hollow is None:
        return beams.rectangle_section(width, height)
    wall = _positive(beam.hollow.wall, LENGTH, "hollow.wall", context)
    if 2 * wall >= min(width, height):
        context.at("hollow").fail("twice the wall must be smaller than width and height")
    return beams.hollow_section(width, height, wall)


def _positive(number: Number, dimension: Dimension, name: str, context: Context) -> float:
    if number.value <= 0.0:
        context.at(*name.split(".")).fail(f"must be positive; found {number.value}")
    return context.si(number, dimension, f"beam.{name}")


def build_law(model: LawModel, angular: bool, context: Context, name: str) -> Law:
    """SI law of a translation or a rotation."""
    stiffness = context.si(model.stiffness, _STIFFNESS[2 if angular else 0], f"{name}.stiffness")
    cubic = 0.0
    if model.cubic is not None:
        dimension = Dimension(length=1, force=1, angle=-3) if angular else Dimension(force=1, length=-3)
        cubic = context.si(model.cubic, dimension, f"{name}.cubic")
    across, along = (ANGLE, MOMENT) if angular else (LENGTH, FORCE)
    knots = tuple((context.si(a, across), context.si(f, along)) for a, f in model.knots or [])
    if any(b < a or g < f for (a, f), (b, g) in pairwise(knots)):
        context.at("knots").fail("knots must not decrease in deflection or force")
    return Law(stiffness, cubic, knots)


def load_link(name: str, context: Context) -> Matrix6:
    """Compliance of an identified link file, whose path is relative to the machine file."""
    from stiffmap.model.link import load_link as read_link  # only where a file names a link

    path = context.folder / name
    if not path.exists():
        context.fail(f"no link file '{name}' in {context.folder}")
    link = read_link(path)
    matrix = np.asarray(link.compliance, dtype=float)
    _check(matrix, "compliance", context)
    context.note(name, "link")
    _keep_covariance(name, np.asarray(link.covariance, dtype=float), context)
    return as_rows(matrix)


def _keep_covariance(name: str, covariance: NDArray[np.float64], context: Context) -> None:
    """Springs of one link file share its error, so its covariance is kept once."""
    upper = np.ravel_multi_index(np.triu_indices(6), (6, 6))
    rows = covariance[np.ix_(upper, upper)]
    if np.any(rows):
        use = LinkUse(tuple(tuple(float(v) for v in row) for row in rows))
        context.gathered.links.setdefault(name, use).springs.append(context.full)


def as_rows(matrix: ArrayLike) -> Matrix6:
    """6x6 as hashable rows."""
    return tuple(tuple(float(v) for v in row) for row in np.asarray(matrix))


SYMMETRY_TOLERANCE = 1e-12
EIGENVALUE_TOLERANCE = 1e-12


def _scale(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    scale = np.sqrt(np.abs(np.diag(matrix)))
    known = scale > 0.0
    for i in np.flatnonzero(~known):
        # a zero diagonal term has no scale of its own; its couplings, which must vanish, give one
        scale[i] = max(np.abs(matrix[i, known]) / scale[known], default=0.0)
    return np.where(scale > 0.0, scale, 1.0)


def asymmetry(matrix: NDArray[np.float64]) -> tuple[float, int, int]:
    """Largest |k_ij - k_ji| / sqrt(k_ii k_jj) with its row and column; 0 within rounding."""
    scale = _scale(matrix)
    difference = np.abs(matrix - matrix.T) / np.outer(scale, scale)
    i, j = np.unravel_index(int(np.argmax(difference)), difference.shape)
    size = float(difference[i, j])
    return (size if size > SYMMETRY_TOLERANCE else 0.0), int(i), int(j)


def lowest_eigenvalue(matrix: NDArray[np.float64]) -> float:
    """Lowest eigenvalue of the scaled matrix, where negative beyond rounding; else 0."""
    scale = _scale(matrix)
    lowest = float(np.linalg.eigvalsh(matrix / np.outer(scale, scale))[0])
    return lowest if lowest < -EIGENVALUE_TOLERANCE else 0.0
