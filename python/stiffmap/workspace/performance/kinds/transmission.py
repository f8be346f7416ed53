"""Velocity transmission: singular values of the Jacobian (Figure 1a), and the sphere inscribed in the image of the cube (Figure 1b)."""

from __future__ import annotations

from functools import partial

from stiffmap.workspace.performance.registry import Case, Found, Measure, over_poses


def compute(case: Case, factor: str, better: str) -> Found:
    """Over all poses of the box, one field of `VelocityTransmission`."""
    v = case.factors
    return over_poses(case.positions, getattr(v, factor), better, length=v.length)


def measure(name: str, title: str, factor: str, better: str, order: int) -> Measure:
    """The measure of one field."""
    return Measure(name, title, "", better, partial(compute, factor=factor, better=better), order=order)


MEASURES = (
    measure("transmission_min", "smallest velocity transmission factor", "sphere_min", "high", 10),
    measure("transmission_max", "largest velocity transmission factor", "sphere_max", "low", 11),
    measure("condition", "condition number of the Jacobian", "condition", "low", 12),
    measure("cube_min", "speed in every direction per drive speed (cube)", "cube_min", "high", 13),
)
