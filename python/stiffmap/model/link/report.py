"""Text report of an identified link: the only place of the identification that knows millimetres."""

from __future__ import annotations

import numpy as np

from stiffmap.common.errors import StiffmapError
from stiffmap.model.link.estimate import SpringEstimate
from stiffmap.model.link.transport import Floats


def unit_factor(length: str) -> Floats:
    """(6, 6) factor from SI entries to mm/N, 1/N, rad/(N·mm) for "mm", ones for "m".

    Raises:
        StiffmapError: another unit.
    """
    if length not in {"m", "mm"}:
        raise StiffmapError(f'length: expected "m" or "mm", got {length!r}')
    per = np.repeat([1e3, 1.0] if length == "mm" else [1.0, 1.0], 3)
    return np.outer(per, per) / (1e3 if length == "mm" else 1.0)


def unit_name(i: int, j: int, length: str) -> str:
    """Unit of entry (i, j), zero-based: for example ``mm/N``."""
    if i < 3 and j < 3:
        return f"{length}/N"
    return f"rad/(N·{length})" if i >= 3 and j >= 3 else "1/N"


def write_report(link: SpringEstimate, length: str) -> str:
    """See :meth:`stiffmap.model.link.result.Link.report`."""
    return "\n".join([*_table(link, length), *_field_lines(link), *_matrix_lines(link)])


def _table(link: SpringEstimate, length: str) -> list[str]:
    factor = unit_factor(length)
    C, error = link.compliance * factor, link.standard_error * factor
    zero = link.insignificant
    diagonal = [(i, i) for i in range(6)]
    pairs = diagonal + [
        (i, j) for i in range(6) for j in range(6) if i != j and (i < j or not link.symmetric)
    ]
    lines = [f"{'entry':<6} {'value':>13} {'std. error':>11} {'rel.':>8}  unit"]
    for i, j in pairs:
        if zero[i, j] and i != j:
            continue
        with np.errstate(invalid="ignore", divide="ignore"):
            relative = abs(error[i, j] / C[i, j])
        mark = "  zero within the test" if zero[i, j] else ""
        numbers = f"{C[i, j]:>13.5e} {error[i, j]:>11.1e} {relative:>8.1e}"
        lines.append(f"k{i + 1}{j + 1:<4} {numbers}  {unit_name(i, j, length)}{mark}")
    names = [f"k{i + 1}{j + 1}" for i, j in pairs if zero[i, j] and i != j]
    k = float(np.nanmin(link.multiple))
    lines.append(
        f"zero within {k:.2f} standard errors (family-wise level {link.level:g} over {link.tests} entries): "
        + (", ".join(names) or "none")
        + ("; set to zero and re-estimated" if link.zeros_applied else "")
    )
    return lines


def _field_lines(link: SpringEstimate) -> list[str]:
    e, noise = link.evidence, link.evidence.noise
    size = np.sqrt(np.mean(np.sum(e.field.displacements**2, axis=2), axis=1))
    place = np.array2string(link.reference, precision=6)
    lines = [f"rigid-body residual, {e.kept.shape[1]} nodes, reference {place} m:"]
    share = np.divide(link.sigma, size, out=np.full_like(size, np.nan), where=size > 0)
    for k in range(len(size)):
        gone = int(link.outliers[k].sum())
        loose = "; NOT rigid: are these nodes of the loaded end alone?" if share[k] > 0.1 else ""
        lines.append(
            f"  case {k + 1}: sigma {link.sigma[k]:.2e} m ({share[k]:.1e} of the displacement), "
            f"{link.dof[k]} degrees of freedom, {gone} outliers{loose}"
        )
    kind = "pooled" if noise.pooled else "given" if not np.all(np.isfinite(noise.used_dof)) else "per case"
    lines.append(f"noise: {kind} (homogeneity p = {noise.homogeneity:.2g})")
    c = e.correlation
    if c is None:
        lines.append("independence of the noise: taken as given")
    elif not c.correlated:
        lines.append(f"independence of the noise: not rejected (p = {c.p_value:.2g})")
    else:
        lines.append(
            f"independence of the noise: REJECTED (p = {c.p_value:.1g}); correlation length "
            f"{1e3 * c.length:.3g} mm, {c.effective_nodes:.3g} effective nodes of {e.kept.shape[1]}, "
            f"errors enlarged by {np.sqrt(c.inflation.mean()):.3g}; "
            f"largest correlation between cases {c.repetition:.2f}"
        )
    return lines


