"""Where an instrument stands and where its target sits on the tool, without a guess of either.

Targets are seen at ``B = Y A X``: A the commanded tool frame in base axes, Y the base in the instrument's
frame (one per set-up), X the target in the tool's frame (one per target). The start is in closed form: turns
from the logarithms of relative rotations (F. C. Park, B. J. Martin, "Robot sensor calibration: solving AX = XB
on the Euclidean group", IEEE T-RA 10, 1994), shifts by linear least squares. Then Gauss-Newton on all frames
at once on the exact poses, outliers weighed down.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Mask
from stiffmap.experiment.experiment import Floats, Integers

STEPS, ROUGH = 60, 8
"""Of a fit at most; of one whose size alone matters, which is off by less than a tenth then."""
DONE = 1e-12
"""m, rad: last step of a fit that has come to rest."""
ARM = 0.2
"""m: how far apart the starts of a target's place are where no orientation is seen; and how far from the tool's point
it may sit (one standard deviation) as far as the readings leave that open, as they do where the tool hardly turns: an
orientation that is measured, times a metre, would make errors of position out of errors of angle."""
ROWS = 30.0
"""Rows that are worth as much as all rows are: they share the machine's errors."""
PAIRS = 400
"""Relative rotations that the closed form takes."""
HUBER = 3.0
"""Robust standard deviations beyond which a reading's weight falls."""
LATE = 1e-3
"""Weight of a target's shift against an instrument's, where only one of them can be known."""
PARALLEL = 1e-3
"""Second singular value of the relative turns, over the first: below it they have one axis only."""

ERROR = 0.01
"""m: a machine whose tool is off by more was not commanded in the frame of the readings."""
SAME = 0.1
"""Share of the size of the commanded pattern, at most, by which readings of it differ once their own frame is found."""
FEWEST, MOST = 5, 2000
"""Rows that show a frame, and of which it is found at most."""


@dataclass
class Frames:
    """Instruments and targets: rotations (k, 3, 3) and translations (k, 3), m."""

    base_r: Floats
    base_p: Floats
    tool_r: Floats
    tool_p: Floats


@dataclass(frozen=True, eq=False)
class Sighting:
    """What was commanded and seen; n rows."""

    p: Floats
    r: Floats
    """(n, 3), (n, 3, 3) commanded tool frame."""
    q: Floats
    m: Floats
    """(n, 3), (n, 3, 3) target in the instrument's frame; NaN where not seen."""
    setup: Integers
    target: Integers
    tool_unknown: bool = True
    turn_unknown: bool = True
    """Whether the target's orientation on the tool is unknown as well."""
    placed: Mask = field(init=False)
    turned: Mask = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "placed", np.isfinite(self.q).all(axis=1))
        object.__setattr__(self, "turned", np.isfinite(self.m).all(axis=(1, 2)))


def find_frames(s: Sighting, steps: int = STEPS) -> Frames:
    """Frames of instruments and targets of best fit, in so many `steps` from each start at most."""
    refined = (_refined(s, f, steps) for f in _starts(s))
    return min(refined, key=lambda f: float(np.sum(np.abs(_linear(s, f)[0]))))


