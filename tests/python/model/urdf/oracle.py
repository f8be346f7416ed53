"""Kinematics and masses of a URDF straight from its XML, with nothing of stiffmap."""

from __future__ import annotations

import xml.etree.ElementTree as xml
from typing import Any

import numpy as np


def frame(e: Any) -> Any:
    """4x4 of an element's <origin>."""
    o = e.find("origin")
    x, y, z = (float(v) for v in (o.get("xyz", "0 0 0") if o is not None else "0 0 0").split())
    r, p, w = (float(v) for v in (o.get("rpy", "0 0 0") if o is not None else "0 0 0").split())
    cr, sr, cp, sp, cw, sw = np.cos(r), np.sin(r), np.cos(p), np.sin(p), np.cos(w), np.sin(w)
    return np.array([
        [cw * cp, cw * sp * sr - sw * cr, cw * sp * cr + sw * sr, x],
        [sw * cp, sw * sp * sr + cw * cr, sw * sp * cr - cw * sr, y],
        [-sp, cp * sr, cp * cr, z],
        [0, 0, 0, 1],
    ])  # fmt: skip


def moved(joint: Any, q: float) -> Any:
    """4x4 of a joint's motion, as a matrix exponential by its series."""
    a = joint.find("axis")
    x, y, z = np.array([float(v) for v in (a.get("xyz") if a is not None else "1 0 0").split()])
    x, y, z = np.array([x, y, z]) / (np.linalg.norm([x, y, z]) or 1.0)
    out = np.eye(4)
    if joint.get("type") == "prismatic":
        out[:3, 3] = q * np.array([x, y, z])
    elif joint.get("type") in ("revolute", "continuous"):
        k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        out[:3, :3] += np.sin(q) * k + (1 - np.cos(q)) * k @ k
    return out


class Robot:
    def __init__(self, text: str | bytes) -> None:
        self.xml = xml.fromstring(text)
        self.above = {j.find("child").get("link"): j for j in self.xml.findall("joint")}  # type: ignore[union-attr]

    def way(self, link: str) -> list[Any]:
        joint = self.above.get(link)
        return [] if joint is None else [*self.way(joint.find("parent").get("link")), joint]

    def place(self, link: str, q: dict[str, float]) -> Any:
        out = np.eye(4)
        for joint in self.way(link):
            out = out @ frame(joint) @ moved(joint, q.get(joint.get("name"), 0.0))
        return out

    def masses(self, head: str, stop: set[str], q: dict[str, float] | None = None) -> tuple[float, Any, Any]:
        """Mass, centre and inertia about that centre of all links behind `head` and not behind `stop`, in the frame of
        `head`: sums of m, m c and of the 4x4 second moments."""
        q, second = q or {}, np.zeros((4, 4))
        start = np.linalg.inv(self.place(head, q))
        for link in self.xml.findall("link"):
            name = str(link.get("name"))
            behind = [str(j.find("child").get("link")) for j in self.way(name)]
            inertial = link.find("inertial")
            if head not in behind or stop & set(behind) or inertial is None:
                continue
            m = float(inertial.find("mass").get("value"))  # type: ignore[union-attr, arg-type]
            if m == 0:  # a placeholder
                continue
            i = {k: float(v) for k, v in inertial.find("inertia").attrib.items()}  # type: ignore[union-attr]
            tensor = np.array([[i[f"i{min(a, b)}{max(a, b)}"] for a in "xyz"] for b in "xyz"])
            own = np.zeros((4, 4))
            own[:3, :3], own[3, 3] = np.trace(tensor) / 2 * np.eye(3) - tensor, m
            t = start @ self.place(name, q) @ frame(inertial)
            second += t @ own @ t.T
        m, c = second[3, 3], second[:3, 3] / second[3, 3]
        about = second[:3, :3] - m * np.outer(c, c)
        return m, c, np.trace(about) * np.eye(3) - about
