# SPDX-License-Identifier: MIT
"""Report on the heights of a real delta printer: which errors, and which of them heights can tell apart.

    python examples/measured_delta.py [DATA]

DATA is the folder with heights.csv, distances.csv and sessions.csv; default ../shared/measured/flsun_v400_delta.
The data are not part of stiffmap; without them the script says so and ends. docs/measured_delta.md tells the result.

Nothing is fitted by hand: the change of every height with every error comes from differences of a
rod-by-rod model (each rod ends on the effector, whose tilt is solved for), and the groups are compared by evidence.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from stiffmap.identification.calibration.floor import Blocks, model_form
from stiffmap.identification.calibration.groups import compare
from stiffmap.identification.calibration.statistics import Sums

Floats = NDArray[np.float64]
DATA = Path(__file__).resolve().parents[2] / "shared" / "measured" / "flsun_v400_delta"
NOISE = 0.02
"""mm, local scatter of the heights; calipers 0.04 mm."""
SPREAD, PLATE = 50.0, 30.0
"""mm: half distance of the two rods of a tower, and radius of their ends on the effector. Assumed."""
CALIPER = 0.06
"""mm, distances on a printed object."""
BASE = ("zeros", "tower positions", "rod lengths")
PARTS = {"guide lean": ("lean {} inwards", "lean {} sideways"), "rod mismatch": ("rods {} differ",)}
SAME = 0.1
"""Share of the evidence within which two explanations are not told apart: models are no better than that."""
PAIRS = tuple((t, s) for t in range(3) for s in (-1.0, 1.0))


def read(folder: Path, name: str) -> list[dict[str, str]]:
    with (folder / name).open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


# name -> (group, standard uncertainty); mm or rad. Per tower a, b, c.
def errors() -> dict[str, tuple[str, float]]:
    out: dict[str, tuple[str, float]] = {}
    for t in "abc":
        out[f"endstop {t}"] = ("zeros", 0.2)
        out[f"arm {t}"] = ("rod lengths", 0.3)
        out[f"radius {t}"] = ("tower positions", 0.3)
        out[f"angle {t}"] = ("tower positions", 2e-3)
        out[f"lean {t} inwards"] = ("guide lean", 3e-3)
        out[f"lean {t} sideways"] = ("guide lean", 3e-3)
        out[f"rods {t} differ"] = ("rod mismatch", 0.3)
        out[f"width {t}"] = ("width", 0.3)
        out[f"scale {t}"] = ("gains", 1e-3)
    out["effector turned"] = ("effector yaw", 3e-3)
    return out


def effector(travel: Floats, session: dict[str, str], move: dict[str, float]) -> Floats:
    """(n, 6) mm, rad: pose of the effector at carriage travels (n, 3), by Newton on the six rod lengths."""
    arms = np.array([float(session[f"arm_{t}_mm"]) for t in "abc"])
    radius = float(session["delta_radius_mm"])
    angles = np.radians([float(session[f"angle_{t}_deg"]) for t in "abc"])
    ends = np.array([float(session[f"endstop_{t}_mm"]) for t in "abc"])
    at = lambda name: move.get(name, 0.0)  # noqa: E731
    height = np.sqrt(arms**2 - radius**2) + ends - travel
    upper, lower, length = [], [], []
    for k, s in PAIRS:
        t = "abc"[k]
        a = angles[k] + at(f"angle {t}")
        out, side = np.array([np.cos(a), np.sin(a), 0.0]), np.array([-np.sin(a), np.cos(a), 0.0])
        z = height[:, k] + at(f"endstop {t}") - at(f"scale {t}") * travel[:, k]
        foot = (radius + at(f"radius {t}")) * out
        away = z - height[:, k].mean()
        drift = np.outer(away, -at(f"lean {t} inwards") * out + at(f"lean {t} sideways") * side)
        nominal = np.array([np.cos(angles[k]), np.sin(angles[k]), 0.0])
        across = np.array([-nominal[1], nominal[0], 0.0])
        start = foot + PLATE * out + (SPREAD * s) * side
        upper.append(start + drift + z[:, None] * [0.0, 0.0, 1.0])
        turn = at("effector turned")
        end = PLATE * nominal + (SPREAD + at(f"width {t}") / 2) * s * across
        lower.append(end + turn * np.cross([0.0, 0.0, 1.0], end))
        length.append(arms[k] + at(f"arm {t}") + s * at(f"rods {t} differ") / 2)
    u, low, want = np.stack(upper, axis=1), np.array(lower), np.array(length)
    pose = np.zeros((len(travel), 6))
    pose[:, 2] = (height - np.sqrt(arms**2 - radius**2)).mean(axis=1)
    for _ in range(30):
        turned = low + np.cross(pose[:, None, 3:], low)
        gap = pose[:, None, :3] + turned - u
        size = np.linalg.norm(gap, axis=2)
        way = gap / size[..., None]
        slope = np.concatenate([way, np.cross(turned, way)], axis=2)
        step = np.linalg.solve(slope, (want - size)[..., None])[..., 0]
        pose = pose + step
        if np.abs(step).max() < 1e-10:
            break
    return pose


def columns(travel: Floats, session: dict[str, str], pick) -> tuple[Floats, Floats]:  # type: ignore[no-untyped-def]
    """Prediction and its change per standard uncertainty of each error."""
    base = pick(effector(travel, session, {}))
    out = [(pick(effector(travel, session, {n: 0.1 * u})) - base) / 0.1 for n, (_, u) in errors().items()]
    return base, np.stack(out, axis=-1)


def heights(folder: Path) -> tuple[Floats, Floats, NDArray[np.intp], Floats]:
    """Residuals (mm), columns, session and place of all heights; per session and kind a plane is free."""
    sessions = {s["session"]: s for s in read(folder, "sessions.csv")}
    rows = read(folder, "heights.csv")
    r, a, label, place = [], [], [], []
    for k, (name, session) in enumerate(sessions.items()):
        for kind in ("mesh", "calib7"):
            here = [row for row in rows if row["session"] == name and row["kind"] == kind]
            if not here:
                continue
            travel = np.array([[float(row[f"travel_{t}_mm"]) for t in "abc"] for row in here])
            base, change = columns(travel, session, lambda pose: pose)
            xy, z = base[:, :2], base[:, 2]
            free = np.column_stack([np.ones(len(z)), xy]) if kind == "mesh" else np.ones((len(z), 1))
            q = np.linalg.qr(free)[0]
            r.append(-(z - q @ (q.T @ z)))
            dz = change[:, 2]
            a.append(dz - q @ (q.T @ dz))
            label += [k] * len(z)
            place.append(xy)
    return np.concatenate(r), np.vstack(a), np.array(label, dtype=np.intp), np.vstack(place)


def distances(folder: Path) -> tuple[Floats, Floats]:
    """Residuals (mm) and columns of the caliper distances."""
    sessions = {s["session"]: s for s in read(folder, "sessions.csv")}
    r, a = [], []
    for name, session in sessions.items():
        here = [row for row in read(folder, "distances.csv") if row["session"] == name]
        if not here:
            continue
        ends = [
            columns(
                np.array([[float(row[f"{p}_travel_{t}_mm"]) for t in "abc"] for row in here]),
                session,
                lambda x: x[:, :3],
            )
            for p in ("p1", "p2")
        ]
        apart = ends[1][0] - ends[0][0]
        size = np.linalg.norm(apart, axis=1)
        gap = np.array([float(row["distance_measured_mm"]) for row in here]) - size
        slope = np.einsum("ni,nip->np", apart / size[:, None], ends[1][1] - ends[0][1])
        r.append(gap)
        a.append(slope)
    return np.concatenate(r), np.vstack(a)


def rms(x: Floats) -> float:
    return float(np.sqrt(np.mean(x**2)))


def held_out(r: Floats, a: Floats, label: NDArray[np.intp], which: list[int], rho: float) -> float:
    """rms of each session's heights, mm, predicted from the other sessions."""
    left = np.zeros(len(r))
    for k in np.unique(label):
        test = label == k
        t = blocks(r[~test], a[~test][:, which]).beside(rho).estimate
        left[test] = r[test] - a[test][:, which] @ t
    return rms(left)


