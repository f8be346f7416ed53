"""The arm of `arm_calibration.py` by plain least squares: held-out error and time. Needs NumPy only.

    python bench/peers/arm_least_squares.py DATA.npz

Six numbers per joint (a small motion behind its axis), a frame of the base and the place of the target, no prior and no weight; steps
of Gauss and Newton by the least-norm solution, with slopes by differences. What a student would write in an afternoon.
"""

from __future__ import annotations

import json
import sys
import time

import numpy as np

STEPS, STEP, RANK = 12, 1e-5, 1e-7


def rotations(vector):
    """(..., 3, 3) of turns (..., 3) rad, by Rodrigues' formula."""
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    x, y, z = np.moveaxis(np.asarray(vector), -1, 0)
    zero = np.zeros_like(x)
    w = np.stack([np.stack([zero, -z, y], -1), np.stack([z, zero, -x], -1), np.stack([-y, x, zero], -1)], -2)
    small = angle < 1e-12
    a = np.where(small, 1.0, np.sin(angle) / np.where(small, 1.0, angle))
    b = np.where(small, 0.5, (1 - np.cos(angle)) / np.where(small, 1.0, angle**2))
    return np.eye(3) + a * w + b * (w @ w)


def places(x, q, axes, points, target):
    """(n, 3) places of the target at the joints q (n, k): screws in base axes, x = base 6, joints 6 each, target 3."""
    k = q.shape[1]
    place = np.broadcast_to(target + x[-3:], (len(q), 3))
    for i in reversed(range(k)):
        shift, turn = x[6 + 6 * i : 9 + 6 * i], x[9 + 6 * i : 12 + 6 * i]
        place = (place - points[i]) @ rotations(turn).T + points[i] + shift
        r = rotations(q[:, i : i + 1] * axes[i])
        place = np.einsum("nij,nj->ni", r, place - points[i]) + points[i]
    return place @ rotations(x[3:6]).T + x[:3]


def fitted(q, seen, axes, points, target):
    """The numbers that explain places seen (n, 3)."""
    x = np.zeros(9 + 6 * q.shape[1])
    for _ in range(STEPS):
        slopes = []
        for h in STEP * np.eye(len(x)):
            there, back = (places(x + s * h, q, axes, points, target) for s in (1, -1))
            slopes.append((there - back).ravel() / (2 * STEP))
        left = (seen - places(x, q, axes, points, target)).ravel()
        step = np.linalg.lstsq(np.stack(slopes, axis=-1), left, rcond=RANK)[0]
        x = x + step
        if np.abs(step).max() < 1e-10:
            break
    return x


def main():
    data = np.load(sys.argv[1])
    q, seen, fold = data["q"], data["seen"][:, :3, 3], data["fold"]
    model = data["axes"], data["points"], data["zero"][:3, 3]
    squares, seconds = [], []
    for k in np.unique(fold):
        begun = time.process_time()
        x = fitted(q[fold != k], seen[fold != k], *model)
        seconds.append(time.process_time() - begun)
        squares.append(np.sum((places(x, q[fold == k], *model) - seen[fold == k]) ** 2, axis=1))
    held_out = 1e3 * float(np.sqrt(np.mean(np.concatenate(squares))))
    print(json.dumps({"held_out_mm": held_out, "seconds": float(np.mean(seconds))}))


if __name__ == "__main__":
    main()
