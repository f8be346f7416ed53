"""Tool and holder coupled to a machine by receptance (docs/theory.md V7; Schmitz and Donaldson; Euler-Bernoulli beams)."""

from __future__ import annotations

from math import pi

import numpy as np
import xarray as xr

from stiffmap.common.broadcasting import Floats, real_array, real_number
from stiffmap.common.errors import StiffmapError
from stiffmap.workspace.vibration.poles import Complex


def beam_stiffness(
    frequency: Floats, length: float, diameter: float, modulus: float, density: float, *, nu: float = 0.3,
    loss: float = 0.0,
) -> Complex:  # fmt: skip
    """(frequencies, 12, 12) dynamic stiffness of a free round bar along z, exact for its continuous mass.

    First its end at the holder, then its tip at `length` m along z: translations, then rotations, each.
    Modulus N/m², density kg/m³, loss factor. Static at 0 Hz.
    """
    for name, v in (("length", length), ("diameter", diameter), ("modulus", modulus), ("density", density)):
        if not real_number(v, name) > 0:
            raise StiffmapError(f"{name}: expected a number above zero (SI), got {v!r}")
    E: Complex = np.asarray(modulus * (1 + 1j * loss * (frequency > 0)), complex)
    A, second = pi * diameter**2 / 4, pi * diameter**4 / 64
    w = 2 * pi * frequency
    out = np.zeros((len(w), 12, 12), complex)
    for i, j, sign in ((0, 4, 1.0), (1, 3, -1.0)):
        k = _bending(E * second, density * A * w**2, length)
        turn = np.array([1.0, sign, 1.0, sign])
        at = np.array([i, j, 6 + i, 6 + j])
        out[:, at[:, None], at] += k * np.outer(turn, turn)
    G = E / (2 * (1 + nu))
    for i, stiff, mass in ((2, E * A, density * A), (5, G * 2 * second, density * 2 * second)):
        at = np.array([i, 6 + i])
        out[:, at[:, None], at] += _stretching(stiff, mass * w**2, length)
    return out


def _bending(EI: Complex, load: Floats, length: float) -> Complex:
    """(frequencies, 4, 4) by deflection and slope at both ends; `load` is the mass per length times w²."""
    x = (load / EI) ** 0.25 * length
    small = np.abs(x) < 0.05
    y = np.where(small, 1.0, x)
    s, c, sh, ch = np.sin(y), np.cos(y), np.sinh(y), np.cosh(y)
    d = 1 - c * ch
    near, far = y**3 * (s * ch + c * sh) / d, -(y**3) * (s + sh) / d
    turn, over = y**2 * s * sh / d, y**2 * (ch - c) / d
    own, other = y * (s * ch - c * sh) / d, y * (sh - s) / d
    m = x**4  # the consistent mass where the beam hardly waves
    near, far = np.where(small, 12 - 13 / 35 * m, near), np.where(small, -12 - 9 / 70 * m, far)
    turn, over = np.where(small, 6 - 11 / 210 * m, turn), np.where(small, 6 + 13 / 420 * m, over)
    own, other = np.where(small, 4 - m / 105, own), np.where(small, 2 + m / 140, other)
    L = length
    rows = [
        [near, turn * L, far, over * L], [turn * L, own * L**2, -over * L, other * L**2],
        [far, -over * L, near, -turn * L], [over * L, other * L**2, -turn * L, own * L**2],
    ]  # fmt: skip
    return np.asarray(np.array(rows).transpose(2, 0, 1) * (EI / L**3)[:, None, None])


def _stretching(stiff: Complex, load: Floats, length: float) -> Complex:
    """(frequencies, 2, 2) along a bar, or of its torsion."""
    x = np.sqrt(load / stiff) * length
    y = np.where(np.abs(x) < 1e-4, 1.0, x)
    own = np.where(np.abs(x) < 1e-4, 1 - x**2 / 3, y / np.tan(y))
    other = np.where(np.abs(x) < 1e-4, -1 - x**2 / 6, -y / np.sin(y))
    return np.asarray(
        np.array([[own, other], [other, own]]).transpose(2, 0, 1) * (stiff / length)[:, None, None]
    )


def couple_tool(machine: xr.DataArray, tool: Complex, axes: Floats | None = None) -> xr.DataArray:
    """Receptance at the tip of a tool that is clamped to the machine's point.

    machine: (..., frequency, 6, 6) of `frequency_response`, receptance at the holder's end, without the tool's mass.
    tool: (frequencies, 12, 12) dynamic stiffness of the free tool, holder's end first (`beam_stiffness`, or the inverse of a
    measured 12x12 receptance), z of the tool pointing from the holder to its tip. axes: (3, 3) its x, y, z in base axes as
    columns; None: those of the base. Raises StiffmapError where shapes or frequencies differ.
    """
    if machine.attrs.get("kind", "receptance") != "receptance":
        raise StiffmapError(f"machine: expected a receptance, got {machine.attrs['kind']}")
    f = machine.sizes["frequency"]
    if tool.shape != (f, 12, 12):
        raise StiffmapError(f"tool: expected a dynamic stiffness of shape ({f}, 12, 12), got {tool.shape}")
    R = np.eye(3) if axes is None else real_array(axes, "axes")
    turn = np.kron(np.eye(4), R)
    D = turn @ tool @ turn.T
    whole = np.broadcast_to(D, (*machine.shape[:-3], f, 12, 12)).copy()
    whole[..., :6, :6] += np.linalg.inv(machine.values)
    tip = np.linalg.inv(whole)[..., 6:, 6:]
    out = machine.copy(data=tip)
    out.attrs["tool"] = "coupled by receptance; the response is at its tip"
    return out
