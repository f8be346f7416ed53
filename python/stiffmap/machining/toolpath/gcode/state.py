"""What lines before have set, and what words mean (RS-274, as LinuxCNC's documentation has it)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import pi

MM, INCH = 1e-3, 25.4e-3
NEVER = 2**62
"""Line at which an axis is given that never is."""
AXES = "XYZ"
MOTIONS = {0.0: "G0", 1.0: "G1", 2.0: "G2", 3.0: "G3", 80.0: "G80"}
PLANES = {17.0: 2, 18.0: 1, 19.0: 0}
OFFSETS = (54.0, 55.0, 56.0, 57.0, 58.0, 59.0, 59.1, 59.2, 59.3)
CENTRES = {2: "IJ", 1: "IK", 0: "JK"}
"""Words of an arc's centre by the axis that it turns about."""
STARTS = {"distance": "G90", "feed mode": "G94", "plane": "G17", "centres": "G91.1", "offset": "G54"}
"""What is taken where a program says nothing; a controller may stand otherwise, so that a written program says it."""
IGNORED_G = {40.0, 49.0, 61.0, 61.1, 64.0, 97.0, 98.0, 99.0}
"""Without meaning for the path: modes of tracking, cancelled compensation and cycles."""
IGNORED_M = {7.0, 8.0, 9.0, 48.0, 49.0}
BREAKS_M = {0.0, 1.0, 6.0, 60.0}
"""Stops and the change of a tool: somebody may move the axes meanwhile."""
ENDS = {2.0, 30.0}
REFERENCES = {"G28", "G30"}
"""Moves to points of the machine that nobody tells: the axes are not known after them."""
GROUPS = {
    **dict.fromkeys(MOTIONS, "motion"), **dict.fromkeys(PLANES, "plane"), **dict.fromkeys(OFFSETS, "offset"),
    20.0: "unit", 21.0: "unit", 90.0: "distance", 91.0: "distance", 90.1: "centres", 91.1: "centres",
    93.0: "feed mode", 94.0: "feed mode", 61.0: "tracking", 61.1: "tracking", 64.0: "tracking", 43.0: "length", 49.0: "length",
    40.0: "compensation", 97.0: "speed", 98.0: "return", 99.0: "return", 4.0: "one line", 28.0: "one line", 30.0: "one line", 53.0: "one line",
}  # fmt: skip
"""Of two G words of one group in a line nobody knows which one holds."""
GROUPS_M = {
    **dict.fromkeys((0.0, 1.0, 2.0, 30.0, 60.0), "stop"), **dict.fromkeys((3.0, 4.0, 5.0), "spindle"),
    **dict.fromkeys((7.0, 8.0, 9.0), "coolant"), **dict.fromkeys((48.0, 49.0), "override"), 6.0: "tool",
}  # fmt: skip
REFUSED_G = {
    5.0: "splines", 5.1: "splines", 5.2: "NURBS", 10.0: "tables set by the program", 28.1: "reference points set by the program",
    30.1: "reference points set by the program", 33.0: "threads", 38.2: "probing", 41.0: "cutter radius compensation (write the path of the centre, G40)",
    42.0: "cutter radius compensation (write the path of the centre, G40)", 92.0: "offsets set by the program",
    95.0: "feed per revolution (write G94)", 96.0: "constant surface speed",
    **dict.fromkeys((73.0, 76.0, 81.0, 82.0, 83.0, 84.0, 85.0, 86.0, 87.0, 88.0, 89.0), "drilling cycles"),
}  # fmt: skip
REFUSED_M = {98.0: "subprograms", 99.0: "subprograms", 97.0: "subprograms"}


@dataclass
class ModalState:
    """Modal words; lengths of the program become m by `unit`."""

    unit: float = 0.0
    """0: neither G20 nor G21 stood yet."""
    motion: str = ""
    plane: int = 2
    absolute: bool = True
    absolute_centres: bool = False
    inverse_time: bool = False
    feed: float | None = None
    """As written: per minute, or moves per minute under G93."""
    speed: float | None = None
    """rpm."""
    spindle: int | None = None
    """1 clockwise, -1 counter-clockwise, 0 off, None: never said."""
    offset: str = "G54"
    length: int | None = None
    """Register of the tool's length (G43 H)."""
    position: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    given: list[int] = field(default_factory=lambda: [NEVER, NEVER, NEVER])
    """Line that first gives each axis by an absolute word."""
    said: set[str] = field(default_factory=set)
    """Groups of modal words of which one stood (`GROUPS`)."""
    lost: set[str] = field(default_factory=set)
    """Axes that a move to a reference point left where nobody knows."""
    breaks: int = 0
    """How often it ceased to be sure where the axes stand: another offset or length, a change of tool, a stop, an optional line."""
    turn: float = float("nan")
    """rad of the tool about its axis (C)."""
    ended: bool = False

    @classmethod
    def unknown(cls, start: Sequence[float]) -> ModalState:
        """A controller that stands where nobody knows (NaN in `start`, m) and otherwise than programs take for granted."""
        return cls(0.0, "", 0, False, True, True, offset="", position=list(start))

    @property
    def rate(self) -> float:
        """rad/s of the spindle; 0 off, NaN where the program never says."""
        if self.spindle is None:
            return float("nan") if self.speed is None else 0.0
        return self.spindle * (self.speed or 0.0) * pi / 30 if self.spindle else 0.0
