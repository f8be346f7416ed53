from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich.text import Text

from stiffmap.model.effects import EffectType, get, kinds
from stiffmap.model.effects.registry import found_by
from stiffmap.model.files.shipped import machine_names
from stiffmap.solve.machine import Machine, load_machine
from stiffmap.ui.cli.options import argument, option
from stiffmap.ui.cli.output import Answer


def command(
    kind: str | None = argument(
        "One kind: its definition and parameters; or a word for it, such as backlash, Spiel, sag; "
        "or a machine: the effects and their places on it.",
        None,
    ),
    on: str | None = option("Machine: the elements and legs where each can be."),
) -> Answer:
    """List the effects that a machine can have beyond what is declared, for --effect and with_effect.

    Examples:
      [cyan]stiffmap effects[/cyan]
      [cyan]stiffmap effects friction[/cyan]
      [cyan]stiffmap effects backlash[/cyan]
      [cyan]stiffmap effects straightness --on orthoglide-revised[/cyan]
    """
    if kind and not on and kind not in kinds() and kind in machine_names():
        kind, on = None, kind
    machine = load_machine(on) if on else None
    if kind and kind not in kinds() and (meant := found_by(kind, kinds())):
        chosen = [get(k) for k in meant]
    else:
        chosen = [get(kind)] if kind else [get(k) for k in kinds()]
    told = [line for e in chosen for line in _lines(e, machine)]
    return Answer([_plain(e, machine) for e in chosen], [*told, *(_definition(chosen[0]) if kind else ())])


def _lines(effect: EffectType, machine: Machine | None) -> Iterator[str | Text]:
    names = ", ".join(f"{p.name} ({p.unit})" if p.unit != "1" else p.name for p in effect.parameters)
    yield Text.assemble((effect.kind, "bold"), f"  {effect.title}: {names}")
    if machine is not None:
        yield f"    on {', '.join(_where(effect, machine)) or 'nothing of this machine'}"


def _where(effect: EffectType, machine: Machine) -> list[str]:
    """``actuator (x, y, z)``: each element with the legs that have it."""
    legs: dict[str, list[str]] = {}
    for element, at in effect.places(machine.description):
        known = legs.setdefault(element, [])
        known.extend(leg for leg in at if leg not in known)
    return [f"{element} ({', '.join(at)})" if at else element for element, at in legs.items()]


def _definition(effect: EffectType) -> Iterator[str]:
    yield effect.doc
    yield f"pivot: {effect.pivot}; frame: {effect.frame}; moves: {effect.moves}"
    for o in effect.options:
        yield f"option {o.name}: {', '.join(o.choices)} (the first by default); {o.doc}"
    for p in effect.parameters:
        unit = f"{p.unit}, {p.angular} where it turns" if p.angular else p.unit
        null = "" if p.null is None else f"; none at {p.null:g}"
        yield f"  {p.name} [{unit}] {p.lower:g} … {p.upper:g}{null}: {p.doc}"


def _plain(effect: EffectType, machine: Machine | None) -> dict[str, Any]:
    keys = ("name", "unit", "angular", "lower", "upper", "null", "default", "doc")
    out: dict[str, Any] = {"kind": effect.kind, "title": effect.title, "definition": effect.doc}
    out |= {"pivot": effect.pivot, "frame": effect.frame, "moves": effect.moves}
    out["parameters"] = [{k: getattr(p, k) for k in keys} for p in effect.parameters]
    out["options"] = {o.name: list(o.choices) for o in effect.options}
    out["measurement"] = effect.measurement
    if machine is not None:
        places = effect.places(machine.description)
        out["places"] = [{"element": element, "legs": list(legs)} for element, legs in places]
    return out
