"""From a URDF and its sidecar to the description of a machine, with doubts about numbers that no machine has."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import dropwhile, islice
from os import PathLike, fspath
from pathlib import Path

import numpy as np

from stiffmap.common.broadcasting import given_path
from stiffmap.common.errors import FileError, StiffmapError, frames_of_this_package, suggestion
from stiffmap.model.description import TASK, Leg, MachineDescription, Offset
from stiffmap.model.description.tree import ENDS
from stiffmap.model.files.save import description_text
from stiffmap.model.urdf.chains import Chains, ball, end_pose, free_name, plain_name
from stiffmap.model.urdf.model import UrdfModel, find_tip
from stiffmap.model.urdf.reader import read_urdf
from stiffmap.model.urdf.sidecar import Sidecar, read_sidecar


@dataclass(frozen=True)
class Imported:
    """A description, and what to know of it."""

    description: MachineDescription
    left_out: tuple[str, ...]
    """Links that move on no way between base and tip; their masses stay with the body that carries them."""
    rigid: tuple[str, ...]
    """Motors without a compliance."""
    tip: str = ""
    """The link that is the tool."""
    massless: tuple[str, ...] = ()
    """Moving links whose body, with all that stays with it, has no mass."""
    choice: str = ""
    """The ends that it was chosen from, in words; empty where it was named, or is the only one."""


def import_urdf(
    urdf: str | PathLike[str], sidecar: str | PathLike[str] | None = None, *, tip: str | None = None
) -> Imported:
    """Machine description (SI) of a URDF file: a serial chain from the root link to the tip, or, with the
    `closed_loop` of a sidecar, legs in parallel between one base and one platform.

    `tip` is the link that is the tool, before what a sidecar says; None: the link that has the name of a tool
    (tool0, tcp, tool, ee, flange), or the only end. Raises FileError, one line, for what cannot be used: coupled
    (mimic), floating and planar joints on the way to the tip, several possible tools, unknown frames and joints,
    loops of another topology, and what no machine file holds. Warns of lengths, limits and masses that no machine has, as
    millimetres, degrees and grams are.
    """
    model = read_urdf(given_path(urdf, "urdf", "a URDF file"))
    side = read_sidecar(None if sidecar is None else given_path(sidecar, "sidecar", "a YAML file"))
    file = str(urdf) if sidecar is None else fspath(sidecar)
    _check_names(model, side, file)
    end, choice = _tip(model, side, tip, file)
    motors = _motors(model, side, end, file)
    ways = [end, *(model.link(f, "closed_loop", file) for pair in side.closed_loop for f in pair)]
    chains = Chains(model, side, motors, {j.child for n in ways for j in model.way(n) if j.kind != "fixed"})
    legs, platform = _legs(model, side, chains, end, file)
    home = end_pose(legs[0].elements) @ end_pose(platform)
    box = side.workspace
    corners = box and [(float(box["x"][k]), float(box["y"][k]), float(box["z"][k])) for k in (0, 1)]
    description = MachineDescription(
        name=plain_name(model.name),
        legs=legs,
        platform=platform,
        home=home,
        task=TASK if side.task is None else tuple(c for c in TASK if c in side.task),
        workspace=(corners[0], corners[1]) if corners else None,
        title=f"{model.name}, imported",
        source=f"imported from {Path(urdf).name}" + (f" with {Path(file).name}" if sidecar else "") + f" to {end}",
    )  # fmt: skip
    _check_file(description, model.file)
    for doubt in doubts(model):
        warnings.warn(f"{model.file}: {doubt}", stacklevel=frames_of_this_package())
    left_out = tuple(n for n in model.links if model.body_of(n) not in {*chains.heads, model.root})
    heavy = {chains.carrier(n) for n, body in model.links.items() if body}
    massless = tuple(n for n in model.links if n in chains.heads - heavy)
    return Imported(description, left_out, tuple(sorted(motors - set(side.actuators))), end, massless, choice)


def _check_file(description: MachineDescription, file: str) -> None:
    """FileError, about the URDF, for a machine that could be made but not saved."""
    try:
        description_text(description)
    except FileError as error:
        raise FileError(error.reason, file=file, key=error.key) from None
    except StiffmapError as error:
        raise FileError(str(error), file=file) from None


def _check_names(model: UrdfModel, side: Sidecar, file: str) -> None:
    for key in ("name_mot", "joint_name", "home", "actuators", "springs"):
        sort, known = ("link", model.links) if key == "springs" else ("joint", model.joints)
        for name in getattr(side, key):
            if name not in known:
                near = suggestion(name, known)
                raise FileError(f"no {sort} '{name}' in {model.file}{near}", file=file, key=key)
            if sort == "joint" and model.joints[name].kind == "fixed":
                raise FileError(f"joint '{name}' is fixed", file=file, key=key)


def _tip(model: UrdfModel, side: Sidecar, tip: str | None, file: str) -> tuple[str, str]:
    """The tool: as named, the platform of the loops, or the one that is found; and what it was chosen from."""
    choice = ""
    if tip or side.tip:
        found = model.link(tip or side.tip or "", "tip", model.file if tip else file)
    elif side.closed_loop:
        found = model.link(side.closed_loop[0][0], "closed_loop", file)
    else:
        found, choice = find_tip(model)
    if model.body_of(found) == model.root:
        raise FileError(f"no joint moves link '{found}'", file=model.file if tip else file, key="tip")
    return found, choice


def _motors(model: UrdfModel, side: Sidecar, tip: str, file: str) -> set[str]:
    if side.name_mot:
        return set(side.name_mot)
    if side.closed_loop:
        raise FileError("a machine with closed loops has passive joints: name its motors, `name_mot: [...]`",
                        file=file, key="name_mot")  # fmt: skip
    return {j.name for j in model.way(tip) if j.kind != "fixed"}


def _legs(
    model: UrdfModel, side: Sidecar, chains: Chains, tip: str, file: str
) -> tuple[tuple[Leg, ...], tuple[Offset, ...]]:
    loops, body = _loops(model, side, tip, file)
    if not loops:
        return (Leg("arm", chains.sequence(model.way(tip), tip)),), ()
    first = chains.sequence(model.way(body))
    at = end_pose(first)
    legs = [Leg(free_name(plain_name(body), ENDS), first)]
    for on_platform, end, free_to_turn in loops:
        way = model.way(end)
        both = zip(model.way(body), way, strict=False)
        shared = [j.name for j, k in both if j is k and j.kind != "fixed"]
        if shared:
            raise FileError(f"the loop at '{end}' does not reach the base: both sides hang on joint "
                            f"'{shared[-1]}'; only legs between base and platform can be imported",
                            file=file, key="closed_loop")  # fmt: skip
        elements = chains.sequence(way)
        on_body = chains.between(body, on_platform)
        if free_to_turn:
            turned = end_pose(elements).r.T @ (at @ on_body).r
            elements = (
                *elements,
                ball(free_name(plain_name(f"{end}_ball"), (e.name for e in elements)), turned),
            )
        name = free_name(plain_name(model.body_of(end)), ENDS)
        taken = [leg.name for leg in legs]
        name = name if name not in taken else f"{name}_{len(legs) + 1}"
        attach = Offset(free_name("attach", (e.name for e in elements)), on_body.inverse())
        legs.append(Leg(name, (*elements, attach)))
    rest = model.way(tip)[len(model.way(body)) :]
    return tuple(legs), chains.sequence(rest, tip)  # type: ignore[return-value]


def _loops(model: UrdfModel, side: Sidecar, tip: str, file: str) -> tuple[list[tuple[str, str, bool]], str]:
    """Loops seen from the platform, the moving body that every loop closes upon and the tip hangs on: of each the
    frame on it, the end of the further leg, and whether that is free to turn; then the body."""
    pairs = [tuple(model.link(f, "closed_loop", file) for f in pair) for pair in side.closed_loop]
    if not pairs:
        return [], tip
    heads = {model.body_of(j.child) for j in model.way(tip)} | {model.body_of(tip)}
    common = [b for b in heads if all(b in map(model.body_of, pair) for pair in pairs)]
    if len(common) != 1 or common[0] == model.root:
        raise FileError("the loops do not close upon one body that carries the tip; only legs in parallel "
                        "between one base and one platform can be imported", file=file,
                        key="closed_loop")  # fmt: skip
    body = common[0]
    out = []
    for (a, b), kind in zip(pairs, side.type, strict=True):
        on, end = (a, b) if model.body_of(a) == body else (b, a)
        out.append((on, end, kind.lower() == "3d"))
    return out, body


FARTHEST = 100.0
"""m: of a way from the first moving joint on, or of a stroke, beyond those of cranes."""
OFF = 10.0
"""Of the machine's length: a centre of mass beyond it."""
DENSEST, SMALLEST = 2000.0, 0.7
"""kg/m³ and m: as much of all that moves in a cube of the machine's length; known robots have a fiftieth of it."""
WIDEST = 50.0
"""Of the machine's length: a radius of gyration beyond it; in kg mm² it is a thousandfold, in g mm² the 31 623-fold."""
ROUNDED = 0.01
"""Of the largest principal moment, which is no larger than the other two together: by as much numbers that were rounded are off."""
LIMITS = 4 * math.pi, 720.0, 0.5
"""Of a joint in degrees: more than as many rad, at most as much, and a multiple."""


