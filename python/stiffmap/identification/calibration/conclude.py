"""The answer of a calibration: verdict, table, what is left and what held-out readings say."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stiffmap.experiment.channels import metres
from stiffmap.experiment.comparison.summary import rms
from stiffmap.experiment.experiment import Experiment, Floats, Mask
from stiffmap.experiment.noise.folds import folds
from stiffmap.experiment.noise.level import Noise
from stiffmap.experiment.noise.over_time import over_time
from stiffmap.experiment.poses.configuration import coordinates_of
from stiffmap.identification.calibration.calibrator import Calibrator
from stiffmap.identification.calibration.claimed_fit import claimed_fit
from stiffmap.identification.calibration.corrected import Correction
from stiffmap.identification.calibration.facts import Beyond, Row, Unseen, Wider
from stiffmap.identification.calibration.groups import BASE, compare
from stiffmap.identification.calibration.held_out import Size, held_out
from stiffmap.identification.calibration.homing import own_part
from stiffmap.identification.calibration.model import Fitted
from stiffmap.identification.calibration.pulls import Pulls, pulls
from stiffmap.identification.calibration.result import Calibration
from stiffmap.identification.calibration.statistics import Sums, independent
from stiffmap.identification.calibration.travel import Drive, Travel, travel
from stiffmap.identification.calibration.unknowns import Unknown, joint_name
from stiffmap.identification.calibration.validity import covered


def conclude(ready: Calibrator, seed: int = 0) -> Calibration:
    """The calibration with its verdict."""
    start = time.perf_counter()
    sums, members = ready.sums, ready.members()
    names = ready.sensitivity.unknowns
    claimed, fit, rho = claimed_fit(ready, sums, members, seed)
    factor, found, wider = claimed.factor, claimed.singles, claimed.groups
    freed = ready.blocks(fit=fit).beside(rho).scaled(factor)
    choice = compare(freed, members, [b for b in BASE if b in members])
    built = found.built(fit.values, names, ready.sensitivity.at)
    e = ready.predictor.experiment
    before, after = ready.left(ready.sensitivity.base), ready.left(fit.prediction)
    keep = ~ready.out[:, None]
    unit, size, noise = _unit(e, ready.noise)
    b, a = (size(np.where(keep, v, np.nan)) for v in (before, after))
    held = held_out(ready, choice, factor, fit, rho, seed, size)
    as_declared = sums.log_evidence <= sums.pick([]).log_evidence and not claimed.any
    misfits = ready.misfits(fit, factor)
    profiles = _travel(ready, fit, rho, factor, seed, size) if misfits else None
    correction = Correction(ready, claimed, rho, fit.values)
    unseen = _unseen(correction, seed, size)
    if profiles is not None:
        with_profiles = replace(correction, hats=profiles.hats)
        found_with = _unseen(with_profiles, seed, size)
        if unseen and found_with and found_with.after < unseen.after:
            correction, unseen = with_profiles, found_with
        else:  # in full, not along the slopes, they do not hold
            profiles = None
    rest = _outweighs(held.before, held.after, noise) if held else _outweighs(b, a, noise)
    unexplained = (rest or bool(claimed.refused)) and not claimed.any and misfits
    seconds = {**ready.seconds, "evidence": time.perf_counter() - start}
    rows = _rows(names, freed, factor, built)
    valid = covered(ready.predictor.machine, e, ~ready.out)
    if unseen:
        valid = replace(valid, error=unseen.after, error_u=unseen.u, unit=unit)
    far = pulls(
        freed,
        [u.name for u in names],
        np.array([r.pull for r in rows]),
        np.array([r.identifiable for r in rows], dtype=bool),
    )
    return Calibration(
        verdict=_verdict(as_declared, found.found, wider, unexplained, far),
        rows=rows,
        pulls=far,
        beyond=found.found,
        groups=choice,
        rank=sums.rank,
        held_out=held,
        rms_before=b,
        rms_after=a,
        noise=noise,
        floor=float(np.sqrt(rho)) * noise,
        explained=1.0 - (a / b) ** 2 if b > 0 else 0.0,
        rest=_rest(e, np.where(keep, after, np.nan), size),
        wider=wider,
        refused=claimed.refused,
        travel=profiles,
        outliers=tuple(e.ids[i] for i in np.flatnonzero(ready.out)),
        failed=ready.sensitivity.failed,
        stopped=ready.stopped,
        unit=unit,
        machine=valid.kept_by(correction.of(np.ones(len(e), bool)).machine),
        validity=valid,
        found_again=claimed.found_again,
        over_time=over_time(ready.problem, fit.residual),
        unseen=unseen,
        correction=correction,
        experiment=e,
        residual=after,
        unknowns=names,
        values=built,
        seconds=seconds,
    )


def _unseen(correction: Correction, seed: int, size: Size) -> Unseen | None:
    """What the corrected machine says of readings that no fit saw."""
    if correction.ready.stopped:
        return None
    found = correction.unseen(seed)
    return Unseen.of(*found, size) if found else None


def _travel(
    ready: Calibrator, fit: Fitted, rho: float, factor: Floats, seed: int, size: Size
) -> Travel | None:
    """What is left, as profiles over the drives' coordinates."""
    e, s = ready.predictor.experiment, ready.sensitivity
    label, by = folds(e, seed)
    zeros = [i for i, u in enumerate(s.unknowns) if u.group == "zeros" and not u.setup]
    if e.quantity != "position" or not zeros or ready.stopped:
        return None
    machine = ready.predictor.machine
    at = coordinates_of(machine, e)
    drives = [
        Drive(name, u.unit, s.columns[..., i] / u.u, at[:, machine.compiled.names.joints[joint_name(name)]])
        for i, u, name in ((i, s.unknowns[i], s.unknowns[i].moves[0][0][0]) for i in zeros)
    ]

    def own(rest: Floats, test: Mask) -> Floats:
        return own_part(s.unknowns, ready.columns, rest, test)

    def told(left: Floats) -> float:
        return size(ready.unwhite(left))

    label = label[ready.problem.index[0]]
    return travel(ready.problem, drives, ready.columns * factor, fit.linear, rho, label, by, own, told)


