"""What is asked of a random machine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.model.description import Element, Joint, MachineDescription, Pose
from stiffmap.model.description.pose import Rows

from .energy import Loads
from .generate import GRAVITY, Generator

NONE = np.zeros(3)


@dataclass(frozen=True)
class Task:
    """What is asked of a machine: a pose, or drives (full name -> coordinate), and a load."""

    description: MachineDescription
    pose: Pose | None
    drives: dict[str, float] | None
    loads: Loads
    kind: str
    by_pose: bool
    """The drives' pose can be commanded as well."""


class Asking(Generator):
    """Commands and loads."""

    def _asked(
        self,
        d: MachineDescription,
        command: Pose | dict[str, float] | None,
        force: float,
        by_pose: bool,
        heavy: float = 0.5,
    ) -> Task:
        """With a force of about that size, a moment in a third of the cases, of any load type, gravity in half."""
        size = force * float(self.rng.choice([0.1, 1.0, 1.0, 3.0]))
        f = self.rng.normal(size=3) * size
        kind = str(self.rng.choice(["dead", "dead", "follower", "semitangential"]))
        moment = self.rng.normal(size=3) * size * 0.05 if self.rng.random() < 1 / 3 else NONE
        gravity = GRAVITY if self.rng.random() < heavy else NONE
        drives = command if isinstance(command, dict) else None
        pose = command if isinstance(command, Pose) else d.home if drives is None else None
        return Task(d, pose, drives, Loads(f, moment, gravity, {}), kind, by_pose)

    def _turn(self, size: float) -> np.ndarray:
        return np.asarray(Rotation.from_rotvec(self.rng.uniform(-size, size, 3)).as_matrix())

    def _inertia(self, size: float = 0.05) -> Rows:
        root = self.rng.normal(size=(3, 3))
        m = size * (root @ root.T + np.eye(3))
        (a, b, c), (d, e, f), (g, h, i) = ((m + m.T) / 2).tolist()
        return ((a, b, c), (d, e, f), (g, h, i))

    def _value(self, elements: list[Element], name: str) -> float:
        return next(e.home[0] for e in elements if isinstance(e, Joint) and e.name == name)
