"""Figures of a diagnosis, each with its units; among them the machine with the named element lit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import percent
from stiffmap.experiment.experiment import WRENCH, Floats
from stiffmap.identification.diagnosis.report.result import Diagnosis
from stiffmap.solve.machine import Machine
from stiffmap.ui.plot.experiment import arrow_figure, kept, pose_means, trending, trends, vector_cases
from stiffmap.ui.plot.loaded import loaded_figure
from stiffmap.ui.plot.scene import dots, draw_skeleton, finish, on, scene_axes
from stiffmap.ui.plot.skeleton import element_links, nodes_of, standing
from stiffmap.ui.plot.style import AFTER, BEFORE, MM, UM, new_figure

CAPTIONS = {
    "residual_vectors": "Mean residual (reading less prediction) of each pose as arrows, with the machine of your file and "
    "with that of machine.yaml; both enlarged alike.",
    "place": "The machine at home. The parts that the diagnosis names are red; where it names none that can be drawn, the tool is marked.",
    "before_after": "What the machine of your file and that of machine.yaml leave of the readings, rms: of those that no fit saw, unless "
    "the title says otherwise.",
    "residual_trends": "Residual of every reading against the conditions on which it depends.",
    "residual_others": "Residual of every reading against conditions on which it does not depend.",
    "residual_histogram": "Residuals over the noise. With the right machine they follow the dashed line.",
    "loops": "Reading over load in the order of time, each set-up from its own zero: what was measured, and what the machine of your file "
    "and that of machine.yaml show.",
    "maps": "Error of the tool over a plane of the workspace: the machine of your file, that of machine.yaml, and what changes.",
    "loaded": "The machine of machine.yaml where it deflects most in that plane: without load (dashed), under it (enlarged), and the part "
    "of each spring and drive.",
    "shares": "How the squares of the difference from your file are shared out among noise, declared numbers, effects, and what "
    "has no known cause.",
    "unexplained": "What no effect explains, over the workspace.",
}
LEAST_SHARE = 1e-5  # smaller parts are not drawn
LIT, GREY = "#d62728", "0.65"


def figures(d: Diagnosis) -> dict[str, Figure]:
    """All figures by the names of their files. One that cannot be drawn says so in its place: the answer does not depend on
    its pictures."""
    return {name: drawn(make, d) for name, make in _wanted(d).items()}


def _wanted(d: Diagnosis) -> dict[str, Callable[[Diagnosis], Figure]]:
    made: dict[str, Callable[[Diagnosis], Figure]] = {"place": place_figure, "before_after": before_after}
    if d.experiment.axis_read[:3].any():
        made["residual_vectors"] = vectors
    driven, others = trending(d)
    if driven:
        made["residual_trends"] = lambda d: trends(d, driven)
    if others:
        made["residual_others"] = lambda d: trends(d, others)
    made["residual_histogram"] = histogram
    if d.experiment.load_direction is not None:
        made["loops"] = loops
    if d.effects and d.declared.description.workspace is not None:
        made["maps"] = maps
        if d.experiment.wrench[:, :3].any():
            made["loaded"] = loaded
    if d.verdict != "none":
        made["shares"] = shared_out
    if d.unexplained and d.experiment.groups.max() > 0:
        made["unexplained"] = left
    return made


def drawn(make: Callable[[Diagnosis], Figure], d: Diagnosis) -> Figure:
    """A figure, or one that says why it is not drawn."""
    try:
        return make(d)
    except Exception as problem:
        figure = new_figure(7, 1.2)
        figure.text(0.5, 0.5, f"not drawn: {problem}"[:300], ha="center", va="center", wrap=True, fontsize=9)
        return figure


def loaded(d: Diagnosis) -> Figure:
    """The machine that is handed over under the load where it deflects most."""
    worst = worst_pose(d)
    if worst is None:
        raise StiffmapError("no pose of the plane of the maps has an equilibrium under load")
    return loaded_figure(d.machine, *worst)


def vectors(d: Diagnosis) -> Figure:
    """Mean residual vector of each pose, before and after, on one scale."""
    e = d.experiment

    # of loads along x, y or z, turned to one sign (else + and - would cancel), those that leave most
    def seen(values: Floats, weight: Floats) -> Floats:
        return pose_means(e, kept(d, values)[:, :3] * weight[:, None])

    cases = [(n, seen(d.residual_before, w), seen(d.residual_after, w)) for n, w in vector_cases(e)]
    case, before, after = max(cases, key=lambda c: float(np.nansum(c[1] ** 2)))
    told = "mean residual of each pose"
    both = ((f"before: {told}", before, BEFORE), (f"after: {told}", after, AFTER))
    figure, longest = arrow_figure(pose_means(e, e.position), both)
    figure.supxlabel(f"longest arrow: {longest * UM:.1f} µm{'; ' + case if case else ''}", fontsize=9)
    return figure


def loops(d: Diagnosis) -> Figure:
    """Readings over the load that runs up and down, of the channel that moves most in noise floors."""
    e = d.experiment
    load = int(np.argmax(np.ptp(e.wrench, axis=0)))
    read = np.flatnonzero(e.axis_read)
    sizes = [np.nanstd(e.reading[:, i]) / d.noise.floor[e.channels[i].name] for i in read]
    channel = int(read[int(np.argmax(sizes))])
    scale, unit = (MM, "mm") if e.channels[channel].unit == "m" else (1e3, "mrad")
    told = (("as declared", d.residual_before, BEFORE), (d.which, d.residual_after, AFTER))
    figure = new_figure(9, 5)
    ax = figure.subplots()
    assert e.order is not None
    for k, run in enumerate(np.unique(e.runs)):
        here = np.flatnonzero(e.runs == run)
        here = here[np.argsort(e.order[here], kind="stable")]
        zero = float(np.nanmean(e.reading[here, channel]))
        x, y = e.wrench[here, load], (e.reading[here, channel] - zero) * scale
        ax.plot(x, y, ".", ms=3, color="0.4", label=None if k else "measured")
        for name, values, colour in told:
            shown = y - values[here, channel] * scale
            ax.plot(x, shown, lw=1.0, color=colour, label=None if k else name)
    of_load = "N" if load < 3 else "N·m"
    ax.set(xlabel=f"{WRENCH[load]}, {of_load}", ylabel=f"{e.channels[channel].name}, {unit}")
    ax.legend()
    return figure


def shared_out(d: Diagnosis) -> Figure:
    """Bars of the shares, the largest first."""
    found = [(name, 100 * s) for name, s in sorted(d.shares.items(), key=lambda s: s[1]) if s >= LEAST_SHARE]
    figure = new_figure(7, 0.8 + 0.35 * len(found))
    effects = {str(e).partition(":")[0] for e in d.effects}
    rows = [(n, s, AFTER if n in effects else "0.7", percent(s / 100)) for n, s in found]
    ax = _bars(figure, rows)
    ax.set(xlabel="share of the squares, %", xlim=(0, 115))
    return figure


def _bars(figure: Figure, rows: Sequence[tuple[str, float, str, str]]) -> Axes:
    """A bar for each row of name, length, colour and what is written behind it."""
    ax = figure.subplots()
    names, lengths, colours, texts = zip(*rows, strict=True) if rows else ((),) * 4
    ax.bar_label(ax.barh(names, lengths, color=colours), texts, padding=3)
    ax.spines[["top", "right"]].set_visible(False)
    return ax


def left(d: Diagnosis) -> Figure:
    """What is left over the workspace that nobody can name, in the axis where it is largest."""
    assert d.gap is not None
    names = [c.name for c in d.experiment.channels]
    axis = names.index(d.unexplained[0].axis or names[int(np.argmax(d.experiment.axis_read))])
    at = pose_means(d.experiment, d.experiment.position) * MM
    values = pose_means(d.experiment, kept(d, d.gap))[:, axis] * UM
    top = float(np.nanmax(np.abs(values))) or 1.0
    figure = new_figure(11, 3.4)
    row = figure.subplots(1, 3)
    for ax, (a, b) in zip(row, ((0, 1), (0, 2), (1, 2)), strict=True):
        dots = ax.scatter(at[:, a], at[:, b], c=values, cmap="coolwarm", vmin=-top, vmax=top, s=36)
        ax.set(xlabel=f"{'xyz'[a]}, mm", ylabel=f"{'xyz'[b]}, mm")
    figure.colorbar(dots, ax=list(row), label=f"{names[axis]}, µm")
    return figure


def before_after(d: Diagnosis) -> Figure:
    """Rms of what both machines leave of readings that no fit saw, and the noise."""
    unit = d.before.size[1]
    values = [UM * d.before.size[0], UM * d.after.size[0], UM * d.noise_size]
    figure = new_figure(4.6, 2.4)
    texts = [f"{v:.0f} µ{unit}" if v >= 100.0 else f"{v:#.3g} µ{unit}" for v in values]
    named = (("your file", BEFORE), (f"machine.yaml ({d.which})", AFTER), ("noise", "0.7"))
    ax = _bars(figure, [(n, v, c, text) for (n, c), v, text in zip(named, values, texts, strict=True)])
    ax.invert_yaxis()
    ax.set_xlim(0, 1.4 * max(values))
    ax.locator_params(axis="x", nbins=6, prune="upper")  # the last number would be cut at the edge
    ax.set(xlabel=f"left of {d.after.n} readings, rms, µ{unit}")
    if d.held_out is None:
        ax.set_title("not held out: the fit saw these readings", fontsize=9)
    return figure


def histogram(d: Diagnosis) -> Figure:
    """Residuals over the noise floor, with the normal distribution that noise alone would give."""
    figure = new_figure(6, 3.4)
    ax = figure.subplots()
    floor = np.array([d.noise.floor.get(c.name, np.nan) for c in d.experiment.channels])
    both = [(kept(d, r) / floor) for r in (d.residual_before, d.residual_after)]
    width = min(12.0, max(4.0, float(np.nanpercentile(np.abs(both[0]), 99))))
    bins = np.linspace(-width, width, 61)
    for z, colour, label in zip(both, (BEFORE, AFTER), ("before", "after"), strict=True):
        seen = np.clip(z[np.isfinite(z)], bins[0], bins[-1])
        ax.hist(seen, bins.tolist(), density=True, histtype="step", color=colour, label=label, lw=1.5)
    ax.plot(bins, np.exp(-(bins**2) / 2) / np.sqrt(2 * np.pi), color="0.4", ls="--", label="noise alone")
    ax.set(xlabel="residual / noise (standard deviations)", ylabel="density")
    ax.legend()
    return figure


def maps(d: Diagnosis) -> Figure:
    """Error over a z-plane: the file's machine, the one that is handed over, and what changes."""
    position, force, one, other = plane_errors(d)
    x, y, z = MM * position[0, :, 0], MM * position[:, 0, 1], MM * position[0, 0, 2]
    if not np.isfinite(one).any() or not np.isfinite(other).any():
        raise StiffmapError("no pose of the plane of the maps has an equilibrium under this force")
    figure = new_figure(11, 3.8)
    axes = figure.subplots(1, 3)
    top = float(np.nanmax([np.nanmax(np.linalg.norm(v, axis=-1)) for v in (one, other)])) * MM
    titles = ("machine of the file", f"machine.yaml ({d.which})", "difference of the two")
    for ax, title, v in zip(axes, titles, (one, other, other - one), strict=True):
        size = np.linalg.norm(v, axis=-1) * MM
        limit = {} if title.startswith("difference") else {"vmin": 0.0, "vmax": top}
        shade = ax.pcolormesh(x, y, size, shading="nearest", cmap="viridis", **limit)
        figure.colorbar(shade, ax=ax, label="|error|, mm")
        ax.set(title=title, xlabel="x, mm", ylabel="y, mm", aspect="equal")
    load = "no force" if not force.any() else "force (" + ", ".join(f"{f:.0f}" for f in force[:3]) + ") N"
    figure.suptitle(f"Error of the TCP over the plane z = {z:.0f} mm, {load}")
    return figure


