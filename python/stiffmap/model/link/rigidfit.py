"""Rigid-body fit of one load case's displacement field: linearised and exact (docs/link.md §1)."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.model.link.transport import skew, twist_transport


class RigidFit(NamedTuple):
    """Twist of the reference point and what the fit leaves behind."""

    twist: Floats  # (6,) m, rad
    factor: Floats  # (6, 6): covariance of the twist is sigma^2 * factor
    residual: Floats  # (n, 3) m
    dof: int  # 3 n - 6

    @property
    def rss(self) -> float:
        """Sum of the squared residuals, m²."""
        return float(np.sum(self.residual**2))


def design_matrix(points: Floats, reference: Floats) -> Floats:
    """(n, 3, 6) blocks [I, -S(p - reference)]: a node's displacement from the twist, link (1)."""
    A = np.zeros((len(points), 3, 6))
    A[:, :, :3] = np.eye(3)
    A[:, :, 3:] = -skew(points - reference)
    return A


def fit_factor(points: Floats, reference: Floats) -> Floats:
    """(6, 6) covariance of the fitted twist for unit noise: the paper's (19) carried from the centroid
    to the reference point, where t gains a rotation term and a cross term, link (4).
    """
    centre = points.mean(axis=0)
    A = design_matrix(points, centre).reshape(-1, 6)
    T = twist_transport(reference - centre)
    return np.asarray(T @ np.linalg.inv(A.T @ A) @ T.T)


def fit_linear(points: Floats, displacements: Floats, reference: Floats) -> RigidFit:
    """Least squares for (14)/(15) of the paper with the sign ``phi x p``, by (16) with ``n I``: link (2).

    Args:
        points: (n, 3) m.
        displacements: (n, 3) m.
        reference: (3,) m.
    """
    centre = points.mean(axis=0)
    S = -skew(points - centre)
    phi = np.linalg.solve(np.einsum("nki,nkj->ij", S, S), np.einsum("nki,nk->i", S, displacements))
    at_centroid = displacements.mean(axis=0)
    residual = displacements - at_centroid - S @ phi
    twist = np.concatenate([at_centroid + np.cross(phi, reference - centre), phi])
    return RigidFit(twist, fit_factor(points, reference), residual, 3 * len(points) - 6)


def fit_exact(points: Floats, displacements: Floats, reference: Floats) -> RigidFit:
    """Exact minimum of (13) over orthogonal matrices, by the SVD of Procrustes: link (3).

    The angular part of the twist is the rotation vector; arguments as in :func:`fit_linear`.
    """
    centre, moved = points.mean(axis=0), points + displacements
    moved_centre = moved.mean(axis=0)
    U, _, Vt = np.linalg.svd((points - centre).T @ (moved - moved_centre))
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(Vt.T @ U.T))])
    R = Vt.T @ flip @ U.T
    residual = moved - moved_centre - (points - centre) @ R.T
    t = moved_centre + R @ (reference - centre) - reference
    twist = np.concatenate([t, Rotation.from_matrix(R).as_rotvec()])
    return RigidFit(twist, fit_factor(points, reference), residual, 3 * len(points) - 6)


def turn_back(points: Floats, displacements: Floats) -> Floats:
    """(n, 3) m: what is left of a field of finite rotation, in body axes, after its exact fit."""
    fit = fit_exact(points, displacements, points.mean(axis=0))
    return np.asarray(fit.residual @ Rotation.from_rotvec(fit.twist[3:]).as_matrix())


def parting_rotation(points: Floats, reference: Floats, sigma: float, axis: Floats) -> float:
    """Rotation, rad, at which the linearised and the exact estimate part by one standard error.

    A noise-free rotation about ``axis`` (3,) through the centroid is fitted linearly; the answer is the
    smallest angle at which any component of the twist is off by its standard error at noise ``sigma`` (m).
    It is pi when they never part.
    """
    n, centre = axis / np.linalg.norm(axis), points.mean(axis=0)
    error = sigma * np.sqrt(np.diag(fit_factor(points, reference)))

    def gap(angle: float) -> float:
        R = Rotation.from_rotvec(angle * n).as_matrix()
        fit = fit_linear(points, (points - centre) @ (R - np.eye(3)).T, reference).twist
        t = (R - np.eye(3)) @ (reference - centre)
        return float(np.max(np.abs(fit - np.concatenate([t, angle * n])) - error))

    grid = np.concatenate([[0.0], np.geomspace(1e-8, np.pi, 60)])
    for low, high in itertools.pairwise(grid):
        if gap(high) > 0:
            return float(brentq(gap, low, high)) if gap(low) < 0 else float(low)
    return float(np.pi)
