"""Platforms on straight lines (an eye, a drive along the line and a free ball): as machines, and as bodies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.model.description import (
    Body,
    CommandError,
    Joint,
    Law,
    Leg,
    MachineDescription,
    Offset,
    Pose,
)

from .complex_steps import At, Bodies, Force, Line, Moment, Part

UNITS = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@dataclass(frozen=True)
class Suspension:
    """SI. Anchors in the base, attachments in the tip's frame; the law is that of every line."""

    anchors: np.ndarray
    attachments: np.ndarray
    tip: np.ndarray
    stiffness: float
    slack: float = 0.0
    """Stiffness under push; 0: the line pushes as it pulls."""
    offset: float = 0.0
    """Of every command: negative, the lines are shorter than they should be."""
    mass: float = 0.0
    com: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def law(self) -> Law:
        knots = ((-0.4, -0.4 * self.slack), (0.0, 0.0)) if self.slack else ()
        return Law(self.stiffness, knots=knots)

    def machine(self, axes: str = "xyz") -> MachineDescription:
        """With the balls' axes in this order."""
        legs = []
        for i, (a, b) in enumerate(zip(self.anchors, self.attachments, strict=True)):
            line = self.tip + b - a
            length = float(np.linalg.norm(line))
            r = towards(line / length)
            legs.append(
                Leg(
                    f"{i + 1}",
                    (
                        Offset("anchor", Pose.of(a, r)),
                        Joint("eye", "universal", (UNITS["x"], UNITS["y"]), (0.0, 0.0)),
                        Joint(
                            "line",
                            "prismatic",
                            (UNITS["z"],),
                            (length,),
                            actuated=True,
                            law=self.law(),
                            command_errors=(CommandError(offset=self.offset),) if self.offset else (),
                        ),
                        Joint("ball", "spherical", tuple(UNITS[k] for k in axes), (0.0, 0.0, 0.0)),
                        Offset("plate", Pose.of(-r.T @ b, r.T)),
                    ),
                )
            )
        body = (Body("load", self.mass, self.com),) if self.mass else ()
        return MachineDescription("suspension", tuple(legs), platform=body, home=Pose.of(self.tip))

    def bodies(
        self, p: np.ndarray, r: np.ndarray, wrench: np.ndarray, gravity: np.ndarray | None = None
    ) -> Bodies:
        """At a commanded pose, under a dead force and a semitangential moment."""
        parts: list[Part] = []
        for a, b in zip(self.anchors, self.attachments, strict=True):
            free = np.linalg.norm(p + r @ b - a) + self.offset
            parts.append(Line(At(None, a), At(0, b), self.spring(float(free))))
        parts += [Force(At(0, np.zeros(3)), wrench[:3]), Moment(0, wrench[3:], r)]
        if gravity is not None and self.mass:
            parts.append(Force(At(0, np.array(self.com)), self.mass * gravity))
        return Bodies([(p, r)], parts)

    def spring(self, free: float) -> Callable[[complex], complex]:
        def energy(length: complex) -> complex:
            d = length - free
            pushes = self.slack if self.slack and d.real < 0 else self.stiffness
            return pushes * d * d / 2

        return energy


def towards(z: np.ndarray) -> np.ndarray:
    """(3, 3) with this third column."""
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.8 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def cables(seed: int, number: int = 8) -> Suspension:
    """Long cables from above and below, or from above alone, tensioned by commands that are too short."""
    rng = np.random.default_rng(seed)
    turn = 2 * np.pi * np.arange(number) / number + rng.uniform(-0.15, 0.15, number)
    low = np.arange(number) % 2 == 1
    radius = rng.uniform(1.0, 1.2, number)
    anchors = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.where(low, 0.05, 1.9)])
    anchors[:, 2] += rng.uniform(-0.04, 0.04, number)
    swap = turn + np.where(low, 0.7, -0.7)
    attachments = np.column_stack(
        [0.2 * np.cos(swap), 0.2 * np.sin(swap), np.where(low, -0.1, 0.1) + rng.uniform(-0.02, 0.02, number)]
    )
    return Suspension(
        anchors,
        attachments,
        np.array([0.02, -0.03, 0.95]),
        stiffness=9e5,
        slack=0.1,
        offset=-9e-4,
        mass=60.0,
        com=(0.005, -0.008, 0.03),
    )


def struts(seed: int) -> Suspension:
    """Six struts, the first one upright below the tip: its ball turns as the platform does."""
    rng = np.random.default_rng(seed)
    turn = np.array([0, 0, 2.1, 2.2, 4.2, 4.3]) + rng.uniform(-0.1, 0.1, 6)
    anchors = np.column_stack([0.5 * np.cos(turn), 0.5 * np.sin(turn), rng.uniform(-0.05, 0.05, 6)])
    swap = turn + np.array([0, 0.9, -0.9, 0.9, -0.9, 0.9])
    attachments = np.column_stack([0.25 * np.cos(swap), 0.25 * np.sin(swap), rng.uniform(-0.1, 0.1, 6)])
    anchors[0], attachments[0] = 0.0, 0.0
    return Suspension(anchors, attachments, np.array([0.0, 0.0, 0.8]), stiffness=2e7)


def turned(axis: str, degrees: float) -> np.ndarray:
    return np.asarray(Rotation.from_euler(axis, degrees, degrees=True).as_matrix())