def _outweighs(before: float, after: float, noise: float) -> bool:
    """Whether of a misfit (rms) more is left than is explained, noise taken off."""
    return after**2 - noise**2 > 0.5 * (before**2 - noise**2) > 0.0


def _unit(e: Experiment, noise: Noise) -> tuple[str, Size, float]:
    """The unit of misfits: lengths, or angles where nothing else is read."""
    lengths = metres(e.channels)
    columns = lengths & e.axis_read if (lengths & e.axis_read).any() else e.axis_read
    floor = float(np.sqrt(np.mean(noise.floor[columns] ** 2)))
    return ("m" if lengths[columns].any() else "rad"), (lambda values: rms(values[:, columns])), floor


def _rest(e: Experiment, left: Floats, size: Size) -> dict[str, float]:
    out = {c.name: rms(left[:, [i]]) for i, c in enumerate(e.channels) if e.axis_read[i]}
    setups = list(dict.fromkeys(e.setup))
    if len(setups) > 1:
        labels = np.array(e.setup)
        out |= {f"set-up {s}": size(left[labels == s]) for s in setups[:12]}
    return out


def _verdict(
    as_declared: bool, beyond: Sequence[Beyond], wider: Sequence[Wider], unexplained: bool, far: Pulls
) -> str:
    single = [
        b.name if not b.rivals else f"{b.name} or {len(b.rivals)} other{'s' * (len(b.rivals) > 1)}"
        for b in beyond
    ]
    whole = [f"{' or '.join((w.group, *w.rivals))} as a whole" for w in wider]
    if single or whole:
        return "beyond tolerance: " + ", ".join([*single, *whole])
    if unexplained:
        return "unattributed"
    if as_declared:
        return "as declared"
    return "adjusted within tolerance" if far.within else "adjusted beyond tolerance"


def _rows(names: Sequence[Unknown], sums: Sums, factor: Floats, values: Floats) -> tuple[Row, ...]:
    spread = np.sqrt(np.maximum(np.diag(sums.covariance), 0.0)) if len(names) else np.zeros(0)
    kept, _ = independent(sums.gram)
    minimal = {int(i) for i in kept}
    out = []
    for i, (p, v) in enumerate(zip(names, values, strict=True)):
        told = 1.0 - spread[i] ** 2
        u = p.u * factor[i]
        out.append(
            Row(
                p.name,
                p.group,
                p.leg,
                p.unit,
                float(v * p.u),
                p.u,
                float(spread[i] * u),
                float(v / factor[i] / np.sqrt(told)) if told > 1e-9 else 0.0,
                bool(told > 0.5),
                float(1.0 / spread[i]),
                i in minimal,
            )
        )
    return tuple(out)