def blocks(r: Floats, a: Floats) -> Blocks:
    return Blocks.of(a / NOISE, r / NOISE, np.arange(len(r)))


def free_per_session(
    r: Floats, a: Floats, label: NDArray[np.intp], which: list[int]
) -> tuple[Floats, Floats]:
    """Residuals and columns with some errors taken out session by session: each was calibrated anew."""
    r, a = r.copy(), a.copy()
    for k in np.unique(label):
        here = label == k
        q, size, _ = np.linalg.svd(a[here][:, which], full_matrices=False)
        q = q[:, size > 1e-6 * size[0]]
        r[here] -= q @ (q.T @ r[here])
        a[here] -= q @ (q.T @ a[here])
    return r, a


def main() -> int:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else DATA
    if not (folder / "heights.csv").is_file():
        print(f"skipped: no measured data in {folder} (heights.csv, see docs/measured_delta.md)")
        return 0
    names = errors()
    members: dict[str, list[int]] = {}
    for i, (group, _) in enumerate(names.values()):
        members.setdefault(group, []).append(i)
    raw, columns_, label, _ = heights(folder)
    print(
        f"{len(raw)} heights in {len(np.unique(label))} sessions, noise {NOISE} mm, bed a free plane per mesh"
    )
    for free in (["zeros"], ["zeros", "tower positions"]):
        told(raw, columns_, label, members, free)
    r, a = free_per_session(raw, columns_, label, members["zeros"])
    verdict(r, a, members, list(names), folder)
    return 0


