"""Random machines of classes that nobody ships: more drives than freedoms, arms of four to nine axes, wrists behind
platforms, leaf springs without joints, cables that only pull, springs outside the legs, balls near their locks, next to
nothing at all. Each with a command and a load."""

from __future__ import annotations

from collections.abc import Callable

from .compliant import Compliant
from .driven import Driven
from .tasks import Task


class Classes(Driven, Compliant):
    """One task by one seed."""

    def task(self, name: str = "") -> Task:
        """Of the class of that name, or of a random one."""
        names = list(CLASSES)
        chosen = name or names[int(self.rng.integers(len(names)))]
        return CLASSES[chosen](self)


CLASSES: dict[str, Callable[[Classes], Task]] = {
    "over-actuated": Classes.over_actuated,
    "gantry": Classes.gantry,
    "arm of axes": Classes.arm,
    "hybrid": Classes.hybrid,
    "leaves": Classes.leaves,
    "cables": Classes.cables,
    "locked balls": Classes.locked_balls,
    "springs outside": Classes.outside,
    "hung": Classes.hung,
    "few": Classes.few,
}