def doubts(model: UrdfModel) -> Iterator[str]:
    """Lines that name the place, what was found, and what would be plausible."""
    ways = {n: list(dropwhile(lambda j: j.kind == "fixed", model.way(n))) for n in model.links}
    lengths = {link: sum(float(np.linalg.norm(j.origin.p)) for j in way[1:]) for link, way in ways.items()}
    bodies = [(link, body) for link, body in model.links.items() if body and ways[link]]
    off = {f"link {link}: inertial": float(np.linalg.norm(body.com)) for link, body in bodies}
    far = max(lengths, key=lambda link: lengths[link])
    each = {j.name: j.limits[1] - j.limits[0] for j in model.moving if j.kind == "prismatic" and j.limits}
    strokes = {name: length for name, length in each.items() if length <= 1e3 * FARTHEST}  # beyond: no limit
    size = lengths[far] + max(sum(strokes.get(j.name, 0.0) for j in way) for way in ways.values())
    for place, length, most in (
        *((f"joint {j.name}: origin", lengths[far], FARTHEST) for j in ways[far][-1:]),
        *((place, length, min(FARTHEST, OFF * max(size, SMALLEST))) for place, length in off.items()),
        *((f"joint {name}: limit", length, FARTHEST) for name, length in strokes.items()),
    ):
        if length > most:
            yield f"{place}: found {length:.4g} m; expected metres, {length / 1e3:.3g} m if these are millimetres"
            break
    mass = sum(body.mass for _, body in bodies)
    if mass > DENSEST * max(size, SMALLEST) ** 3:
        link, heavy = max(bodies, key=lambda one: one[1].mass)
        yield (
            f"link {link}: mass: found {heavy.mass:.6g} kg, and {mass:.6g} kg in all that moves, in a machine of {size:.3g} m; "
            f"expected kilograms, {heavy.mass / 1e3:.3g} kg if these are grams"
        )
    radii = {link: math.sqrt(np.abs(body.inertia).max() / body.mass) for link, body in bodies}
    link, radius = max(radii.items(), key=lambda one: one[1], default=("", 0.0))
    if radius > WIDEST * max(size, SMALLEST):
        yield (
            f"link {link}: inertia: found a radius of gyration of {radius:.4g} m in a machine of {size:.3g} m; expected kg m^2, "
            f"{radius / 1e3:.3g} m if these are kg mm^2, {radius / math.sqrt(1e9):.3g} m if g mm^2"
        )
    for link, body in bodies:
        a, b, c = np.linalg.eigvalsh(np.array(body.inertia))
        if (1 - ROUNDED) * c > a + b > 0:
            yield (
                f"link {link}: inertia: found principal moments of {a:.3g}, {b:.3g} and {c:.3g} kg m^2, which no body has; expected the "
                f"largest to be at most the sum of the others, {a + b:.3g}; those of other links may be wrong as well"
            )
            break
    whole = ((j.name, a) for j in model.above.values() for a in j.rpy if abs(a) >= 1.0 and a % LIMITS[2] == 0)
    for name, angle in islice(whole, 1):
        yield f"joint {name}: rpy: found {angle:g} rad; expected radians, {math.radians(angle):.3g} rad if it and others are degrees"
    for joint in model.moving:
        low, high = joint.limits or (0.0, 0.0)
        degrees = low % LIMITS[2] == high % LIMITS[2] == 0
        if joint.kind == "revolute" and degrees and LIMITS[0] < max(-low, high) <= LIMITS[1]:
            yield (
                f"joint {joint.name}: limit: found {low:g} to {high:g} rad; expected radians, {math.radians(low):.4g} to "
                f"{math.radians(high):.4g} if these are degrees, as may be those of other joints"
            )
            break
