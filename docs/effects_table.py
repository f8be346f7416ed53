"""The kinds of effects as Markdown, between the markers of docs/effects.md, which a test compares: ``python docs/effects_table.py``."""

from __future__ import annotations

from pathlib import Path

from stiffmap.common.outputs import write_text
from stiffmap.model.effects import registry
from stiffmap.model.effects.types import EffectType, Parameter


def overview() -> str:
    """One row per kind: name, title, parameters with units."""
    rows = ["| kind | what | parameters |", "|---|---|---|"]
    for kind in registry.kinds():
        effect = registry.get(kind)
        numbers = (f"`{p.name}`" + ("" if p.unit == "1" else f" ({p.unit})") for p in effect.parameters)
        rows.append(f"| [`{kind}`](#{kind}) | {effect.title} | {', '.join(numbers)} |")
    return "\n".join(rows)


def section(effect: EffectType) -> str:
    """Definition, what it acts on, and a table of its parameters."""
    lines = [f"### {effect.kind}", "", f"{effect.title[0].upper()}{effect.title[1:]}. {effect.doc}", ""]
    lines += [f"* pivot: {effect.pivot}", f"* frame: {effect.frame}", f"* moves: {effect.moves}"]
    lines += [f"* option `{o.name}`: {_choices(o.choices)}; {o.doc}" for o in effect.options]
    lines += [f"* {rule}" for rule in _rules(effect)]
    lines += ["", "| parameter | unit | bounds | no effect at | meaning |", "|---|---|---|---|---|"]
    return "\n".join([*lines, *(_row(p) for p in effect.parameters)])


def _choices(choices: tuple[str, ...]) -> str:
    first, *rest = (f"`{c}`" for c in choices)
    return ", ".join([f"{first} (default)", *rest])


def _rules(effect: EffectType) -> list[str]:
    rules = []
    if effect.one_of:
        rules.append(f"exactly one of {_names(effect.one_of)}")
    if effect.vector:
        rules.append(f"at least one of {_names(effect.vector)}; those left out have no effect")
    others = tuple(
        k
        for k in registry.kinds()
        if k != effect.kind and (k in effect.excludes or effect.kind in registry.get(k).excludes)
    )
    if others:
        rules.append(f"excludes {_names(others)} on the same element and leg")
    if effect.kind in effect.excludes and not effect.measurement:
        rules.append("once per element and leg")
    if effect.needs:
        rules.append(f"an experiment should record: {', '.join(effect.needs)}")
    return rules


def _names(names: tuple[str, ...]) -> str:
    return ", ".join(f"`{n}`" for n in names)


def _row(p: Parameter) -> str:
    unit = f"{p.unit}; {p.angular} where it turns" if p.angular else p.unit
    null = "" if p.null is None else f"{p.null:g}"
    default = "" if p.default is None else f" (default {p.default:g})"
    known = "" if p.fitted else "; not fitted"
    return f"| `{p.name}` | {unit} | {p.lower:g} … {p.upper:g} | {null} | {p.doc}{default}{known} |"


def reference() -> str:
    """All kinds: the overview, then a section each."""
    parts = [overview(), *(section(registry.get(k)) for k in registry.kinds())]
    return "\n\n".join(parts)


BEGIN = "<!-- kinds: begin (written by python docs/effects_table.py) -->"
END = "<!-- kinds: end -->"

if __name__ == "__main__":
    page = Path(__file__).with_name("effects.md")
    before, _, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    write_text(page, f"{before}{BEGIN}\n\n{reference()}\n\n{END}{rest.partition(END)[2]}")
