"""What each code does to the state, and which words of a line go together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NoReturn

from stiffmap.machining.toolpath.gcode import state as meaning
from stiffmap.machining.toolpath.gcode.state import AXES, INCH, MM, ModalState
from stiffmap.machining.toolpath.gcode.words import fail

LETTERS = frozenset("XYZCIJKRFSTHPQN")
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
        if "G4" in own:
            if not values.get("P", -1.0) >= 0:
                self.fail("G4 needs the time of the dwell: P of zero or more")
            if moving:
                self.fail("a dwell (G4) and a motion in one line: expected two lines")
            self.actions.append((f"G4 P{values['P']:g}", self.moves))
        for word in sorted(own & meaning.REFERENCES):
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
                group = (meaning.GROUPS if letter == "G" else meaning.GROUPS_M).get(value)
                if group:
                    word = f"{letter}{value:g}"
                    if group in groups:
                        what = "two motions" if group == "motion" else "two words that exclude each other"
                        self.fail(f"{what} in one line: {groups[group]} and {word}")
                    groups[group] = word
                if group == "motion":
                    motion = meaning.MOTIONS[value]
                elif letter == "G":
                    self._g(value, own)
                else:
                    self._m(value, "spindle" in groups)
            elif letter in LETTERS:
                if letter in values:
                    self.fail(f"{letter} is given twice")
                values[letter] = value
            else:
                what = "rotary and secondary axes are not read" if letter in "ABUVW" else "unknown word"
                self.fail(f"{what}: {letter}{value:g}")
        if "Q" in values and groups.get("tracking") != "G64":
            self.fail(f"unknown word: Q{values['Q']:g}")
        if "unit" in groups and "F" in values:
            self.note("F in a line that changes the unit is taken in the new one; LinuxCNC takes the old one")
        self._numbers(values, own, motion or self.state.motion, groups)
        return values, own, motion

    def _g(self, value: float, own: set[str]) -> None:
        s = self.state
        if value in meaning.PLANES:
            s.plane = meaning.PLANES[value]
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
        elif value in meaning.OFFSETS:
            s.breaks += s.offset != f"G{value:g}" or "offset" not in s.said
            s.offset = f"G{value:g}"
            if self.offsets and s.offset not in self.offsets:
                self.fail(f"no work offset {s.offset}; given: {', '.join(self.offsets)}")
        elif value in (4.0, 28.0, 30.0, 43.0, 53.0):
            own.add(f"G{value:g}")
        elif value not in meaning.IGNORED_G:
            why = meaning.REFUSED_G.get(value)
            self.fail(
                f"G{value:g}: {why or 'unknown word'}{' are not read' if why and '(' not in why else ''}",
            )
        elif value in (61.0, 61.1, 64.0):
            self.note(f"G{value:g}: how closely the controller tracks corners is not simulated")
        if (group := meaning.GROUPS.get(value)) in meaning.STARTS:
            s.said.add(group)

    def _m(self, value: float, turning: bool) -> None:
        if meaning.GROUPS_M.get(value) == "stop":
            self._stops.append(f"M{value:g}")
        else:
            self.actions.append((f"M{value:g}", self.moves))
        if value in (3.0, 4.0, 5.0):
            self.state.spindle = {3.0: 1, 4.0: -1, 5.0: 0}[value]
        elif value in meaning.ENDS:
            self.state.ended = True
        elif value in meaning.BREAKS_M:
            self.state.breaks += 1
            if value == 6.0 and self.state.spindle and not turning:
                self.state.spindle = 0  # a change of tool stops it, unless its line turns it on
        elif value in meaning.REFUSED_M:
            self.fail(f"M{value:g}: {meaning.REFUSED_M[value]} are not read")
        elif value not in meaning.IGNORED_M:
            self.fail(f"unknown word: M{value:g}")

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
        tracking = groups.get("tracking") == "G64"
        if "P" in values and arc and tracking:
            self.fail("P is for G64 and for the arc: expected two lines")
        if "P" in values and not (arc or tracking or "G4" in own):
            self.fail(f"unknown word: P{values['P']:g} (expected with G4, G64, G2 or G3)")
