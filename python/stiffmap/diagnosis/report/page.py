"""One self-contained HTML file: verdict, numbers, pictures inside, nothing from the network."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape
from io import BytesIO
from os import PathLike
from pathlib import Path

from matplotlib.figure import Figure

from stiffmap.diagnosis.decision.patterns import Pattern
from stiffmap.diagnosis.report.findings import Effect, Findings
from stiffmap.diagnosis.report.sentences import next_step, opening
from stiffmap.diagnosis.report.wording import effect_text, five_lines, in_display_units, separation_text
from stiffmap.errors import FileError
from stiffmap.experiment.noise.checks import Check

STYLE = """body{font:15px/1.5 system-ui,sans-serif;max-width:62rem;margin:2rem auto;padding:0 1rem;color:#222}
table{border-collapse:collapse;margin:.5rem 0}td,th{border:1px solid #ccc;padding:.2rem .6rem;text-align:left}
th{background:#f3f3f3}img{max-width:100%}
.verdict{background:#eef4f8;border-left:4px solid #2a6f97;padding:.6rem 1rem}
.answer{font-size:1.15rem;background:#eef4f8;border-left:5px solid #0072B2;padding:.7rem 1rem}
table{display:block;overflow-x:auto}td{overflow-wrap:anywhere}small{color:#555}
@media print{@page{size:A4;margin:15mm}body{margin:0;max-width:none;font-size:11px}tr,img{break-inside:avoid}
h2{break-after:avoid}}"""


def write_report(d: Findings, path: str | PathLike[str]) -> None:
    """Write the file; raises `FileError` where it cannot be written."""
    try:
        Path(path).write_text(html(d), encoding="utf-8")
    except OSError as error:
        raise FileError(f"cannot be written: {error.strerror}", file=str(path)) from error


def html(d: Findings) -> str:
    """The report as text."""
    from stiffmap.diagnosis.report.pictures import figures

    pictures = "".join(f"<p><img alt='{name}' src='{inline(f)}'></p>" for name, f in figures(d).items())
    parts = [
        f"<h1>Diagnosis of {escape(d.declared.name)}</h1><p>Experiment {escape(d.experiment.name)}: "
        f"{len(d.experiment)} rows of {d.experiment.quantity}, axes {', '.join(d.experiment.axes)}. "
        "Lengths in mm unless a unit is named; base axes.</p>",
        f"<p class='answer'>{escape(opening(d))}</p><p><b>What to do next.</b> {escape(next_step(d))}</p>",
        "<div class='verdict'>" + "<br>".join(escape(line) for line in five_lines(d)) + "</div>",
        "<h2>Effects</h2>" + _effects(d),
        "<h2>Before and after, on readings that no fit saw</h2>" + _sizes(d),
        "<h2>Noise and fit</h2>" + _noise(d),
        "<h2>Model-free checks</h2>" + _checks(d.checks_before, d.checks_after),
        "<h2>What is left</h2>" + _left(d),
        "<h2>Pictures</h2>" + pictures,
        "<h2>What this experiment could have seen</h2>" + _detectable(d),
        "<h2>Limits</h2>" + _list(d.limitations or ["none known"]),
    ]
    head = f"<meta charset='utf-8'><link rel='icon' href='data:,'><title>stiffmap diagnosis</title><style>{STYLE}</style>"
    return f"<!doctype html><html lang='en'>{head}{''.join(parts)}</html>"


def inline(figure: Figure) -> str:
    """PNG as a data address."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """HTML table; cells are escaped."""
    top = "".join(f"<th>{escape(h)}</th>" for h in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(str(c))}</td>" for c in row) + "</tr>" for row in rows)
    return f"<table><tr>{top}</tr>{body}</table>"


def _list(items: Iterable[str]) -> str:
    return "<ul>" + "".join(f"<li>{escape(i)}</li>" for i in items) + "</ul>"


def _effects(d: Findings) -> str:
    if not d.effects:
        return "<p>No effect is named.</p>"
    out = "".join(_effect(e) for e in d.effects)
    for other, s in zip(d.alternatives, d.separations, strict=True):
        named = escape("; ".join(map(effect_text, other)))
        out += f"<p><b>Or instead:</b> {named}. To decide: {escape(separation_text(s))}.</p>"
    return out


def _effect(e: Effect) -> str:
    rows = [
        (n, in_display_units(v, u), in_display_units(a, u), in_display_units(b, u))
        for n, (v, a, b, u) in e.parameters.items()
    ]
    same = "; ".join(f"{a['kind']} of {a['element']} {' '.join(a['legs'])}" for a in e.aliases)
    alias = f"<p>This plan cannot tell it from: {escape(same)}.</p>" if same else ""
    legs = f", leg {', '.join(e.legs)}" if e.legs else ""
    return (
        f"<h3>{escape(f'{e.kind} of {e.element}{legs}')}</h3>"
        + table(("parameter", "value", "95 % from", "to"), rows)
        + alias
        + f"<p><small>{escape(e.definition)} Chi-square falls by {e.evidence['delta_chi2']:.0f}; "
        f"p-value over the whole search {e.evidence['p_global']:.2g}.</small></p>"
    )


def _sizes(d: Findings) -> str:
    names = [("before", d.before), ("after", d.after)]
    rows = [(n, *(f"{1e3 * v:.4f}" for v in (s.rms, s.p95, s.max)), f"{s.ratio:.3f}", s.n) for n, s in names]
    axes = [(a, f"{1e3 * d.before.per_axis[a]:.4f}", f"{1e3 * v:.4f}") for a, v in d.after.per_axis.items()]
    held = d.held_out
    how = f"{held.folds} folds by {held.by}; " if held else "not held out; "
    chosen = ", ".join(f"{k} in {v}" for k, v in held.chosen.items()) if held else ""
    return (
        table(("", "rms / mm", "95 % / mm", "largest / mm", "rms / noise floor", "readings"), rows)
        + table(("axis", "rms before / mm (rad)", "after"), axes)
        + f"<p>{how}chosen in the folds: {escape(chosen or 'nothing')}.</p>"
    )


def _noise(d: Findings) -> str:
    n = d.noise
    rows = [
        (a, f"{n.floor[a]:.3g}", f"{n.repeats[a]:.3g}", f"{n.declared[a]:.3g}", f"{n.consistency[a]:.2g}")
        for a in n.floor
    ]
    listed = ", ".join(d.outliers) or "none"
    return (
        table(("axis", "floor / m (rad)", "from repeats", "stated", "p-value of the difference"), rows)
        + f"<p>Lack of fit: p = {n.lack_of_fit_before:.2g} before, {n.lack_of_fit_after:.2g} after. "
        f"Outliers listed (rows): {escape(listed)}.</p>"
    )


def _checks(before: Sequence[Check], after: Sequence[Check]) -> str:
    if not before:
        return "<p>Only deflections allow them.</p>"
    rows = [
        (b.name, b.meaning, b.contrasts, *(("-",) * 4 if not b.contrasts else _pair(b, a)))
        for b, a in zip(before, after, strict=True)
    ]
    head = ("check", "means", "contrasts", "rms / noise", "p-value", "rms of what effects leave", "p-value")
    return table(head, rows)


def _pair(b: Check, a: Check) -> tuple[str, str, str, str]:
    return (f"{b.rms:.2f}", f"{b.p:.2g}", f"{a.rms:.2f}", f"{a.p:.2g}")


def _left(d: Findings) -> str:
    if not d.unexplained:
        return "<p>Nothing beyond noise.</p>"
    rows = [(p.axis, p.what, p.detail, _at(p), f"{p.p:.2g}") for p in d.unexplained[:12]]
    out = table(("axis", "pattern", "how", "largest at", "p-value"), rows)
    if d.empirical:
        out += (
            "<p>An <b>empirical</b> correction (Gaussian process, no physical cause claimed) would bring "
            f"held-out readings from {1e3 * d.empirical.before:.4f} mm "
            f"to {1e3 * d.empirical.after:.4f} mm rms.</p>"
        )
    return out


def _at(p: Pattern) -> str:
    if p.position is None:
        return ""
    return "(" + ", ".join(f"{1e3 * v:.0f}" for v in p.position) + f") mm: {p.size:.2g} m (rad) rms"


def _detectable(d: Findings) -> str:
    rows = [
        (
            x.kind,
            x.element,
            " ".join(x.legs),
            ", ".join(f"{n} {v:.3g}" for n, v in x.sizes.items() if v is not None),
        )
        for x in d.detectable
    ]
    return (
        "<p>Smallest change from the null value that is found with 95 % power (SI).</p>"
        + table(("kind", "element", "legs", "size"), rows)
        + "<p>Not observable here, or only as an alias:</p>"
        + f"<details><summary>{len(d.unobservable)} effects</summary>{_list(d.unobservable)}</details>"
    )
