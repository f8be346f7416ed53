"""Frequency response of shipped machines by MuJoCo's mass matrix and Jacobians, linearised about the commanded pose.

`python -m tests.python.workspace.vibration.mujoco_frf` prints the largest difference of each machine. The loops are closed by elementary
algebra on MuJoCo's Jacobians; joints have viscous dampers, springs loss factors of their own. No formula of stiffmap is used.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg
from tests.python.workspace.performance.mujoco_tree import Tree

import stiffmap as sm
from stiffmap.model.description import Body, Joint, Offset, Spring
from stiffmap.model.description.tree import all_elements, core_name, edit_sequences
from stiffmap.workspace.performance.motion.closing import drive_kinematics

FREQUENCIES = np.array([0.0, 3.0, 8.0, 17.0, 31.0, 60.0, 140.0])


def machine_of(name):
    """With masses where none are declared, a damper in every joint, a loss factor for every spring."""
    d = sm.load_machine(name).description
    mass = 2700 * np.pi * 0.15**2 / 4 * 0.75
    across = mass * (0.75**2 / 12 + 0.15**2 / 16)
    inertia = ((mass * 0.15**2 / 8, 0.0, 0.0), (0.0, across, 0.0), (0.0, 0.0, across))

    def change(elements):
        out = []
        for i, e in enumerate(elements):
            if name == "tripteron" and isinstance(e, Offset) and e.name.endswith("_length"):
                out.append(Body(e.name[:-7] + "_body", mass, (0.375, 0.0, 0.0), inertia))
            if isinstance(e, Joint):
                e = replace(e, damping=(200.0 if e.kind == "prismatic" else 0.5) * (1 + 0.3 * i))
            elif isinstance(e, Spring):
                e = replace(e, loss_factor=0.01 * (1 + i % 4))
            out.append(e)
        return tuple(out)

    legs = tuple(replace(leg, elements=edit_sequences(leg.elements, change)) for leg in d.legs)
    tool = (Body("tool", 5.0, inertia=((0.01, 0.0, 0.0), (0.0, 0.02, 0.0), (0.0, 0.0, 0.015))),)
    platform = edit_sequences(d.platform, change) + (tool if name == "tripteron" else ())
    return sm.Machine(replace(d, legs=legs, base=edit_sequences(d.base, change), platform=platform))


def pose_of(machine):
    low, high = machine.workspace
    return (low + high) / 2 + np.where(high - low > 0.01, np.array([0.01, -0.02, 0.015]), 0.0)


def linearised(machine, p):
    """Tip Jacobian (6, k), stiffness, losses, mass and dampers (k, k) of the motions that keep the loops closed."""
    k = drive_kinematics(machine, p)
    x = dict(zip(machine.compiled.names.coordinates, k.coordinates, strict=True))
    tree = Tree(machine, springs=True, x=x)
    tree.put(x)
    n = tree.model.nv
    stiffness, dampers = np.zeros((n, n), complex), np.zeros(n)
    group = {}
    for joint, row in zip(tree.names, tree.stiffness, strict=True):
        i = tree.index(joint)
        if np.ndim(row) == 0:
            stiffness[i, i] = row
        else:
            group.setdefault(joint.rsplit(".", 1)[0], []).append((i, row))
    elements = {
        core_name(full): e for full, e in all_elements(machine.description) if isinstance(e, Joint | Spring)
    }
    lossy = np.zeros((n, n))
    for name, rows in group.items():
        index = [i for i, _ in rows]
        block = np.array([row for _, row in rows])
        stiffness[np.ix_(index, index)] = block
        loss = (elements.get(name) or elements[core_name(name)]).loss_factor
        lossy[np.ix_(index, index)] = (loss or 0.0) * block
    for name, e in elements.items():
        if isinstance(e, Joint):
            for full in [name] if len(e.axes) == 1 else [f"{name}.{i + 1}" for i in range(len(e.axes))]:
                dampers[tree.index(full)] = e.damping or 0.0
    held = [tree.index(s) for s in machine.free_spins]
    held += [tree.index(a) for a in machine.actuators if elements[core_name(a)].law is None]
    free = [i for i in range(n) if i not in held]
    J = tree.loop_jacobian()[:, free]
    Z = scipy.linalg.null_space(J, rcond=1e-9) if len(J) else np.eye(len(free))
    tip = tree.jacobian(tree.tip)[:, free] @ Z
    take = np.ix_(free, free)
    K, E, M = (Z.T @ a[take] @ Z for a in (stiffness, lossy, tree.mass()))
    C = Z.T @ np.diag(dampers[free]) @ Z
    return tip, K, E, M, C


def expected(machine, p):
    """(frequencies, 6, 6) m/N and the like."""
    tip, K, E, M, C = linearised(machine, p)
    w = 2 * np.pi * FREQUENCIES
    return np.array(
        [tip @ np.linalg.solve(K + 1j * np.sign(v) * E + 1j * v * C - v**2 * M, tip.T) for v in w]
    )


def modes(machine, p, count):
    """(count,) Hz and (count, 3) directions of the tool, lowest first, of those that move it."""
    tip, K, _, M, _ = linearised(machine, p)
    mu, X = scipy.linalg.eigh(M, K.real)
    order = np.argsort(-mu)
    b = (tip @ X[:, order])[:3]
    size = np.linalg.norm(b, axis=0)
    keep = np.flatnonzero((mu[order] > 1e-12 * mu.max()) & (size > 1e-3 * size[: 4 * count].max()))[:count]
    return 1 / (2 * np.pi * np.sqrt(mu[order][keep])), (b[:, keep] / size[keep]).T


def difference(name):
    """Largest of all entries and frequencies, relative to the largest entry of its block at that frequency."""
    machine = machine_of(name)
    p = pose_of(machine)
    by_hand = expected(machine, p)
    found = sm.frequency_response(machine, p, FREQUENCIES, gravity=[0.0, 0.0, 0.0])
    off = 0.0
    for rows in (slice(0, 3), slice(3, 6)):
        for columns in (slice(0, 3), slice(3, 6)):
            a, b = found.values[:, rows, columns], by_hand[:, rows, columns]
            size = np.abs(by_hand[:, rows, rows]).max(axis=(1, 2)) * np.abs(by_hand[:, columns, columns]).max(
                axis=(1, 2)
            )
            off = max(off, float((np.abs(a - b).max(axis=(1, 2)) / np.sqrt(size)).max()))
    return off


if __name__ == "__main__":
    table = {name: difference(name) for name in sm.machine_names()}
    for name, off in sorted(table.items(), key=lambda row: -row[1]):
        print(f"{name:22s} {off:.1e}")
