"""Machines that are tapped: measured responses with noise and coherence, as files with their table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import stiffmap as sm
from stiffmap.model.addresses import moved
from stiffmap.model.description import Joint
from stiffmap.model.description.tree import edit
from stiffmap.workspace.vibration import tip_modes


def middle_poses(machine, count=2, seed=5):
    """Inside the workspace."""
    low, high = machine.workspace
    return low + (high - low) * np.random.default_rng(seed).uniform(0.3, 0.7, (count, 3))


def band(machine, poses, count=4, lines=400):
    """(lines,) Hz around the lowest modes that show at the tool."""
    found = tip_modes(machine, poses)
    size = np.linalg.norm(found.tip[0, :3], axis=0)
    shown = found.frequency[0][size > 1e-3 * size.max()]
    return np.linspace(0.4 * shown[0], 1.1 * shown[min(count, len(shown)) - 1], lines)


def declared(machine, ratio=0.03):
    return sm.Machine(replace(machine.description, modal_damping=(ratio,)), like=machine)


def heavier(machine, body, mass):
    return sm.Machine(moved(machine.description, f"{body}/mass", mass), like=machine)


def damped(machine, joint, damping):
    def change(e):
        return replace(e, damping=damping) if isinstance(e, Joint) else None

    return sm.Machine(edit(machine.description, joint, change), like=machine)


def tap(machine, poses, f, folder, hammer=(0.0, 0.0, 1.0), lever=(0.0, 0.0, 0.0), noise=0.01, seed=0, hits=5):
    """Files of accelerance by a hammer that the table takes to strike the TCP along +z; the path of the table."""
    rng = np.random.default_rng(seed)
    blow = np.r_[hammer, np.cross(lever, hammer)]
    rows = ["x_mm,y_mm,z_mm,response,along,hammer"]
    for k, p in enumerate(poses):
        H = sm.frequency_response(machine, p, f, kind="accelerance").values[:, :3] @ blow
        for a in range(3):
            s = np.hypot(noise * np.abs(H[:, a]), 1e-3 * np.abs(H).max())
            h = H[:, a] + s * (rng.normal(size=(2, len(f))).T @ [1, 1j]) / np.sqrt(2)
            coherence = 1 / (1 + hits * s**2 / np.abs(H[:, a]) ** 2)
            text = ["frequency_Hz,real_m/s2/N,imag_m/s2/N,coherence"]
            text += [f"{x},{v.real},{v.imag},{c}" for x, v, c in zip(f, h, coherence, strict=True)]
            name = f"p{k}{'xyz'[a]}.csv"
            (folder / name).write_text("\n".join(text) + "\n")
            rows.append(",".join(repr(1e3 * v) for v in p.tolist()) + f",{name},+{'xyz'[a]},+z")
    (folder / "taps.csv").write_text("\n".join(rows) + "\n")
    return folder / "taps.csv"
