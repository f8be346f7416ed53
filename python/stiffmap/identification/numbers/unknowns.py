"""Every number of a machine and of its instrument that may be off, generated from the machine's tree.

Six errors of each joint's frame, less those that its own coordinate takes up; zeros and gains of drives;
lengths of links between passive joints, and their differences where links should be alike; compliances,
masses; the tool; the scale of the instrument. Which of them a plan can determine is left to the singular
values of its Jacobian (`statistics`), not to rules by hand: the same for serial arms and closed loops.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from stiffmap.common.arguments import checked
from stiffmap.experiment.experiment import Experiment, Floats
from stiffmap.identification.numbers.certificate import INSTRUMENT, SCALE, Tolerances, certified, frame_errors
from stiffmap.model.description import TASK, Block, Body, Element, Joint, MachineDescription, Offset, Spring
from stiffmap.model.description.tree import all_elements
from stiffmap.model.with_errors import END

SAG = "sag"
"""Of the drives of an arm under its weight, which its file does not have: every arm sags."""
GROUPS = (
    "zeros", "gains", "axis positions", "axis directions", "guide lean", "link lengths", "rod mismatch", "width", "tool",
    "drive compliance", "link compliance", "masses", SAG, INSTRUMENT,
)  # fmt: skip
GEOMETRY = GROUPS[:9]
ALONG = 0.999
"""Cosine beyond which an axis is that of a joint's own motion."""
Run = Sequence[tuple[str, Offset]]
"""Offsets that follow each other, with their full names."""


@dataclass(frozen=True)
class Unknown:
    """One number that may be off by a normal error with standard uncertainty `u` (SI or relative).

    moves
        (full name, what is moved) -> weight, see `with_errors.edited` and, of the instrument, `certificate.frame_errors`.
    """

    name: str
    group: str
    unit: str
    u: float
    moves: tuple[tuple[tuple[str, str], float], ...] = ()
    leg: str = ""
    setup: str = ""
    """Set-up whose rows alone it moves; empty: all."""


@dataclass(frozen=True)
class Declared:
    """What the file says, by full name and field, SI, and what holds where it says nothing."""

    given: dict[str, float]
    t: Tolerances

    def single(self, name: str, fields: Sequence[str], default: float, size: float = 1.0) -> float:
        """Of one number, that of the first of some fields of `name` that has one, over the number's size."""
        found = [u for f in fields if (u := self.given.get(f"{name}/{f}"))]
        return found[0] / size if found else default

    def spring(self, name: str, spring: Spring, default: float) -> float:
        """Relative, of a 6x6 spring as a whole: the widest of the entries that have an uncertainty."""
        word, matrix = (
            ("compliance", spring.compliance) if spring.compliance else ("stiffness", spring.stiffness)
        )
        found = [
            u / abs(matrix[i][j])
            for i in range(6)
            for j in range(i, 6)
            if matrix is not None
            and (u := self.given.get(f"{name}/{word}.k{i + 1}{j + 1}")) is not None
            and matrix[i][j] != 0.0
        ]
        return max(found, default=default)

    def length(self, names: Sequence[str], offset: Offset) -> float | None:
        """Of an offset along itself, mean of those of `names` (independent of each other); None: not given."""
        way = offset.nominal.p / np.linalg.norm(offset.nominal.p)
        each = []
        for name in names:
            u = np.array([self.given.get(f"{name}/translation.{c}", 0.0) for c in "xyz"])
            each.append(float(np.linalg.norm(way * u)))
        return float(np.sqrt(np.mean(np.square(each)))) if all(v > 0.0 for v in each) else None

    def position(self, run: Run, default: float) -> Floats:
        """(3,) of the place of the frame behind a run of offsets, along its own axes.

        Components with an uncertainty add in squares; directions that none of them covers have the default.
        """
        turn = np.eye(3)
        variance, covered = np.zeros(3), np.zeros(3)
        for name, offset in reversed(run):
            turn = offset.nominal.r @ turn
            for c in range(3):
                u = self.given.get(f"{name}/translation.{'xyz'[c]}")
                if u is not None:
                    variance += (turn[c] * u) ** 2
                    covered += turn[c] ** 2
        return np.asarray(np.sqrt(variance + default**2 * np.clip(1.0 - covered, 0.0, 1.0)))


