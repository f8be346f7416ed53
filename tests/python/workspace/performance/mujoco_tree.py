"""A machine rebuilt in MuJoCo from its description: the spanning tree, loops as pairs of sites.

MuJoCo supplies the mass matrix, the tree's inverse dynamics and the sites' Jacobians; closing the
loops is elementary algebra on those. No formula of stiffmap is used.
"""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.model.description import Block, Body, Joint, Offset, Spring

GRAVITY = (0.0, 0.0, -9.81)


class Tree:
    def __init__(self, machine, springs: bool, gravity=(0.0, 0.0, 0.0), x=None):
        """`x`: coordinates of the commanded pose, where springs vary with a stroke."""
        self.x = x
        self.count, self.names, self.loops, self.springs = 0, [], [], springs
        self.stiffness, self.drives = [], []
        d = machine.description
        root = _Node()
        node = self._chain(root, d.base, "")
        ends = []
        for leg in d.legs:
            ends.append(self._chain(node, leg.elements, leg.name))
        for end in ends[1:]:
            self.loops.append((self._site(ends[0]), self._site(end)))
        tip = self._chain(ends[0], d.platform, "")
        self.tip = self._site(tip)
        g = " ".join(map(repr, gravity))
        xml = (
            f'<mujoco><compiler angle="radian" boundmass="1e-11" boundinertia="1e-11" balanceinertia="false"/>'
            f'<option gravity="{g}"/><worldbody>{root.xml()}</worldbody></mujoco>'
        )
        self.model = mujoco.MjModel.from_xml_string(xml)
        self.data = mujoco.MjData(self.model)

    def _chain(self, node, elements, prefix):
        for e in elements:
            name = f"{prefix}.{e.name}" if prefix else e.name
            if isinstance(e, Offset):
                node = node.child(e.nominal.p, e.nominal.r)
            elif isinstance(e, Joint):
                for i, axis in enumerate(e.axes):
                    full = name if len(e.axes) == 1 else f"{name}.{i + 1}"
                    stiff = e.law.stiffness if e.law is not None else 0.0
                    if e.actuated:
                        self.drives.append(full)
                    node = self._joint(node, axis, e.kind == "prismatic", full, stiff)
            elif isinstance(e, Spring) and self.springs:
                if e.stiffness is not None:
                    k = np.array(e.stiffness)
                else:
                    k = np.linalg.inv(self._stretched(np.array(e.compliance), e.stroke, prefix))
                for i in range(6):
                    node = self._joint(node, np.eye(3)[i % 3], i < 3, f"{name}.{i}", k[i])
            elif isinstance(e, Body):
                node.bodies.append(e)
            elif isinstance(e, Block):
                ends = [
                    self._chain(node, b.elements, f"{prefix}.{b.name}" if prefix else b.name)
                    for b in e.branches
                ]
                self.loops.extend((self._site(ends[0]), self._site(end)) for end in ends[1:])
                node = ends[0]
        return node

    def _stretched(self, c, stroke, prefix):
        """A cantilever grown longer: stretching and turning with the length, bending with its square and cube."""
        if stroke is None:
            return c
        grown = 1 + stroke.rate * (self.x[f"{prefix}.{stroke.joint}"] - stroke.at) / stroke.length
        power = np.ones(6)
        power[[i for i in range(3) if i != stroke.along]] = 2
        return c * grown ** (power[:, None] + power - 1)

    def _joint(self, node, axis, sliding, name, stiffness):
        self.names.append(name)
        self.stiffness.append(stiffness)
        return node.child(np.zeros(3), np.eye(3), (name, axis, sliding))

    def _site(self, node):
        name = f"site{self.count}"
        self.count += 1
        node.sites.append(name)
        return name

    def put(self, x: dict[str, float], rate=None, acceleration=None):
        for name, value in x.items():
            if name in self.names:
                self.data.qpos[self.model.joint(name).qposadr[0]] = value
        self.data.qvel[:] = 0 if rate is None else rate
        self.data.qacc[:] = 0 if acceleration is None else acceleration
        mujoco.mj_forward(self.model, self.data)

    def index(self, name):
        return int(self.model.joint(name).dofadr[0])

    def mass(self):
        out = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, out)
        return out

    def jacobian(self, site):
        p, r = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
        mujoco.mj_jacSite(self.model, self.data, p, r, self.model.site(site).id)
        return np.concatenate([p, r])

    def loop_jacobian(self):
        rows = [self.jacobian(b) - self.jacobian(a) for a, b in self.loops]
        return np.concatenate(rows) if rows else np.zeros((0, self.model.nv))

    def inverse(self, rate, acceleration):
        """Forces on the joints of the open tree."""
        self.data.qvel[:], self.data.qacc[:] = rate, acceleration
        mujoco.mj_inverse(self.model, self.data)
        return self.data.qfrc_inverse.copy()


class _Node:
    def __init__(self, p=None, r=None, joint=None):
        self.p = np.zeros(3) if p is None else np.asarray(p)
        self.r = np.eye(3) if r is None else np.asarray(r)
        self.joint, self.bodies, self.children, self.sites = joint, [], [], []

    def child(self, p, r, joint=None):
        out = _Node(p, r, joint)
        self.children.append(out)
        return out

    def xml(self):
        x, y, z, w = Rotation.from_matrix(self.r).as_quat()
        text = f'<body pos="{_row(self.p)}" quat="{_row([w, x, y, z])}">'
        if self.joint:
            name, axis, sliding = self.joint
            text += f'<joint name="{name}" type="{"slide" if sliding else "hinge"}" axis="{_row(axis)}"/>'
        if self.bodies:
            text += _inertial(self.bodies)
        text += "".join(f'<site name="{s}"/>' for s in self.sites)
        return text + "".join(c.xml() for c in self.children) + "</body>"


def _inertial(bodies):
    mass = sum(b.mass for b in bodies)
    com = sum(b.mass * np.array(b.com) for b in bodies) / mass
    inertia = np.zeros((3, 3))
    for b in bodies:
        d = np.array(b.com) - com
        inertia += np.array(b.inertia) + b.mass * (d @ d * np.eye(3) - np.outer(d, d))
    i = inertia
    full = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
    if np.linalg.eigvalsh(inertia)[0] <= 1e-12:  # a rod, a point: MuJoCo wants a positive inertia
        full = [full[0] + 1e-11, full[1] + 1e-11, full[2] + 1e-11, *full[3:]]
    return f'<inertial pos="{_row(com)}" mass="{mass!r}" fullinertia="{_row(full)}"/>'


def _row(values):
    return " ".join(repr(float(v)) for v in values)
