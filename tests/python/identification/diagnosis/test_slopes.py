"""Slopes of the readings, told for many candidates at once, against differences of whole predictions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, random_plan
from stiffmap.experiment.channels import Channel
from stiffmap.experiment.experiment import Floats
from stiffmap.experiment.prediction.nearby import Near, Nearby
from stiffmap.identification.candidates.candidates import Candidate, candidates
from stiffmap.identification.candidates.sensitivity import slopes_of, step_of
from stiffmap.model.description import Block, Branch, Point, Spring
from stiffmap.model.effects import Parameter

DOWN = (0.0, 0.0, -9.81)
RELATIVE, ABSOLUTE = 1e-5, 2e-10
"""m or rad per scale of a parameter: far below what any instrument tells of it."""
SOME = 25


def plan_for(machine: sm.Machine, quantity: str, gravity: tuple[float, float, float] | None) -> Experiment:
    loads = {"loads": 2} if quantity == "deflection" else {}
    return replace(random_plan(machine, quantity, poses=5, seed=2, **loads), gravity=gravity)


def told(predictor: Predictor, every: int = 1) -> Iterator[tuple[Candidate, Parameter, Floats]]:
    """Candidates and parameters whose slopes are told without whole predictions."""
    tried = candidates(predictor.machine.description, predictor.experiment)
    slopes = slopes_of(predictor, tried)
    columns = [(c, p, slopes.of((c, p))) for c in tried for p in c.linear]
    found = [(c, p, s) for c, p, s in columns if s is not None]
    assert found
    yield from found[::every]


def moved(candidate: Candidate, p: Parameter, share: float) -> tuple[sm.AppliedEffect, ...]:
    values = [float(q.null or 0.0) + (share * p.scale if q is p else 0.0) for q in candidate.parameters]
    return (candidate.term(values),)


def fourth(predictor: Predictor, candidate: Candidate, p: Parameter) -> Floats:
    """Central difference of whole predictions, per scale."""
    h = 0.3 if step_of(p) > 1e-3 * p.scale else 0.02
    far, up, down, back = (predictor(moved(candidate, p, s * h)) for s in (2, 1, -1, -2))
    return np.asarray((8 * (up - down) - (far - back)) / (12 * h))


def compare(predictor: Predictor, columns: Iterator[tuple[Candidate, Parameter, Floats]]) -> None:
    for candidate, p, slope in columns:
        true = fourth(predictor, candidate, p)
        off = np.abs(slope - true).max()
        assert off < RELATIVE * np.abs(true).max() + ABSOLUTE, (str(candidate), p.name)


CASES = [
    ("linear-delta", "deflection", None),
    ("orthoglide-revised", "position", DOWN),
    ("ur10", "deflection", DOWN),
    ("travelling-column", "position", None),
]


@pytest.mark.parametrize(("name", "quantity", "gravity"), CASES)
def test_some_slopes(name: str, quantity: str, gravity: tuple[float, float, float] | None) -> None:
    machine = sm.load_machine(name)
    predictor = Predictor(machine, plan_for(machine, quantity, gravity))
    compare(predictor, told(predictor, SOME))


HOLD_SPINS = ("linear-delta", "rotary-delta", "hexapod")


@pytest.mark.parametrize("quantity", ["deflection", "position"])
@pytest.mark.parametrize(
    ("name", "gravity"),
    [
        *((name, None) for name in ("linear-delta", "hexapod", "orthoglide-revised", "ur10")),
        ("orthoglide-revised", DOWN),
        ("ur10", DOWN),
    ],
)
def test_all_slopes(name: str, quantity: str, gravity: tuple[float, float, float] | None) -> None:
    machine = sm.load_machine(name)
    predictor = Predictor(machine, plan_for(machine, quantity, gravity))
    compare(predictor, told(predictor))


@pytest.mark.parametrize("name", HOLD_SPINS)
def test_weights_that_may_turn_spins_leave_no_slopes(name: str) -> None:
    machine = sm.load_machine(name)
    predictor = Predictor(machine, plan_for(machine, "deflection", DOWN))
    tried = candidates(machine.description, predictor.experiment)
    slopes = slopes_of(predictor, tried)
    assert all(
        slopes.of((c, p)) is None for c in tried for p in c.linear if p.name == "error" or c.kind == "length"
    )


@pytest.mark.parametrize("name", ["ur10", "linear-delta"])
def test_order(name: str) -> None:
    """One step leaves what is quadratic in the move; of moves in both directions what is of third order."""
    machine = sm.load_machine(name)
    weight = DOWN if name == "ur10" else None
    predictor = Predictor(machine, plan_for(machine, "deflection", weight))
    tried = candidates(machine.description, predictor.experiment)
    candidate = next(c for c in tried if c.kind == "compliance" and len(c.legs) <= 1)
    (p,) = candidate.linear
    true = fourth(predictor, candidate, p)

    def off(share: float) -> tuple[float, float]:
        up, down = predictor.changes([moved(candidate, p, s) for s in (share, -share)])
        assert up is not None and down is not None
        errors = up / share - true, (up - down) / (2 * share) - true
        return float(np.abs(errors[0]).max()), float(np.abs(errors[1]).max())

    (one, central), (half, quarter) = off(0.2), off(0.1)
    assert np.log2(one / half) == pytest.approx(1.0, abs=0.1)
    assert np.log2(central / quarter) == pytest.approx(2.0, abs=0.2)


def test_around_other_effects() -> None:
    """A fit's slopes are taken where the fit stands, under loads that are not as noted."""
    machine = sm.load_machine("orthoglide-revised")
    predictor = Predictor(machine, plan_for(machine, "deflection", None))
    tried = candidates(machine.description, predictor.experiment)
    length = next(c for c in tried if c.kind == "length" and c.element == "bar")
    soft = next(c for c in tried if c.kind == "compliance" and c.element == "foot")
    gain = next(c for c in tried if c.kind == "load_gain")
    base = (length.term([2e-4]), soft.term([1.3]), gain.term([1.05] * len(gain.parameters)))
    (change,) = predictor.changes([(base[0], soft.term([1.3 + 1e-6]), base[2])], base)
    assert change is not None
    whole = predictor((base[0], soft.term([1.301]), base[2])) - predictor(
        (base[0], soft.term([1.299]), base[2])
    )
    assert change / 1e-6 == pytest.approx(whole / 2e-3, rel=1e-5, abs=1e-10)


