"""What lines before have set, what each code does to that, and which words of a line go together (RS-274, as LinuxCNC's
documentation has it)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import pi
from typing import NoReturn

from stiffmap.machining.toolpath.gcode.words import fail

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
TRACKING = {"G64": "PQ", "G187": "PE", "G5": "P", "G5.1": "Q", "G8": "P"}
"""Modes of how closely corners are tracked, and their words (LinuxCNC; Haas; Fanuc, where other words make two of them splines)."""
IGNORED_G = {15.0, 40.0, 49.0, 67.0, 69.0, 92.1, 92.2, 97.0, 98.0, 99.0}
"""Without meaning for the path: cancelled compensation, offsets, cycles and what is refused (`REFUSED_G`)."""
IGNORED_M = {7.0, 8.0, 9.0, 48.0, 49.0}
BREAKS_M = {0.0, 1.0, 6.0, 60.0}
"""Stops and the change of a tool: somebody may move the axes meanwhile."""
ENDS = {2.0, 30.0}
REFERENCES = {"G28", "G30"}
"""Moves to points of the machine that nobody tells: the axes are not known after them."""
GROUPS = {
    **dict.fromkeys(MOTIONS, "motion"), **dict.fromkeys(PLANES, "plane"), **dict.fromkeys(OFFSETS, "offset"),
    20.0: "unit", 21.0: "unit", 90.0: "distance", 91.0: "distance", 90.1: "centres", 91.1: "centres",
    93.0: "feed mode", 94.0: "feed mode", **dict.fromkeys((5.0, 5.1, 8.0, 61.0, 61.1, 64.0, 187.0), "tracking"), 43.0: "length", 49.0: "length",
    40.0: "compensation", 97.0: "speed", 98.0: "return", 99.0: "return", 4.0: "one line", 28.0: "one line", 30.0: "one line", 50.0: "one line", 53.0: "one line",
}  # fmt: skip
"""Of two G words of one group in a line nobody knows which one holds."""
GROUPS_M = {
    **dict.fromkeys((0.0, 1.0, 2.0, 30.0, 60.0), "stop"), **dict.fromkeys((3.0, 4.0, 5.0), "spindle"),
    **dict.fromkeys((7.0, 8.0, 9.0), "coolant"), **dict.fromkeys((48.0, 49.0), "override"), 6.0: "tool",
}  # fmt: skip
REFUSED_G = {
    54.1: "offsets beyond G59 (write G54)", 154.0: "offsets beyond G59 (write G54)", **dict.fromkeys((70.0, 700.0), "Siemens's inches (write G20)"), **dict.fromkeys((71.0, 710.0), "Siemens's mm (write G21)"), 5.2: "NURBS", 10.0: "tables set by the program", 16.0: "polar coordinates", 28.1: "reference points set by the program",
    30.1: "reference points set by the program", 33.0: "threads", 38.2: "probing", 41.0: "cutter radius compensation (write the path of the centre, G40)",
    42.0: "cutter radius compensation (write the path of the centre, G40)", 92.0: "offsets set by the program",
    51.0: "scaling", 51.1: "mirror images", 52.0: "offsets set by the program", 65.0: "macros", 66.0: "macros",
    68.0: "rotations of the axes", 68.2: "tilted planes", 43.4: "positions of a tilted tool (write G43)", 95.0: "feed per revolution (write G94)", 96.0: "constant surface speed",
    **dict.fromkeys((73.0, 76.0, 81.0, 82.0, 83.0, 84.0, 85.0, 86.0, 87.0, 88.0, 89.0), "drilling cycles"),
}  # fmt: skip
REFUSED_M = dict.fromkeys((97.0, 98.0, 99.0), "subprograms are not read")


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


LETTERS = frozenset("XYZCIJKRFSTHPQEN")
MOVING = "XYZCIJKR"
STRAIGHT = ("G0", "G1")


class Codes:
    """Acts on the words of one line after the other; `notes` says what was taken without being acted on."""

    def __init__(self, file: str, offsets: Mapping[str, Sequence[float]] | None = None) -> None:
        """`offsets`: work offsets by name (``G54``), m."""
        self.file, self.state, self.notes, self.optional = file, ModalState(), dict[str, int](), False
        self.begun, self.moves, self.number, self._stops = False, 0, 0, list[str]()
        self.actions: list[tuple[str, int]] = []
        """Words that act but do not move, each with the number of moves before it."""
        self.offsets = {k: tuple(map(float, v)) for k, v in (offsets or {}).items()}

    def fail(self, message: str) -> NoReturn:
        """Raise an error at the line that is read."""
        fail(self.file, self.number, message)

    def note(self, text: str) -> None:
        """Keep a sentence with the first line that it is about."""
        self.notes.setdefault(text, self.number)

    def stop(self) -> None:
        """What stops a program does so after the motion of its line."""
        if self._stops:
            self.actions += [(word, self.moves) for word in self._stops]
            self._stops = []

    def one_line(self, values: dict[str, float], own: set[str], motion: str) -> None:
        """G4, G28, G30, G53, which hold for their line."""
        s = self.state
        moving = not values.keys().isdisjoint(MOVING)
        if "G53" in own and (motion or (moving and s.motion)) not in STRAIGHT:
            self.fail("G53 goes with G0 or G1")
        if "G53" in own and not s.absolute:
            self.fail("G53 needs absolute positions (G90)")
        if "G53" in own and moving and not self.offsets:
            self.note("G53 and no work offset is given: the machine's origin is taken to lie at the part's")
        if "G50" in own and (moving or "S" in values):
            self.fail("G50 with other words: origins and largest speeds set by the program are not read")
        if "G4" in own:
            if not values.get("P", -1.0) >= 0:
                self.fail("G4 needs the time of the dwell: P of zero or more")
            if moving:
                self.fail("a dwell (G4) and a motion in one line: expected two lines")
            self.actions.append((f"G4 P{values['P']:g}", self.moves))
        for word in sorted(own & REFERENCES):
            if motion:
                self.fail(f"{word} and {motion} in one line: both take the axes")
            if not values.keys().isdisjoint("IJKR"):
                self.fail(f"I, J, K and R go with G2 or G3, not with {word}")
            s.lost |= {a for a in AXES if a in values} or set(AXES)
            s.breaks += 1
            self.note(
                f"{word}: where the reference point lies is not known; nothing may be cut before the axes are given again"
            )

    def sort(self, words: tuple[tuple[str, float], ...]) -> tuple[dict[str, float], set[str], str]:
        """Values by letter, words that hold for this line only, and the motion of the line."""
        values: dict[str, float] = {}
        own: set[str] = set()
        motion = ""
        groups: dict[str, str] = {}
        for letter, value in words:
            if letter == "G" or letter == "M":
                group = (GROUPS if letter == "G" else GROUPS_M).get(value)
                if group:
                    word = f"{letter}{value:g}"
                    if word == "G80" and group in groups:
                        continue  # many programs cancel cycles in the line that starts: G0 G17 G40 G49 G80 G90
                    if groups.get(group, "G80") != "G80":
                        what = "two motions" if group == "motion" else "two words that exclude each other"
                        self.fail(f"{what} in one line: {groups[group]} and {word}")
                    groups[group] = word
                if group == "motion":
                    motion = MOTIONS[value]
                elif letter == "G":
                    self._g(value, own)
                else:
                    self._m(value, "spindle" in groups)
            elif letter in LETTERS:
                if letter in values:
                    self.fail(f"{letter} is given twice")
                values[letter] = value
            elif letter not in "AB" or value:  # a table that stays at zero turns no part
                what = "rotary and secondary axes are not read" if letter in "ABUVW" else "unknown word"
                self.fail(f"{what}: {letter}{value:g}")
        tracking = groups.get("tracking", "")
        if tracking in ("G5", "G5.1") and (
            TRACKING[tracking] not in values or not values.keys().isdisjoint(MOVING)
        ):
            self.fail(f"{tracking}: splines are not read")
        for letter in [w for w in "QE" if w in values and w not in TRACKING.get(tracking, "")]:
            self.fail(f"unknown word: {letter}{values[letter]:g}")
        if "unit" in groups and "F" in values:
            self.note("F in a line that changes the unit is taken in the new one; LinuxCNC takes the old one")
        self._numbers(values, own, motion or self.state.motion, groups)
        return values, own, motion

    def _g(self, value: float, own: set[str]) -> None:
        s = self.state
        if value in PLANES:
            s.plane = PLANES[value]
        elif value in (20.0, 21.0):
            unit = INCH if value == 20.0 else MM
            if s.unit and s.feed is not None and not s.inverse_time:
                s.feed *= s.unit / unit  # it keeps its speed
            s.unit = unit
        elif value in (90.0, 91.0):
            s.absolute = value == 90.0
        elif value in (90.1, 91.1):
            s.absolute_centres = value == 90.1
        elif value in (93.0, 94.0):
            s.inverse_time, s.feed = value == 93.0, None
        elif value in OFFSETS:
            s.breaks += s.offset != f"G{value:g}" or "offset" not in s.said
            if not self.offsets and s.offset != f"G{value:g}" and "offset" in s.said:
                self.note("several work offsets and none is given: all are taken to lie at the part's origin")
            s.offset = f"G{value:g}"
            if self.offsets and s.offset not in self.offsets:
                self.fail(f"no work offset {s.offset}; given: {', '.join(self.offsets)}")
        elif value in (4.0, 28.0, 30.0, 43.0, 50.0, 53.0):
            own.add(f"G{value:g}")
        elif GROUPS.get(value) == "tracking":
            self.note(f"G{value:g}: how closely the controller tracks corners is not simulated")
        elif value not in IGNORED_G:
            why = REFUSED_G.get(value)
            self.fail(
                f"G{value:g}: {why or 'unknown word'}{' are not read' if why and '(' not in why else ''}"
            )
        if (group := GROUPS.get(value)) in STARTS:
            s.said.add(group)

    def _m(self, value: float, turning: bool) -> None:
        if GROUPS_M.get(value) == "stop":
            self._stops.append(f"M{value:g}")
        else:
            self.actions.append((f"M{value:g}", self.moves))
        if value in (3.0, 4.0, 5.0):
            self.state.spindle = {3.0: 1, 4.0: -1, 5.0: 0}[value]
        elif value in ENDS:
            self.state.ended = True
        elif value in BREAKS_M:
            self.state.breaks += 1
            if value == 6.0 and self.state.spindle and not turning:
                self.state.spindle = 0  # a change of tool stops it, unless its line turns it on
        elif value not in IGNORED_M:
            self.fail(f"M{value:g}: {REFUSED_M.get(value, 'unknown word')}")

    def _numbers(self, values: dict[str, float], own: set[str], motion: str, groups: dict[str, str]) -> None:
        s = self.state
        if "F" in values:
            if not values["F"] > 0:
                self.fail(f"expected a feed above zero, found F{values['F']:g}")
            s.feed = values["F"]
        for letter in "STH":
            value, whole = values.get(letter, 0.0), letter != "S"
            if value < 0 or (whole and value % 1):
                self.fail(
                    f"expected a {'whole number' if whole else 'speed'} of zero or more, found {letter}{value:g}"
                )
        s.speed = values.get("S", s.speed)
        if "G43" in own:
            if "H" not in values:
                self.fail("G43 needs the register of the tool's length: H")
            s.length = int(values["H"])
            s.breaks += 1
            self.note("G43: programmed positions are taken as those of the tool's tip")
        elif "H" in values:
            self.fail("H goes with G43")
        arc = motion in ("G2", "G3") and not values.keys().isdisjoint(MOVING)
        tracking = "P" in TRACKING.get(groups.get("tracking", ""), "")
        if "P" in values and arc and tracking:
            self.fail("P is for G64 and for the arc: expected two lines")
        if "P" in values and not (arc or tracking or "G4" in own):
            self.fail(f"unknown word: P{values['P']:g} (expected with G4, G64, G2 or G3)")