def worst_pose(d: Diagnosis) -> tuple[Floats, Floats] | None:
    """Position (3,) m in the plane of the maps where the machine that is handed over deflects most, and the wrench (6,) N, N·m.

    None without a force or a workspace, or where no pose of the plane has an answer.
    """
    if d.declared.description.workspace is None:
        return None
    position, force, _, errors = plane_errors(d)
    size = np.linalg.norm(errors, axis=-1)
    if not force.any() or not np.isfinite(size).any():
        return None
    return position[np.unravel_index(int(np.nanargmax(size)), size.shape)], force


@lru_cache(maxsize=1)  # several pictures of one report, and its words, ask for them
def plane_errors(d: Diagnosis) -> tuple[Floats, Floats, Floats, Floats]:
    """Positions (25, 25, 3) m in the middle plane of the workspace, the wrench (6,) N, N·m, and errors (25, 25, 3) m before and after.

    Of the forces used, along x, y or z, it is the one under which the machines differ most.
    """
    low, high = d.declared.workspace
    x, y, _ = np.linspace(low, high, 25).T
    position = np.stack(np.broadcast_arrays(*np.meshgrid(x, y), (low[2] + high[2]) / 2), axis=-1)
    size = float(np.abs(d.experiment.wrench[:, :3]).max())
    tried = [np.append(size * axis, np.zeros(3)) for axis in np.eye(3)] if size > 0 else [np.zeros(6)]
    found = [(position, w, _errors(d.declared, position, w), _errors(d.machine, position, w)) for w in tried]
    return max(found, key=lambda f: float(np.max(np.abs(np.nan_to_num(f[3] - f[2])))))


