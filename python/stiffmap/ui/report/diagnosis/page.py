"""A diagnosis as one self-contained HTML file: the answer, the evidence, pictures inside, nothing from the network."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from stiffmap.common.fingerprints import digest
from stiffmap.common.number_text import length_text, length_unit, place_text, vector_text
from stiffmap.common.outputs import write_text
from stiffmap.experiment.noise.checks import Check
from stiffmap.identification.diagnosis.report import sentences
from stiffmap.identification.diagnosis.report.findings import Detectability, Effect, Rest
from stiffmap.identification.diagnosis.report.result import Diagnosis
from stiffmap.model.description.tree import joints
from stiffmap.model.effects import registry
from stiffmap.solve.budget import budget_where_stable

SHOWN = 12  # detectable effects above the fold
FIRST, FOLDED = ("place", "before_after"), ("residual_others",)
"""Pictures of the first page, and those that are folded."""


def write_report(
    d: Diagnosis,
    path: str | PathLike[str],
    *,
    date: str | None = None,
    inputs: Iterable[str | PathLike[str]] = (),
) -> None:
    """Write the file; raises `FileError` where it cannot be written."""
    write_text(path, html(d, date=date, inputs=inputs))


def html(
    d: Diagnosis,
    made: Mapping[str, Figure] | None = None,
    *,
    date: str | None = None,
    inputs: Iterable[str | PathLike[str]] = (),
) -> str:
    """The report as text, with its figures where they are `made`."""
    from stiffmap.ui.report.diagnosis.pictures import CAPTIONS, figures
    from stiffmap.ui.report.sheet import inline, provenance, render

    pictures = {n: {"caption": CAPTIONS[n], "data": inline(f)} for n, f in (made or figures(d)).items()}
    return render(
        "diagnosis.html",
        machine=d.declared.name,
        experiment=d.experiment.name,
        rows=len(d.experiment),
        quantity=d.experiment.quantity,
        axes=", ".join(d.experiment.axes),
        opening=sentences.opening(d),
        next=sentences.next_step(d),
        lines=[in_shop_words(line) for line in d.lines()[1:]],  # the headline has the verdict
        effects=[_effect(e) for e in d.effects],
        rivals=[
            ("; ".join(map(sentences.effect_text, other)), sentences.separation_text(s))
            for other, s in zip(d.alternatives, d.separations, strict=True)
        ],
        first=[pictures[n] for n in FIRST if n in pictures],
        pictures=[p for n, p in pictures.items() if n not in (*FIRST, *FOLDED)],
        folded=[pictures[n] for n in FOLDED if n in pictures],
        record=record(d, date, inputs),
        slips=d.slips,
        budget=_budget(d),
        sizes=[
            (n, *(f"{1e6 * v:.2f}" for v in (s.rms, s.p95, s.max)), f"{s.ratio:.3f}", s.n)
            for n, s in (("before", d.before), ("after", d.after))
        ],
        per_axis=[
            (a, in_axis_units(a, d.before.per_axis[a]), in_axis_units(a, v))
            for a, v in d.after.per_axis.items()
        ],
        folds="Not held out."
        if d.held_out is None
        else f"{d.held_out.folds} folds by {d.held_out.by}, each predicted by the machine that the others make in the same way.",
        noise=_noise(d),
        fit=f"Lack of fit: p-value {p_text(d.noise.lack_of_fit_before)} before, "
        f"{p_text(d.noise.lack_of_fit_after)} after. "
        f"Outliers listed (rows): {', '.join(d.outliers) or 'none'}.",
        checks=_checks(d.checks_before, d.checks_after),
        left=[(p.what, f"{100 * p.share:.0f} %", p.axis, _at(p)) for p in d.unexplained],
        numbers=[
            (
                n.name,
                in_shop_units(n.value, n.unit),
                in_shop_units(n.sigma, n.unit, 2),
                f"{abs(n.value) / n.u:.1f}",
            )
            for n in (d.calibration.beyond if d.calibration else ())
        ],
        seen=_seen(d),
        shown=SHOWN,
        unseen=[in_shop_words(u).replace("_", " ") for u in d.unobservable],
        limits=[in_shop_words(v) for v in d.limitations],
        provenance=provenance(date, d.seed, inputs, _digests(d)),
    )


def record(
    d: Diagnosis, date: str | None, inputs: Iterable[str | PathLike[str]] = ()
) -> list[tuple[str, str]]:
    """What the first page says of how the readings were taken; a blank is for the pen."""
    told = dict(d.experiment.record)
    source = told.get("source", "")
    if "source" in told and "sha256" in told:
        source = f"{source}, sha256 {told['sha256'][:16]}"
    t = d.experiment.temperature
    measured = "" if t is None or not np.isfinite(t).any() else f"{np.nanmin(t):.1f} to {np.nanmax(t):.1f}"
    papers = filter(None, (told.get("instrument"), told.get("certificate")))
    return [
        ("operator", told.get("operator", "")),
        ("instrument, certificate", ", ".join(papers)),
        ("date of the readings", told.get("date", date or "")),
        ("temperature", told.get("temperature", measured)),
        ("source file", source or ", ".join(p.name for p in map(Path, inputs))),
        ("notes", told.get("notes", "")),
    ]


def _effect(e: Effect) -> dict[str, object]:
    legs = f", leg {', '.join(e.legs)}" if e.legs else ""
    return {
        "name": f"{registry.get(e.kind).title}: {in_shop_words(e.element)}{legs}",
        "rows": [(n.replace("_", " "), *sentences.interval(*v)) for n, v in e.parameters.items()],
        "same": "; ".join(sentences.alias_words(a) for a in e.aliases),
        "definition": in_shop_words(e.definition),
        "evidence": f"The odds for it, over all places together, are e^{e.evidence['ln_odds']:.0f} to 1; it is "
        f"{100 * e.evidence['share']:.0f} % of the squares, and the same everywhere to {100 * e.evidence['same_everywhere']:.0f} %.",
    }


def _budget(d: Diagnosis) -> dict[str, object] | None:
    """Shares of the deflection of the machine that is handed over at the worst pose of the map in the pictures; None where it has play without load."""
    from stiffmap.ui.plot.loaded import budget_rows
    from stiffmap.ui.report.diagnosis.pictures import worst_pose

    worst = worst_pose(d) if d.effects else None
    if worst is None:
        return None
    p, force = worst
    found = budget_where_stable(d.machine, p, force)
    if found is None:
        return None
    whole = float(np.linalg.norm(found.displacement[:3]))
    unit, factor, decimals = length_unit(whole)
    rows = [
        (in_shop_words(n), f"{factor * whole * s:.{decimals}f}", 100 * s) for n, s, _ in budget_rows(found)
    ]
    at, pull = vector_text(1e3 * p, 4), vector_text(force[:3], 4)
    return {"at": at, "force": pull, "size": length_text(whole), "unit": unit, "rows": rows}


def _noise(d: Diagnosis) -> list[tuple[str, ...]]:
    n = d.noise
    sizes = {a: [in_axis_units(a, v[a]) for v in (n.floor, n.repeats, n.declared)] for a in n.floor}
    return [(a, *v, f"{c:.2g}" if np.isfinite(c := n.consistency[a]) else "–") for a, v in sizes.items()]


def _checks(before: Sequence[Check], after: Sequence[Check]) -> list[tuple[object, ...]]:
    rows: list[tuple[object, ...]] = []
    for b, a in zip(before, after, strict=True):
        found = (f"{b.rms:.2f}", f"{b.p:.2g}", f"{a.rms:.2f}", f"{a.p:.2g}") if b.contrasts else ("-",) * 4
        rows.append((b.name, b.meaning, b.contrasts, *found))
    return rows


def _at(p: Rest) -> str:
    if p.position is None:
        return ""
    return f"{place_text(p.position, '.0f')}: {in_axis_units(p.axis, p.size)} rms"


def _seen(d: Diagnosis) -> list[tuple[str, str, str]]:
    turning = {n for n, j in joints(d.declared.description).items() if j.kind != "prismatic"}
    return [row for _, row in sorted((_one_seen(x, turning) for x in d.detectable), key=lambda pair: pair[0])]


def _one_seen(x: Detectability, turning: set[str]) -> tuple[float, tuple[str, str, str]]:
    numbers = {p.name: p for p in registry.get(x.kind).parameters}
    turns = any(f"{leg}.{x.element}" in turning for leg in x.legs) or x.element in turning
    sizes, ease = [], float("inf")
    for name, value in x.sizes.items():
        if value is None:
            continue
        p = numbers[name]
        shown = in_shop_units(value, p.angular if turns and p.angular else p.unit)
        sizes.append(f"{name.replace('_', ' ')} {shown}")
        ease = min(ease, abs(value) / p.scale)
    legs = f" of {', '.join(x.legs)}" if x.legs else ""
    return ease, (registry.get(x.kind).title, f"{in_shop_words(x.element)}{legs}", ", ".join(sizes))


def _digests(d: Diagnosis) -> dict[str, str]:
    e = d.experiment
    return {
        f"machine {d.declared.name}, as loaded": digest(d.declared.description),
        f"readings of {e.name}, SI": digest(e.position, e.wrench, e.reading, e.sigma),
    }


def in_shop_words(text: str) -> str:
    """A line of the screen with drives called so, and no marks of code."""
    return text.replace("actuator", "drive").replace("`", "")


def in_axis_units(axis: str, value: float) -> str:
    """A reading's size: µm, µrad for a rotation; a dash for none."""
    if not np.isfinite(value):
        return "–"
    return f"{1e6 * value:.2f} {'µrad' if axis.startswith('r') else 'µm'}"


def in_shop_units(value: float, unit: str, digits: int = 4) -> str:
    """A number of an effect or a machine: µm, µm/N, mrad."""
    factor, name = sentences.UNITS.get(unit, (1.0, unit))
    return f"{factor * value:.{digits}g} {name}".rstrip()


def p_text(p: float) -> str:
    """A p-value; 0 is what no double holds."""
    return f"{p:.2g}" if p > 0 else "below 1e-300"