@pytest.mark.parametrize("name", ["orthoglide-revised", "ur10"])
def test_another_point_of_the_platform(name: str) -> None:
    d = sm.load_machine(name).description
    machine = sm.Machine(replace(d, platform=(*d.platform, Point("probe", (0.03, -0.02, 0.05)))))
    for load_point, point in (("tcp", "platform.probe"), ("platform.probe", "tcp")):
        plan = replace(plan_for(machine, "deflection", None), load_point=load_point, point=point)
        predictor = Predictor(machine, plan)
        compare(predictor, told(predictor, 5 * SOME))


def kinds_told(predictor: Predictor, kinds: Sequence[str], machine: sm.Machine) -> set[str]:
    tried = [c for c in candidates(machine.description, predictor.experiment) if c.kind in kinds]
    assert {c.kind for c in tried} == set(kinds)
    slopes = slopes_of(predictor, tried)
    return {c.kind for c in tried for p in c.linear if slopes.of((c, p)) is not None}


def test_what_needs_whole_predictions() -> None:
    """Laws that only grow, geometry of branches that share a load, and gravity: their steps are large on purpose."""
    machine = sm.load_machine("linear-delta")
    predictor = Predictor(machine, plan_for(machine, "deflection", None))
    whole = ("dead_zone", "hardening", "friction", "joint_compliance", "parallelogram_width", "gravity")
    assert not kinds_told(predictor, whole, machine)
    assert kinds_told(predictor, ("compliance", "zero_offset"), machine) == {"compliance", "zero_offset"}


def test_plans_that_read_more_need_whole_predictions() -> None:
    machine = sm.load_machine("orthoglide-revised")
    plan = plan_for(machine, "deflection", None)
    encoder = Channel("actuator", "m", "x.actuator", "load")
    blank = np.zeros((len(plan), 1))
    wider = replace(plan, reading=np.hstack([plan.reading, blank]), sigma=np.hstack([plan.sigma, blank]))
    for other in (
        replace(plan, gravity_of=np.tile(DOWN, (len(plan), 1))),
        replace(plan, loop=replace(plan.loop, force_against="x.carriage")),
        replace(wider, extra=(encoder,)),
    ):
        d = machine.description
        legs = tuple(
            replace(g, elements=(*g.elements[:4], Point("carriage"), *g.elements[4:])) for g in d.legs
        )
        there = sm.Machine(replace(d, legs=legs))
        assert not kinds_told(Predictor(there, other), ("compliance", "zero_offset"), there)


def test_a_place_is_told_once() -> None:
    machine = sm.load_machine("ur10")
    predictor = Predictor(machine, plan_for(machine, "position", None))
    tried = [c for c in candidates(machine.description, predictor.experiment) if c.kind == "zero_offset"]
    terms = [moved(c, c.parameters[0], 1e-3) for c in tried]
    first, before = predictor.changes(terms), predictor.solved
    assert before > 0
    again = predictor.changes(terms)
    assert predictor.solved == before
    assert all(a is b for a, b in zip(first, again, strict=True))


def test_what_cannot_show_is_told_as_nothing() -> None:
    """Deflections without a load are from the unloaded state to itself, whatever has moved it."""
    machine = sm.load_machine("linear-delta")
    bare = plan_for(machine, "deflection", None)
    predictor = Predictor(machine, replace(bare, wrench=np.zeros_like(bare.wrench)))
    candidate = next(c for c in candidates(machine.description, bare) if c.kind == "zero_offset")
    (change,) = predictor.changes([moved(candidate, candidate.parameters[0], 1e-3)])
    assert change is not None
    assert not change.any()


def test_from_what_is_off_to_what_is_not() -> None:
    """The machine as declared rests at its commands, the one that it is told from does not."""
    machine = sm.load_machine("linear-delta")
    predictor = Predictor(machine, plan_for(machine, "position", None))
    candidate = next(
        c for c in candidates(machine.description, predictor.experiment) if c.kind == "zero_offset"
    )
    off = predictor.with_terms(moved(candidate, candidate.parameters[0], 1e-2))
    (change,) = Nearby(off, predictor.experiment, None).changes([Near(machine.description)])
    assert change is not None
    whole = predictor() - predictor(moved(candidate, candidate.parameters[0], 1e-2))
    assert change == pytest.approx(whole, rel=1e-4, abs=1e-12)
    assert np.abs(change).max() > 1e-7


def test_a_base_of_branches_yields_as_well() -> None:
    """Where branches share a load behind a block, geometry between them is for whole predictions."""
    d = sm.load_machine("orthoglide-revised").description
    spring = Spring("soft", compliance=tuple(tuple(1e-6 * (i == k) for i in range(6)) for k in range(6)))
    block = Block("pair", (Branch("a", (spring,)), Branch("b", (spring,))))
    machine = sm.Machine(replace(d, base=(block, *d.base)))
    predictor = Predictor(machine, plan_for(machine, "deflection", DOWN))
    assert not kinds_told(predictor, ("zero_offset", "tilt", "length"), machine)
