"""The link file that a machine's ``spring: {link: file}`` names: YAML, SI, with covariance and provenance."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError, unknown_name
from stiffmap.common.outputs import write_text
from stiffmap.common.yaml_text import read
from stiffmap.model.link.transport import standard_errors, unit_diagonal

SYMMETRY = 1e-6  # of sqrt(C_ii C_jj)
UNITS = {"length": "m", "force": "N", "angle": "rad"}
KEYS = ("kind", "name", "units", "reference", "compliance", "covariance", "standard_error", "provenance")


@dataclass(frozen=True)
class LinkFile:
    """What a machine needs of an identified link: SI, link axes."""

    compliance: Floats  # (6, 6)
    covariance: Floats  # (36, 36) row-major
    reference: Floats  # (3,) m
    provenance: dict[str, Any]
    name: str = "link"

    @property
    def standard_error(self) -> Floats:
        """(6, 6) standard errors of the entries."""
        return standard_errors(self.covariance)


def save_link(link: LinkFile, path: str | Path) -> None:
    """Write the file; numbers keep all their digits, so it loads back equal.

    Raises:
        StiffmapError: the path cannot be written; a compliance that `load_link` would refuse.
    """
    data = {
        "kind": "stiffmap-link",
        "name": link.name,
        "units": UNITS,
        "reference": link.reference.tolist(),
        "compliance": link.compliance.tolist(),
        "covariance": link.covariance.tolist(),
        "provenance": link.provenance,
    }
    check_semidefinite(path, "compliance", _array(path, data, "compliance", (6, 6)))
    check_semidefinite(path, "covariance", _array(path, data, "covariance", (36, 36)))
    text = yaml.safe_dump(data, sort_keys=False, default_flow_style=None, width=10_000, allow_unicode=True)
    write_text(path, text)


def load_link(path: str | Path) -> LinkFile:
    """Read a link file. ``covariance`` may be left out or replaced by ``standard_error`` (6, 6), independent.

    Raises:
        StiffmapError: no such file, not a link file, missing or unknown key, units, wrong shape, NaN, a compliance or
            covariance that is not symmetric (with the size of the asymmetry) or not positive semidefinite.
    """
    data = _read(path)
    if data.get("units") != UNITS:
        raise StiffmapError(f"{path}: units: expected {UNITS}, got {data.get('units')}")
    C = _array(path, data, "compliance", (6, 6))
    check_semidefinite(path, "compliance", C)
    C = C / 2 + C.T / 2  # digits that a file rounds
    V = np.zeros((36, 36))
    if "covariance" in data:
        V = _array(path, data, "covariance", (36, 36))
        check_semidefinite(path, "covariance", V)
    elif "standard_error" in data:
        error = _array(path, data, "standard_error", (6, 6))
        if error.min() < 0:
            raise StiffmapError(f"{path}: standard_error: expected numbers from 0 on, got {error.min():.3g}")
        V = np.diag(error.ravel() ** 2)
    provenance = data.get("provenance") or {}
    return LinkFile(C, V, _array(path, data, "reference", (3,)), provenance, str(data.get("name", "link")))


def _read(path: str | Path) -> dict[str, Any]:
    if not Path(path).exists():
        raise StiffmapError(f"{path}: no such link file")
    data = read(Path(path)).data
    if not isinstance(data, dict) or data.get("kind") != "stiffmap-link":
        raise StiffmapError(f"{path}: expected a link file (kind: stiffmap-link), made by `stiffmap link`")
    for key in set(data) - set(KEYS):
        raise StiffmapError(f"{path}: {unknown_name('key', str(key), KEYS)}")
    if {"covariance", "standard_error"} <= set(data):
        raise StiffmapError(f"{path}: expected covariance or standard_error, found both")
    return data


def _array(path: str | Path, data: dict[str, Any], key: str, shape: tuple[int, ...]) -> Floats:
    if key not in data:
        raise StiffmapError(f"{path}: missing key {key!r}")
    try:
        a = np.array(data[key], dtype=float)
    except (TypeError, ValueError):
        raise StiffmapError(f"{path}: {key}: expected numbers of shape {shape}") from None
    if a.shape != shape or not np.all(np.isfinite(a)):
        raise StiffmapError(f"{path}: {key}: expected finite numbers of shape {shape}, got shape {a.shape}")
    return a


def check_semidefinite(path: str | Path, key: str, C: Floats) -> None:
    """StiffmapError where a matrix is not symmetric, or has a direction in which it is negative."""
    d = np.diag(C)
    if np.any(d < 0):
        why = "; wrenches are loads on the link, not reactions, with moments at the reference"
        said = f"{path}: {key}: expected a diagonal that is not negative, got {d.min():.3g}"
        raise StiffmapError(said + why * (key == "compliance"))
    with np.errstate(over="ignore", invalid="ignore"):  # numbers of 1e308 have no finite ratio
        scaled = unit_diagonal(C)
        gap = float(np.abs(scaled - scaled.T).max())
    if not gap <= SYMMETRY:
        raise StiffmapError(
            f"{path}: {key}: expected a symmetric matrix, got |C - C^T| = {gap:.1e} of sqrt(Cii Cjj)"
        )
    lowest = float(np.linalg.eigvalsh(scaled / 2 + scaled.T / 2)[0])
    if lowest < -1e-9:
        raise StiffmapError(
            f"{path}: {key}: expected no negative eigenvalue, got {lowest:.2g} (at a unit diagonal)"
        )
