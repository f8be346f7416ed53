"""Laws that measured means are fitted with: the straight one, and those that explain why they bend; run-out from signals: the line
at the spindle's frequency, its noise taken from one revolution to the next."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from math import pi

import numpy as np
from scipy.optimize import least_squares, minimize_scalar
from scipy.special import stdtrit

from stiffmap.common.broadcasting import Floats
from stiffmap.machining.process.description import EndMill, Process, mean_force, own_arc
from stiffmap.machining.process.force import NAMES, gauss, mean_basis_with_runout, revolution
from stiffmap.machining.process.identify.table import ForceTable, Signals

REFERENCE = 1e-3
"""m: chip at which a pressure with an exponent is stated."""
BOUNDS = (-1.5, 0.98)
"""Of a fitted exponent; noise may carry one below zero."""
STEP = 1e-5
"""Of an exponent, for slopes by central differences."""


def straight_basis(p: Process) -> Floats:
    """(3, 6) mean force per unit of each coefficient."""
    zero = EndMill(0.0, 0.0)
    cuts = [replace(p, law=replace(zero, **{n: 1.0})) for n in NAMES]
    return np.stack([mean_force(c, c.cut.radial, c.cut.axial) for c in cuts], axis=1)


def power_basis(p: Process, exponents: Floats) -> Floats:
    """(3, 3) mean force per unit of three chip pressures K (h / REFERENCE)^-m, tangential, radial, axial (theory.md, M7)."""
    node, weight = gauss(100)
    first, last = own_arc(p)
    phi = first + (last - first) * (node + 1) / 2
    s, c, w = np.sin(phi), np.cos(phi), weight * (last - first) / 2 * p.tool.teeth * p.cut.axial / (2 * np.pi)
    h = p.chip * s
    t, r, a = (w * h * (h / REFERENCE) ** -m for m in exponents)
    zero = 0.0
    return np.array(
        [[(-t * c).sum(), (-r * s).sum(), zero], [(t * s).sum(), (-r * c).sum(), zero], [zero, zero, a.sum()]]
    )


def runout_basis(p: Process, runout: Floats) -> Floats:
    """(3, 6) mean force per unit of each coefficient with run-out, which may lift teeth out of the cut."""
    tool = replace(p.tool, runout=float(runout[0]), runout_angle=0.0)
    return mean_basis_with_runout(replace(p, tool=tool))


def bent_basis(p: Process, _none: Floats) -> Floats:
    """(3, 9) with a term of the square of the feed for each axis: what bends, whatever its cause."""
    return np.hstack([straight_basis(p), np.eye(3) * (p.chip / 1e-4) ** 2])


Number = tuple[float, float, float, float]
"""Value, standard uncertainty and ends of the 95 % interval (Student), SI."""


@dataclass(frozen=True)
class ForceModel:
    """A law: its basis at values of its own parameters, and what it says."""

    name: str
    words: str
    basis: Callable[[Process, Floats], Floats]
    coefficients: tuple[str, ...] = NAMES
    exponents: tuple[str, ...] = ()


STRAIGHT = ForceModel("straight", "force grows in proportion to the chip", lambda p, _: straight_basis(p))
KIENZLE = ForceModel(
    "Kienzle", "the chip pressure falls as a power of the chip's thickness", power_basis, ("Kt", "Kr", "Ka"), ("mt", "mr", "ma")
)  # fmt: skip
RUNOUT = ForceModel("run-out", "a tooth leaves the cut at the small feeds", runout_basis)
BEND = ForceModel("bend", "a square of the feed in each axis, with no cause stated", bent_basis)


@dataclass(frozen=True, eq=False)
class Fitted:
    """A law fitted to a table."""

    model: ForceModel
    values: Floats
    """(k,) coefficients: N/m² of chip (of Kienzle's law at a chip of `REFERENCE`), N/m of edge."""
    parameter: Floats
    """Exponents, or m of run-out."""
    covariance: Floats
    """Of the values; of Kienzle's law of the logarithms of its pressures and of its exponents."""
    residual: Floats
    """(n, 3) N, measured less fitted."""
    sigma: Floats
    """(3,) N, of the readings of each axis, from the residuals."""
    freedom: Floats
    """Degrees of freedom of each number (Welch and Satterthwaite: those of the axes that it rests on)."""
    left_out: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    """(n, 3) N: measured less predicted by the law fitted without that cut's feed."""

    @property
    def numbers(self) -> dict[str, Number]:
        """By name, of coefficients and exponents."""
        m, u = self.model, np.sqrt(np.diag(self.covariance))
        if not m.exponents:
            return stated(NAMES, self.values, u, self.freedom)
        k = len(self.values)
        return {
            **stated(m.coefficients, self.values, u[:k], self.freedom[:k], relative=True),
            **stated(m.exponents, self.parameter, u[k:], self.freedom[k:]),
        }

    def predict(self, p: Process) -> Floats:
        """(3,) N, mean force of a cut."""
        return np.asarray(self.model.basis(p, self.parameter) @ self.values)

    def end_mill(self, p: Process) -> dict[str, Number]:
        """Numbers of the law of chips and edges; of Kienzle's law of its secant, which has the same mean force at that feed."""
        if not self.model.exponents:
            return self.numbers
        straight = straight_basis(p)[:, ::2]

        def same(m: Floats) -> Floats:
            return np.asarray((power_basis(p, m) * straight).sum(axis=0) / (straight**2).sum(axis=0))

        value = self.values * same(self.parameter)
        turn = np.log(same(self.parameter + STEP) / same(self.parameter - STEP)) / (2 * STEP)
        by = np.hstack([np.eye(3), np.diag(turn)])
        u = np.sqrt(np.diag(by @ self.covariance @ by.T))
        edges = dict.fromkeys(NAMES[1::2], (0.0, 0.0, 0.0, 0.0))
        return {**stated(NAMES[::2], value, u, self.freedom[:3], relative=True), **edges}


def stated(
    names: Sequence[str], v: Floats, u: Floats, freedom: Floats, relative: bool = False
) -> dict[str, Number]:
    """Numbers by name; `relative`: u is of their logarithms."""
    reach = stdtrit(freedom, 0.975) * u
    far = np.exp(np.minimum(reach, 300.0))
    ends = np.sort([v / far, v * far], axis=0) if relative else np.array([v - reach, v + reach])
    each = np.array([v, np.abs(v) * u if relative else u, *ends]).T.tolist()
    return {n: (row[0], row[1], row[2], row[3]) for n, row in zip(names, each, strict=True)}


def fit(model: ForceModel, table: ForceTable, known: Floats | None = None) -> Fitted:
    """Least squares with a variance of its own for each axis; `known`: the run-out that signals show, m."""
    if not model.exponents:
        return _linear(model, table, np.zeros(0) if known is None else known)
    at = np.full(len(model.exponents), 0.3)
    for _ in range(3):  # the variances of the axes follow from the residuals
        s = _linear(model, table, at).sigma
        at = least_squares(
            lambda v, s=s: (_linear(model, table, v, s).residual / s).ravel(), at, bounds=BOUNDS
        ).x
    return _linear(model, table, at)


def _linear(model: ForceModel, table: ForceTable, parameter: Floats, sigma: Floats | None = None) -> Fitted:
    """The coefficients at values of the parameters, and what is known of both; `sigma` where it is known."""
    basis = np.stack([model.basis(p, parameter) for p in table.cuts])  # (n, 3, k)
    n, _, k = basis.shape
    free = n - (k + len(model.exponents)) / 3
    s = np.ones(3) if sigma is None else sigma
    for _ in range(3 if sigma is None else 1):
        a = (basis / s[:, None]).reshape(3 * n, k)
        size = np.linalg.norm(a, axis=0)
        size = np.where(size > 0, size, 1.0)
        values = np.linalg.lstsq(a / size, (table.force / s).ravel(), rcond=1e-12)[0] / size
        residual = table.force - basis @ values
        if sigma is None:
            s = np.maximum(np.sqrt((residual**2).sum(axis=0) / max(free, 1e-9)), 1e-9)
    if sigma is not None:
        return Fitted(model, values, parameter, np.zeros((0, 0)), residual, s, np.zeros(0))
    if model.exponents:  # slopes by the logarithms of the pressures, and by the exponents
        by = [
            [(model.basis(p, parameter + d) - model.basis(p, parameter - d)) @ values for p in table.cuts]
            for d in STEP * np.eye(len(parameter))
        ]
        basis = np.concatenate([basis * values, np.stack(by, axis=2) / (2 * STEP)], axis=2)
    a = (basis / s[:, None]).reshape(3 * n, -1)
    size = np.linalg.norm(a, axis=0)
    size = np.where(size > 0, size, 1.0)
    covariance = np.linalg.pinv((a / size).T @ (a / size)) / np.outer(size, size)
    by_axis = ((covariance @ a.T) ** 2).reshape(-1, n, 3).sum(axis=1)  # of each variance
    freedom = max(free, 1) * by_axis.sum(axis=1) ** 2 / np.maximum((by_axis**2).sum(axis=1), 1e-300)
    return Fitted(model, values, parameter, covariance, residual, s, freedom)


LARGEST, GRID = 1.5, 16
"""Feeds per tooth, and how many run-outs are tried before the best is refined."""


@dataclass(frozen=True)
class Runout:
    """Run-out that signals show."""

    offset: float
    """m: of a tool with two teeth half the difference of their radii, with more the offset of the axis."""
    interval: tuple[float, float]
    """m, ends of the 95 % interval: scatter of the feeds, and the uncertainty of the coefficients."""


def line_power(s: Signals, frequency: float) -> tuple[float, float]:
    """N² and N⁴: squared amplitudes of both axes across the tool at a frequency less their noise, and the variance of that.

    The noise is what differs from one revolution to the next; of a single revolution it is not known (NaN).
    """
    turn = np.exp(-2j * pi * frequency * (s.time - s.time[0]))
    each = 2 * (s.force[:, :2] - s.force[:, :2].mean(axis=0)) * turn[:, None]
    count = max(round(len(s.time) * float(np.median(np.diff(s.time))) * frequency), 1)
    turns = np.stack([part.mean(axis=0) for part in np.array_split(each, count)])
    power = np.abs(turns.mean(axis=0)) ** 2
    if count < 2:
        return float(power.sum()), np.nan
    noise = (np.abs(turns - turns.mean(axis=0)) ** 2).sum(axis=0) / (count - 1) / count
    variance = 2 * np.maximum(power - noise, 0) * noise + noise**2
    return float((power - noise).sum()), float(variance.sum())


def _model_power(p: Process, law: EndMill, offset: float) -> float:
    _, force = revolution(replace(p, law=law, tool=replace(p.tool, runout=offset, runout_angle=0.0)), 180, 16)
    first = 2 * force[:, :2].T @ np.exp(-2j * pi * np.arange(len(force)) / len(force)) / len(force)
    return float((np.abs(first) ** 2).sum())


def runout_of(table: ForceTable, law: Fitted) -> Runout | None:
    """From the signals of a table and a law of chips and edges; None where it has none, or the tool has one tooth."""
    if not table.signals or any(p.tool.teeth < 2 for p in table.cuts):
        return None
    lines = [line_power(s, p.spindle / (2 * pi)) for p, s in zip(table.cuts, table.signals, strict=True)]
    measured, variance = np.array(lines).T

    def predicted(offset: float, values: Floats = law.values) -> Floats:
        mill = EndMill(**dict(zip(NAMES, map(float, values), strict=True)))
        return np.array([_model_power(p, mill, offset) for p in table.cuts])

    def misfit(offset: float) -> float:
        return float(((predicted(offset) - measured) ** 2).sum())

    grid = np.linspace(0.0, LARGEST, GRID) * float(table.chip.max())
    best = int(np.argmin([misfit(v) for v in grid]))
    bounds = (grid[max(best - 1, 0)], grid[min(best + 1, GRID - 1)])
    found = minimize_scalar(misfit, bounds=bounds, method="bounded", options={"xatol": 1e-4 * grid[1]})
    offset = float(found.x)
    # near zero the power grows with the square of the run-out, which noise may carry below zero
    at, step = predicted(offset), (0.02 * grid[1]) ** 2
    slope = (predicted(float(np.sqrt(offset**2 + step))) - at) / step
    size = float(slope @ slope)
    if not size > 0:  # no coefficient across the tool
        return None
    middle = offset**2 + float(slope @ (measured - at)) / size
    free = len(measured) - 1
    left = measured - at - slope * (middle - offset**2)
    reach = float(stdtrit(free, 0.975)) * np.sqrt((left @ left) / free / size)  # feed by feed
    if np.isfinite(variance).all():  # by the noise, wider where the feeds differ by more
        birge = max(float((left**2 / np.maximum(variance, 1e-300)).mean()) * len(left) / free, 1.0)
        reach = 1.96 * np.sqrt(birge * (slope**2 @ variance)) / size
    u = np.sqrt(np.diag(law.covariance))
    moved = np.array([slope @ (predicted(offset, law.values + d) - at) / size for d in np.diag(u)])
    moved *= stdtrit(law.freedom, 0.975)
    correlation = law.covariance / np.maximum(np.outer(u, u), 1e-300)
    reach = float(np.sqrt(reach**2 + moved @ correlation @ moved))
    low, high = (float(np.sqrt(max(middle + k * reach, 0.0))) for k in (-1, 1))
    return Runout(offset, (low, max(high, offset)))