@checked
def unknowns(
    description: MachineDescription, experiment: Experiment, tolerances: Tolerances | None = None
) -> list[Unknown]:
    """All unknowns that readings of this kind can depend on.

    Standard uncertainties are those of the machine file where it gives some, else of `tolerances`. Raises StiffmapError for what is
    no machine's description, experiment or tolerances.
    """
    t = tolerances or Tolerances()
    bare = description.declared or description
    given = Declared({k: u for k, u in bare.uncertainty if u > 0.0}, t)
    sags = experiment.quantity == "position" and _lacks_sag(bare)
    loaded = bool(experiment.wrench.any() or experiment.gravity or bare.gravity)
    weighs = bool(experiment.gravity or bare.gravity)
    out: list[Unknown] = []
    for leg in bare.legs:
        found, run = _of_sequence(leg.elements, leg.name, leg.name, given)
        out += found
        if len(bare.legs) > 1:
            place = given.position(run, t.position)
            out += _frame(f"{leg.name}.{END}", leg.name, TASK, place, t.direction, "axis positions")
    out += _of_sequence(bare.base, "base", "", given)[0]
    found, run = _of_sequence(bare.platform, "platform", "", given)
    out += found
    out += _frame(f"platform.{END}", "", TASK, given.position(run, t.tool), t.direction, "tool", "tool")
    if experiment.quantity == "position":
        out.append(
            Unknown("scale of the instrument", INSTRUMENT, "1", t.instrument, (((INSTRUMENT, SCALE), 1.0),))
        )
    for name, unit, _ in frame_errors(experiment):
        what, u = ("turn", t.frame_direction) if unit == "rad" else ("shift", t.frame)
        if u > 0.0:
            full = f"{what} of the instrument's frame, {name}"
            out.append(Unknown(full, INSTRUMENT, unit, u, (((INSTRUMENT, name), 1.0),)))
    if not loaded:
        out = [p for p in out if p.group not in ("drive compliance", "link compliance")]
    if not sags:
        out = [p for p in out if p.group != SAG]
    if not weighs:
        out = [p for p in out if p.group != "masses"]
    return out


def _lacks_sag(description: MachineDescription) -> bool:
    """Whether this is an arm, one leg without loops, whose file has no weights or no drives that yield under them."""
    elements = [e for _, e in all_elements(description)]
    heavy = any(isinstance(e, Body) and e.mass > 0.0 for e in elements)
    yields = any(isinstance(e, Joint) and e.actuated and e.law is not None for e in elements)
    arm = len(description.legs) == 1 and not any(isinstance(e, Block) for e in elements)
    return arm and not (heavy and yields)


def uncertain(
    description: MachineDescription, e: Experiment, tolerances: Tolerances | None, exclude: Sequence[str] = ()
) -> tuple[Unknown, ...]:
    """Unknowns with what the certificate of the experiment says of its instrument; `exclude`: groups that are known to be right."""
    every = unknowns(description, e, certified(tolerances, e))
    return tuple(u for u in every if u.group not in exclude)


def _of_sequence(
    elements: tuple[Element, ...], path: str, leg: str, given: Declared
) -> tuple[list[Unknown], Run]:
    """The unknowns, and the offsets behind the last joint."""
    out: list[Unknown] = []
    run: list[tuple[str, Offset]] = []
    for e in elements:
        name = f"{path}.{e.name}"
        if isinstance(e, Block):
            out += _of_block(e, path, leg, given)
            run = []
        elif isinstance(e, Joint):
            out += _of_joint(e, name, leg, given, given.position(run, given.t.position))
            run = []
        elif isinstance(e, Offset):
            run.append((name, e))
        else:
            out += _of_part(e, name, leg, given)
    return out, run


def _of_part(e: Element, name: str, leg: str, given: Declared) -> Iterator[Unknown]:
    """Of a spring its compliance, of a body its mass."""
    if isinstance(e, Spring) and not e.laws:
        u = given.spring(name, e, given.t.compliance)
        yield _single("compliance", name, leg, "link compliance", "ln", u)
    elif isinstance(e, Body) and e.mass > 0.0:
        yield _single("mass", name, leg, "masses", "ln", given.single(name, ["mass"], given.t.mass, e.mass))


