"""G-code to moves, line by line: memory does not grow with the file unless the moves are kept."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from math import atan2, copysign, hypot, isfinite, nan, pi, radians, sqrt
from typing import NamedTuple, NoReturn

from stiffmap.machining.toolpath.gcode import state as meaning
from stiffmap.machining.toolpath.gcode.state import AXES, CENTRES, INCH, MM, State
from stiffmap.machining.toolpath.gcode.words import bare, fail, read_block

CLOSES, CLOSES_SHARE = 5e-6, 1e-3
"""m and share of the radius by which an arc's ends may differ from one circle."""
LEAST_RADIUS, LEAST_SWEEP = 1.27e-6, 1e-6
"""m and rad: LinuxCNC refuses arcs by a smaller radius, or ends further than twice the radius by it; a smaller turn is a full one."""
LETTERS = frozenset("XYZCIJKRFSTHPQN")
MOVING = "XYZCIJKR"
STRAIGHT = ("G0", "G1")
NOWHERE, NO_CENTRE = (0.0, 0.0, 0.0), (nan, nan, nan)
_SIGNED = r"(-?\d+(?:\.\d*)?) ?)?"
_PLAIN = re.compile(
    rf"(?:N\d+ ?)?(?:G0?([01]) ?)?(?:X{_SIGNED}(?:Y{_SIGNED}(?:Z{_SIGNED}(?:F(\d{{1,7}}(?:\.\d*)?) ?)?(?:\([^()]*\))?\r?\n?",
    re.ASCII,
).fullmatch
EVERY = 20_000
"""Lines between two calls of `progress`."""
FARTHEST = 1e4
"""m: a coordinate beyond is a slip of the pen."""


class Move(NamedTuple):
    """A move of the tip, m, rad, s."""

    motion: str
    start: tuple[float, float, float]
    end: tuple[float, float, float]
    centre: tuple[float, float, float]
    plane: int
    sweep: float
    feed: float
    spindle: float
    line: int
    turn: float
    """rad of the tool about its axis; NaN where never given."""