def _matrix_lines(link: SpringEstimate) -> list[str]:
    missing = ~np.isfinite(link.compliance)
    # 0.1 is more than warping of the face and the mesh make
    wrong = link.asymmetry > 0.1 and link.symmetry_p_value < link.level
    lines = [
        f"asymmetry before symmetrisation: {link.asymmetry:.2e} of sqrt(kii kjj) "
        f"(p = {link.symmetry_p_value:.2g})"
        + ("; NOT an elastic body: compare order, units and reference of the wrenches" if wrong else ""),
        *findings(link.compliance, link.covariance),
    ]
    if np.isfinite(link.case_p_value):
        lines.append(f"agreement of the cases with one matrix: p = {link.case_p_value:.2g}")
    if missing.any():
        names = ", ".join(f"k{i + 1}{j + 1}" for i, j in np.argwhere(missing))
        lines.append(f"not identified: {names}")
    return lines


def smallest_eigenvalue(compliance: Floats, covariance: Floats) -> tuple[float, float]:
    """Smallest eigenvalue of C scaled to a unit diagonal, and its standard error (first order)."""
    size = np.sqrt(np.abs(np.diag(compliance)))
    size = np.where(size > 0, size, 1.0)
    unit = 1 / np.outer(size, size)
    value, vector = np.linalg.eigh((compliance + compliance.T) / 2 * unit)
    g = (np.outer(vector[:, 0], vector[:, 0]) * unit).ravel()
    return float(value[0]), float(np.sqrt(max(float(g @ covariance @ g), 0.0)))


def bending_lengths(compliance: Floats) -> tuple[str, dict[str, float]]:
    """Axis and lengths in m that a prismatic cantilever would have, by ratio of the entries.

    The axis is the stiffest translation, its sense that of the couplings. For one along x the lengths are
    ``sqrt(3 k22/k66)`` and ``sqrt(3 k33/k55)`` from the diagonal, ``2 k26/k66`` and ``-2 k35/k55`` from the
    couplings: all four equal the length of an ideal bar. NaN where a ratio is negative.
    """
    k = compliance
    axis = int(np.argmin(np.diag(k)[:3]))
    b, c = (axis + 1) % 3, (axis + 2) % 3
    sense = 1.0 if k[b, c + 3] - k[c, b + 3] >= 0 else -1.0
    lengths = {}
    with np.errstate(invalid="ignore", divide="ignore"):
        for across, turn in ((b, c + 3), (c, b + 3)):
            name = f"k{across + 1}{across + 1}/k{turn + 1}{turn + 1}"
            lengths[f"sqrt(3 {name})"] = float(np.sqrt(3 * k[across, across] / k[turn, turn]))
        for across, turn, sign in ((b, c + 3, sense), (c, b + 3, -sense)):
            name = f"k{across + 1}{turn + 1}/k{turn + 1}{turn + 1}"
            lengths[f"{'-' if sign < 0 else ''}2 {name}"] = float(sign * 2 * k[across, turn] / k[turn, turn])
    return f"{'-' if sense < 0 else ''}{'xyz'[axis]}", lengths


def findings(compliance: Floats, covariance: Floats) -> list[str]:
    """One line per property: positive diagonal, definiteness, lengths of an equivalent bar."""
    if np.isnan(compliance).any():
        return ["definiteness: not known, part of the matrix is not identified"]
    lines = []
    bad = [f"k{i + 1}{i + 1}" for i in range(6) if compliance[i, i] <= 0]
    lines.append("diagonal: " + (f"NOT positive: {', '.join(bad)}" if bad else "positive"))
    value, error = smallest_eigenvalue(compliance, covariance)
    sign = "positive definite" if value > 0 else "NOT positive definite"
    verdict = sign if abs(value) > 2 * error else "open"
    lines.append(f"definiteness: {verdict}; smallest eigenvalue at unit diagonal {value:.4g} ± {error:.1g}")
    axis, found = bending_lengths(compliance)
    lengths = ", ".join(f"{k} = {1e3 * v:.1f} mm" for k, v in found.items())
    lines.append(f"as a cantilever along {axis} (equal when prismatic and slender): {lengths}")
    return lines
