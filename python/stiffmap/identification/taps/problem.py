"""Readings of a tap test, and static ones with them, against machines near the declared one; what may explain them (docs/theory.md V8)."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats
from stiffmap.experiment import Experiment
from stiffmap.experiment.noise.level import noise_of
from stiffmap.experiment.prediction.predict import Predictor
from stiffmap.identification.candidates.candidates import Candidate, of_kind
from stiffmap.identification.taps.predict import predict_taps
from stiffmap.identification.taps.table import TapTest
from stiffmap.model import effects
from stiffmap.model.addresses import moved, number
from stiffmap.model.description import Body, Cable, Joint, MachineDescription
from stiffmap.model.description.tree import all_elements, edit
from stiffmap.model.effects import Parameter, apply_records
from stiffmap.solve.machine import Machine
from stiffmap.workspace.vibration.modes import ASSUMED, damping_of

FELT = 0.05
"""Numbers whose uncertainty shifts no reading by more than this share of its noise are not fitted."""
LOST = 3.0
"""Residual, relative, of a mode that a machine no longer has."""
SPREAD, LEVEL = 0.5, 1.0
"""Logarithms: what damping ratios of one machine differ by from mode to mode, and what their level is off by, where none is declared."""
LEAST = 1e-4
"""Damping ratio of a mode without a damper."""
MODAL = "modal_damping"
FIELDS = {"link_mass": "mass", "damper": "damping"}
"""Causes that add to a number of an element."""
Causes = Sequence[tuple[Candidate, float]]
"""Causes with their values, SI."""


@dataclass(eq=False)
class TapsProblem:
    """Residuals divided by the noise of the readings; numbers of the machine file that are uncertain move with them."""

    machine: Machine
    taps: TapTest
    statics: Experiment | None
    default_u: float
    numbers: list[tuple[str, float, float]] = field(default_factory=list)
    """Name, value and standard uncertainty of the numbers that readings feel."""

    def __post_init__(self) -> None:
        t = self.taps
        self.declared = damping_of(self.machine)
        d = self.machine.description
        if self.declared.assumed:  # a number like any other, so that a damper does not replace it
            self.machine = Machine(replace(d, modal_damping=(ASSUMED,)), like=self.machine)
        spread = SPREAD if self.declared.assumed else 0.0
        self.size = np.linalg.norm(np.nan_to_num(t.flexibility), axis=1)[:, None]
        # modes are taken as real: dampers shift frequencies by the square of the ratio, shapes by it
        real = np.nan_to_num(t.ratio)
        with np.errstate(divide="ignore", invalid="ignore"):
            of_shape = np.hypot(t.u_flexibility / self.size, real[:, None]).ravel()
        merged = np.where(np.isfinite(t.hammer[:, 0]), predict_taps(self.machine, t).merged, 0.0)
        of_damping = np.sqrt((t.u_ratio / t.ratio) ** 2 + spread**2 + real**2)
        # of two modes that were found as one
        of_damping[merged > 0] = of_shape.reshape(-1, 3)[merged > 0] = np.nan
        of_frequency = np.sqrt((t.u / t.frequency) ** 2 + real**4 + merged**2)
        self.noise = np.concatenate([of_frequency, of_damping, of_shape])
        self.kind = np.repeat(["frequency", "damping", "flexibility"], [len(t), len(t), 3 * len(t)])
        each, at, wrench = np.arange(len(t)), t.position, np.zeros((len(t), 6))
        self.row = np.concatenate([each, each, each.repeat(3)])
        if self.statics is not None:
            at_first = Predictor(self.machine, self.statics)(())
            self.keep = self.statics.read & np.isfinite(at_first)
            self.noise = np.concatenate([self.noise, noise_of(self.statics).sigma[self.keep]])
            self.kind = np.concatenate([self.kind, ["statics"] * int(self.keep.sum())])
            self.row = np.concatenate([self.row, len(t) + np.nonzero(self.keep)[0]])
            at, wrench = np.vstack([at, self.statics.position]), np.vstack([wrench, self.statics.wrench])
        none, ids = np.zeros_like(wrench), tuple(map(str, range(len(at))))
        self.plan = Experiment("taps", self.machine.name, "deflection", ids, at, wrench, none, none + 1.0)
        """Rows of taps, then of statics."""
        base = self._raw(self.machine, t)
        self.used = np.isfinite(base) & np.isfinite(self.noise)
        columns = []
        free = uncertain_numbers(self.machine.description, self.default_u)
        if self.declared.assumed:
            free.append((MODAL, ASSUMED, LEVEL * ASSUMED))
        for key, value, u in free:
            other = shifted(self.machine.description, [(key, value, u)], np.ones(1))
            change = self._raw(Machine(other, like=self.machine), t) - base
            column = np.nan_to_num(np.where(self.used, change / self.noise, 0))
            if np.abs(column).max() > FELT:
                self.numbers.append((key, value, u))
                columns.append(column)
        self.slopes = np.stack(columns, axis=1) if columns else np.zeros((len(base), 0))

    def _raw(self, machine: Machine, taps: TapTest) -> Floats:
        p = predict_taps(machine, taps)
        with np.errstate(divide="ignore", invalid="ignore"):
            shape = (p.flexibility - taps.flexibility) / self.size
        damping = np.log(np.maximum(p.ratio, LEAST) / taps.ratio)
        parts = [np.log(p.frequency / taps.frequency), damping, shape.ravel()]
        if self.statics is not None:
            parts.append((Predictor(machine, self.statics)(()) - self.statics.reading)[self.keep])
        return np.concatenate(parts)

    def real(self, causes: Causes = (), off: Floats | None = None) -> tuple[Machine, TapTest]:
        """Machine and tap test with causes, uncertain numbers off by so many standard uncertainties (numbers,)."""
        d, taps = self.machine.description, self.taps
        if off is not None:
            d = shifted(d, self.numbers, off)
        for c, value in causes:
            taps = held(taps, c, value)
        return Machine(with_causes(d, causes), like=self.machine), taps

    def residual(self, causes: Causes = (), off: Floats | None = None) -> Floats:
        """(n,) by noise."""
        raw = self._raw(*self.real(causes, off))
        return np.asarray(np.where(np.isfinite(raw), raw, LOST)[self.used] / self.noise[self.used])

    def only(self, part: str) -> TapsProblem:
        """The problem with a part of the readings: ``taps`` or ``statics``."""
        out = copy(self)
        out.used = self.used & ((self.kind == "statics") == (part == "statics"))
        return out


def with_causes(d: MachineDescription, causes: Causes) -> MachineDescription:
    """The description with those causes that lie in the machine."""
    for c, value in causes:
        d = d if c.kind in HAMMER else _with_cause(d, c, value)
    return d


def _with_cause(d: MachineDescription, c: Candidate, value: float) -> MachineDescription:
    if c.kind == "payload":
        return replace(d, platform=(*d.platform, Body("tapped_load", value)))
    if c.kind not in FIELDS:
        return apply_records(d, [c.term([value])])
    name = FIELDS[c.kind]

    def change(e: Any) -> Any:
        if not hasattr(e, name):  # an offset may have the name of its body
            return None
        return replace(e, **{name: (getattr(e, name) or 0.0) + value})

    return edit(d, ".".join((*(c.legs or ("platform",)), c.element)), change) or d


def held(taps: TapTest, c: Candidate, value: float) -> TapTest:
    """The tap test with a cause, where that is how the hammer was held (SI)."""
    if c.kind not in HAMMER:
        return taps
    way = value * np.eye(3)["xyz".index(c.element)]
    if c.kind == "hammer_direction":
        return replace(taps, hammer=taps.hammer @ Rotation.from_rotvec(way).as_matrix().T)
    return replace(taps, lever=taps.lever + way)


def uncertain_numbers(d: MachineDescription, default_u: float) -> list[tuple[str, float, float]]:
    """Names, values and standard uncertainties (SI): those that the machine file declares, and masses by `default_u`."""
    declared = dict(d.uncertainty)
    masses = {
        f"{full}/mass": default_u * e.mass
        for full, e in all_elements(d)
        if isinstance(e, Body) and e.mass > 0
    }
    both = {**masses, **declared}
    return [(k, v, u) for k, u in both.items() if u > 0 and (v := number(d, k)) is not None]


def shifted(
    d: MachineDescription, numbers: list[tuple[str, float, float]], off: Floats
) -> MachineDescription:
    """Numbers off by so many standard uncertainties; stiffness, compliance and mass by factors, so that they stay positive."""
    for (key, value, u), t in zip(numbers, off, strict=True):
        if key == MODAL:
            d = replace(d, modal_damping=(float(value * np.exp(t * u / value)),))
            continue
        field_ = key.partition("/")[2]
        positive = value > 0 and field_.startswith(("compliance", "stiffness", "mass"))
        delta = value * (np.exp(t * u / value) - 1) if positive else t * u
        other = moved(d, key, float(delta))
        d = d if other is None else other
    return d


KINDS = ("compliance", "joint_compliance", "base_compliance", "tool_compliance")
"""Effects that frequencies show."""
PAYLOAD = Parameter("mass", "kg", 0.0, 1e4, 0.0, 1.0, "of a body at the TCP that the machine file leaves out")
TYPICAL = 0.02
"""Damping ratio that a damper of typical size adds to one of the modes."""
HAMMER = {
    "hammer_direction": Parameter("angle", "rad", -3.2, 3.2, 0.0, 0.1, "by which the hammer is turned about a base axis",
        plausible=(-3.2, 3.2)),
    "hammer_point": Parameter("offset", "m", -5.0, 5.0, 0.0, 0.05, "of the point that is hit, from the TCP, base axes",
        plausible=(-5.0, 5.0)),
}  # fmt: skip


def causes(problem: TapsProblem) -> list[Candidate]:
    """All that the readings can speak of, with one number each: frequencies are few."""
    d, kinds = problem.machine.description, set(problem.kind[problem.used])
    found = [c for kind in KINDS for c in of_kind(effects.get(kind), d)]
    found = [replace(c, parameters=(p,)) for c in found for p in c.parameters if p.null is not None]
    found.append(Candidate("payload", "platform", (), (PAYLOAD,)))
    for full, e in all_elements(d):
        if isinstance(e, Body) and e.mass > 0 and not full.startswith("base."):
            mass = Parameter(
                "mass", "kg", -0.95 * e.mass, 1e4, 0.0, 0.1 * e.mass, "beyond that of the machine file"
            )
            found.append(_at("link_mass", full, mass))
        elif isinstance(e, Joint) and not isinstance(e, Cable) and any(e.laws) and "damping" in kinds:
            found += _damper(problem, full, e)
    if "flexibility" in kinds:
        found += [Candidate(kind, axis, (), (p,)) for kind, p in HAMMER.items() for axis in "xyz"]
    return found


def _at(kind: str, full: str, number: Parameter) -> Candidate:
    sequence, _, path = full.partition(".")
    return Candidate(kind, path, () if sequence == "platform" else (sequence,), (number,))


def _damper(problem: TapsProblem, full: str, e: Joint) -> list[Candidate]:
    """With the size that adds a typical damping ratio to one of the modes; none where it adds nothing."""
    unit = "N·s/m" if e.kind == "prismatic" else "N·m·s/rad"
    own = e.damping or 0.0
    one = _at(
        "damper", full, Parameter("damping", unit, -own, np.inf, 0.0, 1.0, "viscous, beyond that of the file")
    )
    here = predict_taps(problem.machine, problem.taps).ratio
    more = np.nanmax(np.abs(predict_taps(problem.real([(one, 1.0)])[0], problem.taps).ratio - here))
    if not more > 0:
        return []
    size = TYPICAL / float(more)
    return [replace(one, parameters=(replace(one.parameters[0], scale=size, upper=1e3 * size),))]