class Reader:
    """Reads blocks one after the other; `notes` says what was taken without being acted on."""

    def __init__(self, file: str, offsets: Mapping[str, Sequence[float]] | None = None) -> None:
        """`offsets`: work offsets by name (``G54``), m."""
        self.file, self.state, self.notes, self.optional = file, State(), dict[str, int](), False
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

    def block(self, text: str, number: int) -> Move | None:
        """The move of a line, if it has one."""
        words, optional = read_block(text, self.file, number)
        self.number = number
        if not words:
            if bare(text) == "%":
                self.state.ended, self.begun = self.begun, True
            return None
        self.begun = True
        if self.optional or optional:
            self.state.breaks += self.optional
            self.optional = optional
            if optional:
                self.note("lines with a slash (block delete) are carried out")
        s = self.state
        values, own, motion = self._sort(words)
        if own:
            self._one_line(values, own, motion)
        if motion:
            s.motion = "" if motion == "G80" else motion
        if values.keys().isdisjoint(MOVING) or not own.isdisjoint(meaning.REFERENCES):
            if motion in ("G2", "G3"):
                self.fail(f"{motion} without an end, a centre or a radius")
            self._stop()
            return None
        if not s.motion:
            first = next(a for a in MOVING if a in values)
            self.fail(
                f"{first} without a motion: expected G0, G1, G2 or G3 {'in it' if motion else 'before it'}"
            )
        if not s.unit:
            self.fail("the unit is missing: expected G21 (mm) or G20 (inch) before the first move")
        move = self._move(values, "G53" in own, number)
        self.moves += 1
        self._stop()
        return move

    def plain(self, line: re.Match[str], number: int) -> Move | None:
        """The move of a line of the commonest form in the commonest state, as `block` has it but faster; None: ask there."""
        s = self.state
        code, *axes, feed = line.groups()
        motion = f"G{code}" if code else s.motion
        rate = float(feed) if feed else s.feed
        usual = (
            s.unit
            and s.absolute
            and s.spindle is not None
            and not (s.inverse_time or s.lost or self.optional)
        )
        if not (usual and rate and motion in STRAIGHT and any(axes)):
            return None
        end = s.position.copy()
        shift = self.offsets.get(s.offset, NOWHERE)
        for i in range(3):
            if word := axes[i]:
                end[i] = float(word) * s.unit + shift[i]
                if s.given[i] > number:
                    s.given[i] = number
                if abs(end[i]) >= FARTHEST:
                    return None
        start, s.position, s.motion, s.feed = s.position, end, motion, rate
        self.moves += 1
        speed = nan if motion == "G0" else rate * s.unit / 60
        return Move(motion, start, end, NO_CENTRE, s.plane, 0.0, speed, s.rate, number, s.turn)  # type: ignore[arg-type]

    def _stop(self) -> None:
        """What stops a program does so after the motion of its line."""
        if self._stops:
            self.actions += [(word, self.moves) for word in self._stops]
            self._stops = []

    def _one_line(self, values: dict[str, float], own: set[str], motion: str) -> None:
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

    def _sort(self, words: tuple[tuple[str, float], ...]) -> tuple[dict[str, float], set[str], str]:
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
            s.said.add("plane")
        elif value in (20.0, 21.0):
            unit = INCH if value == 20.0 else MM
            if s.unit and s.feed is not None and not s.inverse_time:
                s.feed *= s.unit / unit  # it keeps its speed
            s.unit = unit
        elif value in (90.0, 91.0):
            s.absolute = value == 90.0
            s.said.add("distance")
        elif value in (90.1, 91.1):
            s.absolute_centres = value == 90.1
            s.said.add("centres")
        elif value in (93.0, 94.0):
            s.said.add("feed mode")
            s.inverse_time, s.feed = value == 93.0, None
        elif value in meaning.OFFSETS:
            s.breaks += s.offset != f"G{value:g}" or "offset" not in s.said
            s.offset = f"G{value:g}"
            s.said.add("offset")
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

    def _move(self, values: dict[str, float], machine: bool, number: int) -> Move:
        s = self.state
        shift = (0.0, 0.0, 0.0) if machine else self.offsets.get(s.offset, (0.0, 0.0, 0.0))
        start = (s.position[0], s.position[1], s.position[2])
        end = list(start)
        if s.lost and s.motion != "G0":
            self.fail(
                f"where {', '.join(sorted(s.lost))} stands after a reference point is not known: expected a rapid there (G90 G0)"
            )
        for i, axis in enumerate(AXES):
            if axis in values:
                step = values[axis] * s.unit
                end[i] = step + shift[i] if s.absolute or machine else start[i] + step
                if abs(end[i]) >= FARTHEST:
                    self.fail(f"{axis}{values[axis]:g} is {end[i]:.3g} m: beyond any machine")
                if s.absolute or machine:
                    if s.given[i] > number:
                        s.given[i] = number
                    s.lost.discard(axis)
        goal = (end[0], end[1], end[2])
        centre, sweep = (nan, nan, nan), 0.0
        if s.motion in ("G2", "G3"):
            centre, sweep = self._arc(values, start, goal, shift)
        elif not values.keys().isdisjoint("IJKR"):
            self.fail(f"I, J, K and R go with G2 or G3, not with {s.motion}")
        feed = nan
        if s.motion != "G0":
            feed = self._feed(values, start, goal, sweep, centre)
            if s.spindle is None:
                self.note("no M3 stands before a move at feed: the spindle's speed is taken from the process")
        if "C" in values:  # the turn of the tool about its own axis
            s.turn = radians(values["C"]) + (0.0 if s.absolute or not isfinite(s.turn) else s.turn)
        s.position = end
        return Move(s.motion, start, goal, centre, s.plane, sweep, feed, s.rate, number, s.turn)

    def _feed(
        self,
        values: dict[str, float],
        start: tuple[float, ...],
        end: tuple[float, ...],
        sweep: float,
        centre: tuple[float, ...],
    ) -> float:
        s = self.state
        if s.inverse_time:
            if "F" not in values:
                self.fail("under G93 every move needs its own F")
            way = hypot(*(b - a for a, b in zip(start, end, strict=True)))
            if sweep:
                flat = [i for i in range(3) if i != s.plane]
                radius = hypot(*(start[i] - centre[i] for i in flat))
                way = hypot(radius * sweep, end[s.plane] - start[s.plane])
            return way * values["F"] / 60
        if s.feed is None:
            self.fail(f"{s.motion} without a feed: F was never given, or before G94")
        return s.feed * s.unit / 60

    def _arc(
        self,
        values: dict[str, float],
        start: tuple[float, float, float],
        end: tuple[float, float, float],
        shift: tuple[float, ...],
    ) -> tuple[tuple[float, float, float], float]:
        """Centre and sweep about the plane's normal."""
        s = self.state
        i, j = {2: (0, 1), 1: (2, 0), 0: (1, 2)}[s.plane]  # right-handed about the normal
        sense = -1.0 if s.motion == "G2" else 1.0
        ax, ay, bx, by = start[i], start[j], end[i], end[j]
        if "R" in values:
            if any(w in values for w in "IJK"):
                self.fail("an arc has a centre (I J K) or a radius (R), not both")
            x, y = self._centre_of_radius(values["R"] * s.unit, sense, (ax, ay), (bx, by))
        else:
            given = CENTRES[s.plane]
            wrong = [w for w in "IJK" if w in values and w not in given]
            if wrong:
                self.fail(
                    f"{wrong[0]} does not lie in the plane of the arc (G{ {2: 17, 1: 18, 0: 19}[s.plane] })"
                )
            if not any(w in values for w in given):
                self.fail(f"{s.motion} without a centre ({' '.join(given)}) or a radius (R)")
            c = {w: values[w] * s.unit if w in values else None for w in given}
            names = "IJK"
            x, y = (
                (ax, ay)[k] + (c[names[axis]] or 0.0)
                if not s.absolute_centres
                else self._absolute(c[names[axis]], shift[axis])
                for k, axis in enumerate((i, j))
            )
        ra, rb = hypot(ax - x, ay - y), hypot(bx - x, by - y)
        if ra < LEAST_RADIUS:
            self.fail(f"the arc has no radius: {1e3 * ra:.6g} mm")
        if abs(ra - rb) > CLOSES and abs(ra - rb) > CLOSES_SHARE * max(ra, rb):
            self.fail(f"the arc does not close: its radius is {1e3 * ra:.6g} mm at the start and {1e3 * rb:.6g} mm at the end")  # fmt: skip
        turn = atan2(by - y, bx - x) - atan2(ay - y, ax - x)
        turn = (sense * turn) % (2 * pi)
        if (ax, ay) == (bx, by):
            turn = 2 * pi
        elif turn < LEAST_SWEEP:
            turn += 2 * pi
        turns = values.get("P", 1.0)
        if turns != int(turns) or not 1 <= turns <= 1000:
            self.fail(f"P: expected a whole number of turns from 1 to 1000, found {turns:g}")
        centre = [0.0, 0.0, 0.0]
        centre[i], centre[j], centre[s.plane] = x, y, start[s.plane]
        return (centre[0], centre[1], centre[2]), sense * (turn + 2 * pi * (turns - 1))

    def _absolute(self, value: float | None, shift: float) -> float:
        if value is None:
            self.fail("under G90.1 both words of the centre are needed")
        return value + shift

    def _centre_of_radius(
        self, radius: float, sense: float, a: tuple[float, float], b: tuple[float, float]
    ) -> tuple[float, float]:
        """Negative radius: the longer of the two arcs."""
        dx, dy = b[0] - a[0], b[1] - a[1]
        half = hypot(dx, dy) / 2
        if half == 0.0:
            self.fail("an arc by its radius needs an end that is not its start")
        if radius == 0.0 or half > abs(radius) + LEAST_RADIUS:
            self.fail(f"the arc does not close: its ends are {2e3 * half:.6g} mm apart, more than twice its radius of {1e3 * abs(radius):.6g} mm")  # fmt: skip
        height = copysign(sqrt(max(radius**2 - half**2, 0.0)), radius * sense)
        ux, uy = dx / (2 * half), dy / (2 * half)
        return a[0] + dx / 2 - height * uy, a[1] + dy / 2 + height * ux


def read_moves(
    lines: Iterable[str], reader: Reader, progress: Callable[[int], None] | None = None
) -> Iterator[Move]:
    """Moves of a program, one after the other; raises FileError with the line of what is not understood."""
    for number, text in enumerate(lines, 1):
        if reader.state.ended:
            break
        plain = _PLAIN(text)
        move = (reader.plain(plain, number) if plain else None) or reader.block(text, number)
        if move is not None:
            yield move
        if progress is not None and number % EVERY == 0:
            progress(number)