def joint_name(element: str) -> str:
    """The name that solutions give a joint: those of the base and the platform have no leg before it."""
    return element.removeprefix("base.").removeprefix("platform.")


def _single(what: str, name: str, leg: str, group: str, unit: str, u: float) -> Unknown:
    return Unknown(f"{what} of {name}", group, unit, u, (((name, what), 1.0),), leg)


def _of_joint(e: Joint, name: str, leg: str, given: Declared, place: Floats) -> Iterator[Unknown]:
    """Frame errors that the joint's own motion does not take up; of a drive its zero and gain."""
    slides, t = e.kind == "prismatic", given.t
    kept = list(TASK)
    axes = [np.abs(np.array(a)) for a in e.axes]
    for axis in axes[:1]:
        along = int(np.argmax(axis))
        if axis[along] > ALONG:
            kept.remove(TASK[along + (0 if slides else 3)])
    if e.kind == "spherical":
        kept = [k for k in kept if k in TASK[:3]]
    turned = "guide lean" if slides else "axis directions"
    yield from _frame(name, leg, tuple(kept), place, t.direction, "axis positions", turned)
    if e.actuated:
        unit, u = ("m", t.zero) if slides else ("rad", t.turning_zero)
        u = given.single(name, ["home", "command_errors.offset"], u)
        yield _single("zero", name, leg, "zeros", unit, u)
        yield _single("gain", name, leg, "gains", "1", given.single(name, ["command_errors.slope"], t.gain))
        if not slides:
            yield _single("sag", name, leg, SAG, "rad/m", given.single(name, ["sag"], t.sag))
    if e.law is not None and not e.law.cubic and not e.law.knots:
        group = "drive compliance" if e.actuated else "link compliance"
        u = given.single(name, ["stiffness", "law.stiffness"], t.compliance, e.law.stiffness)
        yield _single("compliance", name, leg, group, "ln", u)


def _frame(
    name: str,
    leg: str,
    axes: tuple[str, ...],
    place: Floats,
    direction: float,
    moved: str,
    turned: str = "axis directions",
) -> Iterator[Unknown]:
    """`place` (3,) are the standard uncertainties along x, y, z."""
    for a in axes:
        turns = a in TASK[3:]
        yield Unknown(
            f"{'turn' if turns else 'shift'} of {name} {'about' if turns else 'along'} {a[-1]}",
            turned if turns else moved,
            "rad" if turns else "m",
            direction if turns else float(place[TASK.index(a)]),
            (((name, a), 1.0),),
            leg,
        )


def _of_block(block: Block, path: str, leg: str, given: Declared) -> Iterator[Unknown]:
    """Lengths of the offsets of a parallel block: their mean, and how its branches differ."""
    lengths = [
        [e for e in b.elements if isinstance(e, Offset) and np.linalg.norm(e.nominal.p) > 0]
        for b in block.branches
    ]
    shared = [e for e in lengths[0] if all(e.name in [o.name for o in other] for other in lengths)]
    longest = max((float(np.linalg.norm(e.nominal.p)) for e in lengths[0]), default=0.0)
    for offset in shared:
        at = [(f"{path}.{b.name}.{offset.name}", "length") for b in block.branches]
        size = float(np.linalg.norm(offset.nominal.p))
        single = given.length([name for name, _ in at], offset)
        rod = size > 0.5 * longest
        place = f"{path}.{block.name}.{offset.name}"
        if rod:
            common = tuple((a, 1.0) for a in at)
            u = single / float(np.sqrt(len(at))) if single else given.t.length
            yield Unknown(f"length of {place}", "link lengths", "m", u, common, leg)
        for i, other in enumerate(at[1:]):
            between = f"{block.branches[0].name} and {block.branches[i + 1].name}"
            yield Unknown(
                f"difference of {place} between {between}",
                "rod mismatch" if rod else "width",
                "m",
                single * float(np.sqrt(2.0)) if single else given.t.mismatch,
                ((at[0], -0.5), (other, 0.5)),
                leg,
            )
    for branch in block.branches:
        for e in branch.elements:
            yield from _of_part(e, f"{path}.{branch.name}.{e.name}", leg, given)