def own_frame(seen: Floats, commanded: Floats, rotation: Floats | None = None) -> Frames | None:
    """Where an instrument stands, if places (n, 3) m that it saw lie far from the commanded ones, but in their pattern; else None.

    With the commanded orientations (n, 3, 3) the target may sit anywhere on the tool.
    """
    good = np.flatnonzero(np.isfinite(seen).all(axis=1) & np.isfinite(commanded).all(axis=1))
    if len(good) < FEWEST:
        return None
    some = good[:: max(1, len(good) // MOST)]
    p, q = commanded[some], seen[some]
    other = np.random.default_rng(0).permutation(len(p))
    shrunk = rotation is None and _middle(q - q[other]) < 0.5 * _middle(p - p[other])
    if _middle(q - p) <= ERROR or shrunk:  # another frame keeps distances: small differences need no fit
        return None
    turn = np.tile(np.eye(3), (len(p), 1, 1)) if rotation is None else rotation[some]
    one = np.zeros(len(p), dtype=np.intp)
    s = Sighting(p, turn, q, np.full_like(turn, np.nan), one, one, tool_unknown=rotation is not None)
    found = find_frames(s)
    alike = _middle(as_commanded(s, found)[0]) < SAME * _middle(p - np.median(p, axis=0))
    return found if alike else None


def turns_apart(commanded: Floats, seen: Floats, setup: Integers, target: Integers) -> float:
    """Median angle, rad, by which seen orientations (n, 3, 3) differ from commanded ones once instruments and targets are turned to fit."""
    zero = np.zeros((len(seen), 3))
    s = Sighting(zero, commanded, np.full_like(zero, np.nan), seen, setup, target)
    return _middle(as_commanded(s, _starts(s)[0])[1])


def places_apart(p: Floats, r: Floats, seen: Floats, setup: Integers, target: Integers) -> float:
    """Median distance, m, of places (n, 3) that were seen from where targets on the tool are at commanded poses (n, 3), (n, 3, 3), once
    instruments and targets are moved to fit, to a tenth; infinite where fewer than half of the places, or than `FEWEST`, have a pose."""
    read = np.isfinite(seen).all(axis=1)
    good = read & np.isfinite(p).all(axis=1)
    if good.sum() < max(FEWEST, read.sum() // 2):
        return np.inf
    s = Sighting(p[good], r[good], seen[good], np.full((good.sum(), 3, 3), np.nan), setup[good], target[good])
    return _middle(as_commanded(s, find_frames(s, ROUGH))[0])


def _middle(vectors: Floats) -> float:
    return float(np.median(np.linalg.norm(vectors, axis=1)))


def unmoved(s: Sighting) -> Frames:
    """Instruments at the base and targets at the tool."""
    setups, targets = int(s.setup.max()) + 1, int(s.target.max()) + 1
    turns = np.tile(np.eye(3), (setups, 1, 1)), np.tile(np.eye(3), (targets, 1, 1))
    return Frames(turns[0], np.zeros((setups, 3)), turns[1], np.zeros((targets, 3)))


def as_commanded(s: Sighting, f: Frames) -> tuple[Floats, Floats]:
    """(n, 3) and (n, 3) in base axes: seen minus commanded. The tool's position and rotation vector where the
    orientation is seen, else the target's position."""
    y, x = f.base_r[s.setup], f.tool_r[s.target]
    turn = np.swapaxes(y, 1, 2) @ np.nan_to_num(s.m) @ np.swapaxes(x, 1, 2)
    held = np.where(s.turned[:, None, None], turn, s.r)
    at = np.einsum("nji,nj->ni", y, s.q - f.base_p[s.setup])
    shift = at - s.p - np.einsum("nij,nj->ni", held, f.tool_p[s.target])
    safe = np.where(s.turned[:, None, None], turn, np.eye(3))
    error = Rotation.from_matrix(safe @ np.where(s.turned[:, None, None], np.swapaxes(s.r, 1, 2), np.eye(3)))
    return shift, np.where(s.turned[:, None], error.as_rotvec(), np.nan)


def _starts(s: Sighting) -> list[Frames]:
    setups, targets = int(s.setup.max()) + 1, int(s.target.max()) + 1
    tool_r = np.tile(np.eye(3), (targets, 1, 1))
    if s.turned.any() and s.turn_unknown and s.tool_unknown:
        tool_r = np.stack([_tool_turn(s, k) for k in range(targets)])
    if s.turned.any():
        base_r = np.stack([_base_turn(s, tool_r, k) for k in range(setups)])
        return [_shifted(s, Frames(base_r, np.zeros((setups, 3)), tool_r, np.zeros((targets, 3))))]
    # No orientation: a rigid fit for each of a few places of the target; the refinement does the rest.
    arms = [np.zeros(3)]
    if s.tool_unknown:
        arms += [sign * ARM * a for a in np.eye(3) for sign in (1, -1)]
    return [_rigid(s, tool_r, np.tile(arm, (targets, 1)), setups) for arm in arms]


def _pairs(s: Sighting, rows: Integers) -> tuple[Integers, Integers]:
    rng = np.random.default_rng(0)
    i, k = rng.integers(0, len(rows), (2, PAIRS))
    i, k = rows[i], rows[k]
    same = (s.setup[i] == s.setup[k]) & (i != k)
    return i[same], k[same]


def _tool_turn(s: Sighting, target: int) -> Floats:
    """(3, 3) orientation of a target on the tool; unity where all turns have one axis, which leaves it open."""
    i, k = _pairs(s, np.flatnonzero(s.turned & (s.target == target)))
    a = Rotation.from_matrix(np.swapaxes(s.r[i], 1, 2) @ s.r[k]).as_rotvec()
    b = Rotation.from_matrix(np.swapaxes(s.m[i], 1, 2) @ s.m[k]).as_rotvec()
    if len(a) < 2:
        return np.eye(3)
    spread = np.linalg.svd(a, compute_uv=False)
    if spread[1] < PARALLEL * spread[0] or not spread[0] > 0:
        return np.eye(3)
    return np.asarray(Rotation.align_vectors(a, b)[0].as_matrix())


def _base_turn(s: Sighting, tool_r: Floats, setup: int) -> Floats:
    here = np.flatnonzero(s.turned & (s.setup == setup))
    if not here.size:
        return np.eye(3)
    x = tool_r[s.target[here]]
    turns = s.m[here] @ np.swapaxes(x, 1, 2) @ np.swapaxes(s.r[here], 1, 2)
    return np.asarray(Rotation.from_matrix(turns).mean().as_matrix())


def _shifted(s: Sighting, f: Frames) -> Frames:
    """The frames with shifts that fit best for their turns; a target's place that the plan leaves open stays at the tool."""
    residual, columns = _linear(s, f)
    weight = np.tile([1.0, 1.0, 1.0, 0.0, 0.0, 0.0], len(f.base_r) + len(f.tool_r))
    weight[6 * len(f.base_r) :] *= LATE
    _move(f, -weight * np.linalg.lstsq(columns * weight, residual, rcond=1e-9)[0])
    return f


def _rigid(s: Sighting, tool_r: Floats, tool_p: Floats, setups: int) -> Frames:
    """Each instrument by the rigid motion that fits best (W. Kabsch 1976) for given places of the targets."""
    out = Frames(np.tile(np.eye(3), (setups, 1, 1)), np.zeros((setups, 3)), tool_r, tool_p)
    at = s.p + np.einsum("nij,nj->ni", s.r, tool_p[s.target])
    for k in range(setups):
        here = np.flatnonzero(s.placed & (s.setup == k))
        if here.size < 3:
            continue
        a, b = at[here], s.q[here]
        a0, b0 = a.mean(axis=0), b.mean(axis=0)
        u, _, vt = np.linalg.svd((b - b0).T @ (a - a0))
        flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
        out.base_r[k] = u @ flip @ vt
        out.base_p[k] = b0 - out.base_r[k] @ a0
    return out


def _refined(s: Sighting, f: Frames, steps: int) -> Frames:
    """Gauss-Newton on all frames; steps of least norm, so that what the plan leaves open stays."""
    for _ in range(steps):
        residual, columns = _linear(s, f)
        far = np.abs(residual) / max(HUBER * _typical(residual), 1e-15)
        weight = np.sqrt(1.0 / np.maximum(far, 1.0))
        near, slopes = _near_the_tool(s, f, residual, columns.shape[1])
        residual, columns = np.append(residual, near), np.vstack([columns, slopes])
        weight = np.append(weight, np.ones(len(near)))
        size = np.linalg.norm(columns, axis=0)
        scale = np.where(size > 0, size, 1.0)
        step = -np.linalg.lstsq((columns / scale) * weight[:, None], residual * weight, rcond=1e-9)[0] / scale
        _move(f, step)
        if np.abs(step).max(initial=0.0) < DONE:
            break
    return f


def _near_the_tool(s: Sighting, f: Frames, residual: Floats, unknown: int) -> tuple[Floats, Floats]:
    """Places of unknown targets over `ARM`, in the size of the residuals, and their derivative."""
    if not (s.tool_unknown and s.placed.any()):
        return np.zeros(0), np.zeros((0, unknown))
    scale = _typical(residual) * max(float(s.placed.sum()) / ROWS, 1.0) ** 0.5 / ARM
    places = np.arange(unknown).reshape(-1, 6)[len(f.base_r) :, :3].ravel()
    return (scale * f.tool_p).ravel(), scale * np.eye(unknown)[places]


def _typical(residual: Floats) -> float:
    return 1.4826 * float(np.median(np.abs(residual))) if residual.size else 0.0


def _linear(s: Sighting, f: Frames) -> tuple[Floats, Floats]:
    """Residual of all rows, angles as lengths at the size of the motion, and its derivative.

    Positions are judged at the target, on the commanded orientation: errors of angle shall not move it by the lever.
    """
    turn = as_commanded(s, f)[1] if s.turned.any() else np.zeros_like(s.p)
    at = np.einsum("nji,nj->ni", f.base_r[s.setup], s.q - f.base_p[s.setup])
    shift = at - s.p - np.einsum("nij,nj->ni", s.r, f.tool_p[s.target])
    setups, targets = len(f.base_r), len(f.tool_r)
    n, unknown = len(s.p), 6 * setups + 6 * targets
    d, rows = np.zeros((n, 6, unknown)), np.arange(n)
    y, x = 6 * s.setup, 6 * (setups + s.target)
    for axis, e in enumerate(np.eye(3)):
        d[rows, axis, y + axis] = -1.0
        d[rows, :3, y + 3 + axis] = -np.cross(e, at)
        d[rows, 3:, y + 3 + axis] = -e
        if not s.tool_unknown:
            continue
        d[rows, :3, x + axis] = -s.r[:, :, axis]
        if s.turn_unknown:
            d[rows, 3:, x + 3 + axis] = -s.r[:, :, axis]
    size = max(float(np.linalg.norm(np.ptp(s.p, axis=0))), 1e-3)
    residual = np.hstack([shift, turn * size])
    d[:, 3:] *= size
    good = np.repeat(np.column_stack([s.placed, s.turned]), 3, axis=1)
    return residual[good], d[good]


def _move(f: Frames, step: Floats) -> None:
    base, tool = np.split(step.reshape(-1, 6), [len(f.base_r)])
    # instrument: the base moves by a small motion in base axes
    f.base_p = f.base_p + np.einsum("kij,kj->ki", f.base_r, base[:, :3])
    f.base_r = f.base_r @ Rotation.from_rotvec(base[:, 3:]).as_matrix()
    f.tool_p = f.tool_p + tool[:, :3]
    f.tool_r = Rotation.from_rotvec(tool[:, 3:]).as_matrix() @ f.tool_r
