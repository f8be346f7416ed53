"""Springs, force laws and strokes of a file to SI; strokes once all joints of the machine are known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from stiffmap.common.errors import unknown_name
from stiffmap.common.units import ANGLE, LENGTH, Dimension
from stiffmap.model import beams
from stiffmap.model.description import (
    BeamNumbers,
    BeamStroke,
    Joint,
    Law,
    MachineDescription,
    Spring,
    TableStroke,
)
from stiffmap.model.description.numbers import DIRECTIONS
from stiffmap.model.description.strokes import Matrix6, as_rows, entry_dimension
from stiffmap.model.description.tree import all_elements, edit
from stiffmap.model.files.build_values import build_numbers
from stiffmap.model.files.context import Context, Gathered, LinkUse
from stiffmap.model.files.schema.base import FileModel, Number
from stiffmap.model.files.schema.elements import SpringModel
from stiffmap.model.files.schema.springs import Beam, LawModel, MaterialModel, Matrix


def build_spring(model: SpringModel, context: Context) -> Spring:
    """SI spring; raises `FileError` for an asymmetric or indefinite matrix and for a law on a direction
    that is coupled to others."""
    laws = tuple(
        (DIRECTIONS.index(d), build_law(law, DIRECTIONS.index(d) > 2, context.at("laws", d), f"laws.{d}"))
        for d, law in (model.laws or {}).items()
    )
    numbers = build_numbers(model, Spring, False, context)
    word = "stiffness" if model.stiffness is not None else "compliance"
    beam = None if model.beam is None else build_beam(model.beam, context.at("beam"))
    matrix = _spring_matrix(model, context) if beam is None else beams.compliance(beam)
    for i, _ in laws:
        if any(matrix[i][j] != 0.0 for j in range(6) if j != i):
            context.at("laws", DIRECTIONS[i]).fail(
                f"the {word} couples this direction to others; it has no law alone"
            )
    stiffness, compliance = (matrix, None) if word == "stiffness" else (None, matrix)
    if model.stroke is not None:
        context.gathered.strokes.append((model, context.at("stroke")))
    return Spring(model.spring, compliance, stiffness, laws, beam=beam, **numbers)


def _spring_matrix(model: SpringModel, context: Context) -> Matrix6:
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
    matrix = np.zeros((6, 6))

    def read(number: Number, i: int, j: int) -> float:
        low, high = sorted((i, j))
        return context.si(number, entry_dimension(word, i, j), f"{word}.k{low + 1}{high + 1}")

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
    scale = _scale(matrix)
    size = np.outer(scale, scale)
    gap = np.abs(matrix - matrix.T) / size
    i, j = np.unravel_index(int(np.argmax(gap)), gap.shape)
    if gap[i, j] > SYMMETRY_TOLERANCE:
        context.fail(
            f"the {word} is not symmetric: k{i + 1}{j + 1} and k{j + 1}{i + 1} differ by {gap[i, j]:.3g} "
            "of the geometric mean of their diagonal terms"
        )
    lowest = float(np.linalg.eigvalsh(matrix / size)[0])
    if lowest < -EIGENVALUE_TOLERANCE:
        context.fail(
            f"the {word} is indefinite: its lowest eigenvalue, scaled to unit diagonal, is {lowest:.3g}; "
            "it must not be negative"
        )


def build_beam(beam: Beam, context: Context) -> BeamNumbers:
    """What a beam is computed from, SI; raises `FileError` where the numbers make no beam."""
    length = _read(beam, ("length",), context)
    if beam.EA is not None:
        return BeamNumbers(beam.along, (*length, *_read(beam, beams.products(beam.along), context)))
    material = _material(beam, context)
    if material is None:
        known = ", ".join(context.materials) or "none"
        context.at("material").fail(f"unknown material '{beam.material}'; declared under materials: {known}")
    shear = "G" if material.G is not None else "nu"
    moduli = _read(material, ("E", shear), context, "material.")
    return BeamNumbers(beam.along, (*length, *_section(beam, context)[1], *moduli))


def _read(
    holder: FileModel, keys: Sequence[str], context: Context, prefix: str = ""
) -> tuple[tuple[str, float], ...]:
    """Numbers of a beam, SI, by their keys."""
    out = []
    for key in keys:
        full, given = prefix + key, getattr(holder, key)
        if fault := beams.number_fault(full, given.value):
            context.at(*full.split(".")).fail(f"{fault}; found {given.value}")
        out.append((full, context.si(given, beams.dimension(full), f"beam.{full}")))
    return tuple(out)


def _material(beam: Beam, context: Context) -> MaterialModel | None:
    """None where none of this name is declared."""
    return context.materials.get(beam.material) if isinstance(beam.material, str) else beam.material


def _section(beam: Beam, context: Context) -> tuple[str, tuple[tuple[str, float], ...]]:
    """Which section a beam has, and its numbers."""
    sort = next(s for s in beams.SECTIONS if getattr(beam, s) is not None)
    numbers = _read(getattr(beam, sort), beams.lengths(sort), context, f"{sort}.")
    fault = beams.section_fault(sort, dict(numbers))
    if fault:
        context.at(sort).fail(fault)
    return sort, numbers


def beam_body(beam: Beam, context: Context) -> tuple[float, float, NDArray[np.float64]]:
    """Mass, length and inertia (3, 3) about its centre, SI, of a uniform beam with a section and a density."""
    material = _material(beam, context)  # an unknown one is refused where the spring is built
    if beam.EA is not None or material is None or material.density is None:
        lacks = "a section" if beam.EA is not None else "a material with a density"
        context.fail(f"no mass: the beam has not {lacks}; give one, or the body's mass")
    ((_, density),) = _read(material, ("density",), context, "material.")
    ((_, length),) = _read(beam, ("length",), context)
    sort, numbers = _section(beam, context)
    s = beams.section(sort, dict(numbers))
    mass = density * s.area * length
    i = "xyz".index(beam.along[-1])
    about = np.zeros(3)
    about[i] = density * length * (s.about_width + s.about_height)
    about[(i + 1) % 3] = mass * length**2 / 12 + density * length * s.about_width
    about[(i + 2) % 3] = mass * length**2 / 12 + density * length * s.about_height
    return mass, length, np.diag(about)


def build_law(model: LawModel, angular: bool, context: Context, name: str) -> Law:
    """SI law of a translation or a rotation."""
    law = Law(**build_numbers(model, Law, angular, context, f"{name}."))
    if any(b < a or g < f for (a, f), (b, g) in pairwise(law.knots)):
        context.at("knots").fail("knots must not decrease in deflection or force")
    return law


def load_link(name: str, context: Context) -> Matrix6:
    """Compliance of an identified link file, whose path is relative to the machine file."""
    from stiffmap.model.link import load_link as read_link  # only where a file names a link

    path = context.folder / name
    if not path.exists():
        context.fail(f"no link file '{name}' in {context.folder}")
    link = read_link(path)
    _check(link.compliance, "compliance", context)
    context.gathered.notes[f"{context.full}/link"] = name
    _keep_covariance(name, link.covariance, context)
    return as_rows(link.compliance)


def _keep_covariance(name: str, covariance: NDArray[np.float64], context: Context) -> None:
    """Springs of one link file share its error, so its covariance is kept once."""
    upper = np.ravel_multi_index(np.triu_indices(6), (6, 6))
    rows = covariance[np.ix_(upper, upper)]
    if np.any(rows):
        use = LinkUse(as_rows(rows))
        context.gathered.links.setdefault(name, use).springs.append(context.full)


SYMMETRY_TOLERANCE = 1e-12
EIGENVALUE_TOLERANCE = 1e-12


def _scale(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    scale = np.sqrt(np.abs(np.diag(matrix)))
    known = scale > 0.0
    for i in np.flatnonzero(~known):
        # a zero diagonal term has no scale of its own; its couplings, which must vanish, give one
        scale[i] = max(np.abs(matrix[i, known]) / scale[known], default=0.0)
    return np.where(scale > 0.0, scale, 1.0)


def with_strokes(description: MachineDescription, gathered: Gathered) -> MachineDescription:
    """The machine with the strokes that its file gives; problems are kept in ``gathered``."""
    for spring, context in gathered.strokes:
        stroke = context.attempt(_stroke, description, spring, context)
        if stroke is not None:
            put = lambda e, s=stroke: replace(e, stroke=s) if isinstance(e, Spring) else None  # noqa: E731
            description = edit(description, context.full, put) or description
    return description


def _stroke(
    description: MachineDescription, spring: SpringModel, context: Context
) -> BeamStroke | TableStroke:
    model = spring.stroke
    assert model is not None
    joint = stroke_joint(description, model.joint, context)
    coordinate = LENGTH if joint.kind == "prismatic" else ANGLE
    if model.table is None:
        return _beam_stroke(spring, context, joint, coordinate)
    at = tuple(context.at("table", i, "at").si(row.at, coordinate) for i, row in enumerate(model.table))
    for i in range(1, len(at)):
        if at[i] <= at[i - 1]:
            context.at("table", i, "at").fail("the coordinates of a table must rise")
    quiet = replace(context, gathered=Gathered())  # uncertainties are those of the first row
    rows = tuple(
        build_matrix(row.compliance, "compliance", quiet.at("table", i, "compliance"))
        for i, row in enumerate(model.table)
    )
    for end in (*joint.home, *(joint.ends or ())):
        if not at[0] <= end <= at[-1]:
            say = context.units.say
            context.at("table").fail(
                f"the table goes from {say(at[0], coordinate)} to {say(at[-1], coordinate)}, "
                f"'{model.joint}' to {say(end, coordinate)}"
            )
    return TableStroke(model.joint, at, rows)


def _beam_stroke(spring: SpringModel, context: Context, joint: Joint, coordinate: Dimension) -> BeamStroke:
    model, beam = spring.stroke, spring.beam
    assert model is not None
    length, along = model.length or (beam and beam.length), model.along or (beam and beam.along)
    assert length and along  # the schema asks for them
    per = Dimension(*(a - b for a, b in zip(LENGTH, coordinate, strict=True)))
    out = BeamStroke(
        model.joint,
        length=context.si(length, LENGTH),
        along="xyz".index(along[-1]),
        at=0.0 if model.at is None else context.at("at").si(model.at, coordinate),
        rate=context.at("rate").si(model.rate or Number(value=1.0), per),
    )
    for end in (*joint.home, *(joint.ends or ())):
        left = out.length + out.rate * (end - out.at)
        if left <= 0.0:
            say = context.units.say
            context.fail(
                f"with '{model.joint}' at {say(end, coordinate)} the beam would be {say(left, LENGTH)} long"
            )
    return out


def stroke_joint(description: MachineDescription, name: str, context: Context) -> Joint:
    """The joint that the spring at this place varies with; raises `FileError`."""
    joints = {n: e for n, e in all_elements(description) if isinstance(e, Joint) and len(e.axes) == 1}
    scope = context.full
    while scope:
        scope = scope.rpartition(".")[0]
        found = joints.get(f"{scope}.{name}" if scope else name)
        if found is not None:
            return found
    own = context.full.partition(".")[0]
    near = [n.partition(".")[2] if n.partition(".")[0] == own else n for n in joints]
    raise context.at("joint").error(unknown_name("joint of one axis", name, near))
