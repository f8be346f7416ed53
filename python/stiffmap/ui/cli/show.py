from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rich.text import Text
from rich.tree import Tree

from stiffmap.common.errors import StiffmapError
from stiffmap.model.description import Block, Body, Element, Joint, Offset, Point, Spring
from stiffmap.model.effects import effect_text
from stiffmap.solve.budget import deflection_budget
from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine
from stiffmap.solve.mobility import Mobility, mobility
from stiffmap.solve.status import Status
from stiffmap.ui.cli import options
from stiffmap.ui.cli.inputs import machine_at, numbers
from stiffmap.ui.cli.options import option, written
from stiffmap.ui.cli.output import Answer


def command(
    machine: options.Machine,
    at: options.At = None,
    turned: options.Rotation = None,
    output: Path | None = written("Picture to write. [default: MACHINE.png]"),
    effect: options.Effects = None,
    load: str | None = option("Force on the tool in N, e.g. 300,0,0: draw the machine deformed by it."),
    view: str | None = option("Elevation and azimuth of the view, deg. [default: 22,35; flat: from above]"),
    picture: bool = option("Draw the machine.", True),
) -> Answer:
    """Draw a machine in 3-D at a pose and print what it is made of.

    Elements from base to platform, as built with its effects; the effects; degrees of freedom, over-constraint (closure equations that follow
    from the others) and free spins, counted at the pose.

    With --load: the shape without load (dashed), under it (enlarged), and the share of each spring and drive
    in the deflection of the tool.

    Examples:
      [cyan]stiffmap show orthoglide-revised[/cyan]
      [cyan]stiffmap show tripteron --at 300,400,500 -o tripteron.png --view 15,-60[/cyan]
      [cyan]stiffmap show orthoglide-revised --at -200,-200,-200 --load 300,0,0[/cyan]
    """
    m, p, how = machine_at(machine, effect, at, turned)
    r = how["rotation"]
    k = inverse_kinematics(m, p, r)
    if int(k.status) != Status.CONVERGED:
        raise StiffmapError(f"{m.name} cannot take this pose: {Status(int(k.status)).name.lower()}")
    counts = mobility(m, k.coordinates)
    wrench = None if load is None else np.r_[numbers(load, "load", 3), np.zeros(3)]
    file = _draw(m, p, r, output or Path(f"{m.name}.png"), view, wrench) if picture else None
    if wrench is None:
        return Answer(as_plain(m, counts, file), _lines(m, counts, file))
    budget = deflection_budget(m, p, wrench, rotation=r)
    found = {"machine": m.name, "wrench": wrench} | budget.as_plain()
    return Answer(found, [str(budget)], [] if file is None else [file])


def _draw(m: Machine, p: Any, r: Any, path: Path, view: str | None, wrench: Any) -> Path:
    from stiffmap.ui.plot import loaded_figure, machine_figure, save

    how = {"rotation": r, "view": None if view is None else tuple(numbers(view, "view", 2).tolist())}
    return save(machine_figure(m, p, **how) if wrench is None else loaded_figure(m, p, wrench, **how), path)


def as_plain(m: Machine, counts: Mobility, file: Path | None) -> Any:
    """JSON data."""
    return {
        "machine": m.name,
        "legs": {leg.name: [describe(e) for e in leg.elements] for leg in m.description.legs},
        "base": [describe(e) for e in m.description.base],
        "platform": [describe(e) for e in m.description.platform],
        "effects": [effect_text(r, m.description) for r in m.description.effects],
        "actuators": list(m.actuators),
        "points": list(m.points),
        **counts.as_plain(),
        "free_spins": list(m.free_spins),
        "picture": file,
    }


def _lines(m: Machine, counts: Mobility, file: Path | None) -> Iterator[Any]:
    d = m.description
    tree = Tree(Text.assemble((m.name, "bold"), f"  {d.title}"))
    legs = [(f"leg {leg.name}", leg.elements) for leg in d.legs]
    for name, elements in [("base", d.base), *legs, ("platform", d.platform)]:
        if not elements:
            continue
        branch = tree.add(Text(name))
        for e in elements:
            _grow(branch, e)
    yield tree
    for r in d.effects:
        yield f"effect: {effect_text(r, d)}"
    yield f"platform: {counts.platform} degrees of freedom, {len(m.actuators)} actuators"
    yield (
        f"mechanism: {counts.joints} joint coordinates, {counts.equations} closure equations of rank "
        f"{counts.independent}: {counts.total} degrees of freedom, {counts.internal} of them internal"
    )
    yield f"over-constraint: {counts.overconstraint}"
    yield f"free spins: {', '.join(m.free_spins) or 'none'}"
    if file is not None:
        yield f"wrote {file}"


def _grow(tree: Tree, e: Element) -> None:
    node = tree.add(Text(describe(e)))
    for branch in e.branches if isinstance(e, Block) else ():
        inner = node.add(Text(f"branch {branch.name}"))
        for part in branch.elements:
            _grow(inner, part)


def describe(e: Element) -> str:
    """An element in a few words, mm and kg."""
    match e:
        case Offset():
            return f"{e.name}: offset ({', '.join(f'{1e3 * v:g}' for v in e.nominal.translation)}) mm"
        case Joint():
            return f"{e.name}: {_joint(e)}"
        case Spring():
            varies = f", varies with {e.stroke.joint}" if e.stroke else ""
            return f"{e.name}: link spring, by {'compliance' if e.compliance is not None else 'stiffness'}{varies}"
        case Body():
            return f"{e.name}: body of {e.mass:g} kg"
        case Point():
            return f"{e.name}: point"
        case Block():
            return f"{e.name}: parallel block of {len(e.branches)} branches"


def _joint(e: Joint) -> str:
    if not e.actuated:
        return f"passive {e.kind} joint" + ("" if e.free else " with a spring")
    if e.law is None:
        return f"{e.kind} actuator, rigid"
    unit, scale = ("mm/N", 1e3) if e.kind == "prismatic" else ("rad/(N m)", 1.0)
    softness = f", {scale / e.law.stiffness:.3g} {unit}" if e.law.stiffness else ""
    return f"{e.kind} actuator{softness}"
