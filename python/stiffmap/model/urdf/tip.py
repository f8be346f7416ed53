"""The tool of a URDF where nobody names it."""

from __future__ import annotations

import re

from stiffmap.common.errors import FileError
from stiffmap.model.urdf.model import UrdfModel

TOOLS = (r"tool_?0", r"tcp|tool_cent(er|re)_point", r"tool\d*", r"eef?|end_?effector", r"flange",
         r"grasp(ing)?(_?(frame|center|target|point))?|gripper_frame")  # fmt: skip
"""Names of tools as makers write them, alone or as words of a longer name; the first is the surest."""
LISTED = 12  # ends that a message names


def rank(link: str) -> int:
    """Place of a link's name in TOOLS; that after the last for a name that says nothing."""
    words = re.sub(r"([a-z])([A-Z])", r"\1_\2", link).lower()
    found = (i for i, name in enumerate(TOOLS) if re.search(rf"(?<![a-z0-9])({name})(?![a-z0-9])", words))
    return next(found, len(TOOLS))


def find_tip(model: UrdfModel) -> tuple[str, str]:
    """The link that is the tool, and in words the ends that it was chosen from ('' for an only end).

    An end is a leaf that a moving joint carries. Tools are known by their names; otherwise the tool is on the
    only body that carries no other, jaws apart. FileError, one line, where several arms are left.
    """
    ends = [n for n in model.leaves if model.body_of(n) != model.root]
    if not ends:
        raise FileError("no joint moves, so there is no machine", file=model.file)
    if len(ends) == 1:
        return ends[0], ""
    found = _named(ends) or _by_bodies(model, ends)
    longest = max((model.way(n) for n in found), key=len)
    along = {model.root, *(j.child for j in longest)}
    if not all(model.body_of(n) in along for n in found):
        raise FileError(f"the tree has {len(found)} ends ({listed(found)}); say which one is the tool: --tip LINK, "
                        "or tip in Python and in a sidecar", file=model.file)  # fmt: skip
    tip = min(found, key=lambda n: (rank(n), -len(model.way(n))))
    return tip, f"chosen from the ends {listed(ends)}"


def listed(names: list[str]) -> str:
    """Names in a row, the first of very many."""
    more = len(names) - LISTED
    return ", ".join(names[:LISTED]) + (f" and {more} more" if more > 0 else "")


def _named(links: list[str]) -> list[str]:
    return [n for n in links if rank(n) < len(TOOLS)]


def _by_bodies(model: UrdfModel, ends: list[str]) -> list[str]:
    """Links from which the tool is chosen where no end has the name of one."""
    jaws = _jaws(model)
    hands = [model.joints[name].parent for name in jaws]
    moving = [j for j in model.moving if not any(k.name in jaws for k in model.way(j.child))]
    carriers = {model.body_of(j.parent) for j in moving}
    last = [j.child for j in moving if j.child not in carriers]
    on = {body: [n for n in model.links if model.body_of(n) == body] for body in last}
    if len(last) == 1:
        (here,) = on.values()
        return _named(here) or [n for n in here if n in hands] or [n for n in here if n in ends]
    shared = [n for n in model.links if all(n in (j.parent for j in model.way(body)) for body in last)]
    each = ([n for n in here if n in ends] or [n for n in here if n in hands] for here in on.values())
    return _named(shared) or [n for few in each for n in few]


def _jaws(model: UrdfModel) -> set[str]:
    """Joints of jaws and rods: on a moving body with other joints, and behind each at most one joint that follows no
    other; two such are jaws, one that mimics is a rod."""
    below: dict[str, list[str]] = {}
    for joint in model.moving:
        if model.body_of(joint.parent) != model.root and _independent(model, joint.child) <= 1:
            below.setdefault(model.body_of(joint.parent), []).append(joint.name)
    on = [model.body_of(j.parent) for j in model.moving]
    return {name for body, names in below.items() for name in names
            if len(names) > 1 or (on.count(body) > 1 and model.joints[name].mimic)}  # fmt: skip


def _independent(model: UrdfModel, link: str) -> int:
    """How many joints that mimic no other lie above and behind a link, its own included."""
    return sum(j.mimic is None and any(k.child == link for k in model.way(j.child)) for j in model.moving)