def _errors(machine: Machine, position: Floats, wrench: Floats) -> Floats:
    solution = machine.solve(position, wrench)
    return np.where(solution.ok[..., None], solution.displacement[..., :3], np.nan)


def place_figure(d: Diagnosis) -> Figure:
    """The declared machine at home in grey; legs of the named effects dark, their elements red."""
    machine = d.declared
    shape = standing(machine)
    figure = new_figure(4.6, 3.4)
    ax = scene_axes(figure, shape, None)
    legs = {leg for e in d.effects for leg in e.legs}
    few = len(legs) < len(machine.legs)
    colours = {leg: "0.2" if few and leg in legs else GREY for leg in ("", *machine.legs)}
    draw_skeleton(ax, shape, colours, joints=False)
    frames, _ = machine.compiled.frames(shape.coordinates)
    for e in d.effects:
        found = list(nodes_of(machine.compiled, e.element, e.legs))  # none of instruments and loads
        for k in element_links(machine, e.element, e.legs):
            ax.plot(*on(ax, shape.links[k]), color=LIT, lw=4)
        dots(ax, frames[found] if found else shape.tcp, 90, color=LIT)
    finish(ax)
    ax.set_axis_off()
    legs_of = (f" of leg {', '.join(e.legs)}" if e.legs else "" for e in d.effects)
    names = (e.element.replace("actuator", "drive") + of for e, of in zip(d.effects, legs_of, strict=True))
    figure.suptitle("; ".join(names)[:80] or machine.name, fontsize=10)
    return figure