def told(
    raw: Floats, columns_: Floats, label: NDArray[np.intp], members: dict[str, list[int]], free: list[str]
) -> None:
    """Held-out rms and evidence of each group beside the geometry that every delta has."""
    r, a = free_per_session(raw, columns_, label, [i for g in free for i in members[g]])
    everything = blocks(r, a)
    rho = model_form(everything)
    geometry = sorted(i for g in BASE for i in members[g])
    print(f"\nfree in each session: {', '.join(free)}; model-form floor {NOISE * np.sqrt(rho):.3f} mm")
    print(
        f"leave one session out: as saved {rms(r):.4f} mm, geometry {held_out(r, a, label, geometry, rho):.4f} mm"
    )
    choice = compare(everything.beside(rho), members, BASE)
    for g in sorted(choice.groups, key=lambda g: -g.alone):
        left = held_out(r, a, label, sorted([*geometry, *members[g.name]]), rho)
        print(f"  {g.name:15} {g.alone:7.0f} nats   held-out {left:.4f} mm")


def verdict(r: Floats, a: Floats, members: dict[str, list[int]], names: list[str], folder: Path) -> None:
    """What the heights decide, what they leave open, and what the distances add."""
    everything = blocks(r, a)
    sums = everything.beside(model_form(everything))
    geometry = sorted(i for g in BASE for i in members[g])
    at = {n: i for i, n in enumerate(names)}
    ground = sums.pick(geometry).log_evidence
    single = {}
    for kind, parts in PARTS.items():
        for t in "abc":
            which = sorted([*geometry, *(at[p.format(t)] for p in parts)])
            single[f"{kind} of {t}"] = sums.pick(which).log_evidence - ground
    best = {g: sums.pick(sorted([*geometry, *members[g]])).log_evidence - ground for g in PARTS}
    top = max(best, key=lambda g: best[g])
    gap = abs(best["guide lean"] - best["rod mismatch"]) / max(best.values())
    print(f"\none tower alone, nats: {', '.join(f'{n} {v:.0f}' for n, v in single.items())}")
    close = gap < SAME
    print(
        "verdict: "
        + ("guides lean or rods differ" if close else top)
        + f" ({100 * gap:.0f} % of the nats apart);",
        end=" ",
    )
    spread = [
        max(single[f"{k} of {t}"] for t in "abc") - min(single[f"{k} of {t}"] for t in "abc") for k in PARTS
    ]
    print(
        "the tower can't be told from heights"
        if max(spread) < SAME * max(best.values())
        else "see the towers above"
    )
    rd, ad = distances(folder)
    print(f"{len(rd)} distances: rms {rms(rd):.3f} mm as saved")
    more = Sums.of(ad / CALIPER, rd / CALIPER)
    for g in PARTS:
        which = sorted([*geometry, *members[g]])
        alone, both = sums.pick(which), (sums + more).pick(which)
        before, after = (rms(rd - ad[:, which] @ s.estimate) for s in (alone, both))
        nats = both.log_evidence - alone.log_evidence
        print(
            f"  {g:13} from heights {before:.3f} mm; fitted to both {after:.3f} mm; evidence {nats:+.0f} nats"
        )


if __name__ == "__main__":
    raise SystemExit(main())
