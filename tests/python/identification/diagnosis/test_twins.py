"""The generator of twins against the library's effects, which share no code with it; and diagnoses of a few of them."""

from __future__ import annotations

import numpy as np
import pytest
from tests.oracle.twins.faults import Fault, elastic, geometric, plain
from tests.oracle.twins.generator import shown, twin
from tests.oracle.twins.judge import judged, of_diagnosis
from tests.oracle.twins.noise import KINDS

import stiffmap as sm
from stiffmap.experiment import Predictor, random_plan


def fault(machine: str, kind: str, at: str) -> Fault:
    d = sm.load_machine(machine).description
    return next(f for f in [*elastic(d), *geometric(d)] if (f.kind, f.at) == (kind, at))


@pytest.mark.parametrize(
    ("machine", "kind", "at", "size", "effect"),
    [
        ("ur10", "zero", "arm.elbow", 4e-4, {"kind": "zero_offset", "element": "elbow", "error": 4e-4}),
        ("ur10", "gain", "arm.shoulder", 2e-4, {"kind": "lead_error", "element": "shoulder", "slope": 2e-4}),
        ("tripteron", "soft", "2.actuator", 0.7, {"kind": "compliance", "element": "actuator", "legs": ["2"], "scale": 1.7}),
        ("linear-delta", "soft", "b.carriage", 0.5, {"kind": "compliance", "element": "carriage", "legs": ["b"], "scale": 1.5}),
    ],
)  # fmt: skip
def test_faults_by_hand_show_what_effects_say(
    machine: str, kind: str, at: str, size: float, effect: dict[str, object]
) -> None:
    m = sm.load_machine(machine)
    declared = plain(m.description)
    quantity = "deflection" if kind == "soft" else "position"
    plan = random_plan(m, quantity, poses=4, repeats=1, seed=1)
    plan = plan.rows(np.arange(min(8, len(plan))))
    built = shown(declared, fault(machine, kind, at).of(declared, size), plan)
    without = shown(declared, declared, plan)
    kind_of, element = str(effect.pop("kind")), str(effect.pop("element"))
    m = sm.Machine(declared)
    said = Predictor(m.with_effect(kind_of, element=element, **effect), plan)() - Predictor(m, plan)()  # type: ignore[arg-type]
    assert np.abs(said[:, :3]).max() > 1e-7
    assert built - without == pytest.approx(said[:, :3], abs=1e-4 * np.abs(said).max())


@pytest.mark.parametrize("kind", KINDS)
def test_noise_has_the_size_that_it_is_called(kind: str) -> None:
    z = KINDS[kind](np.random.default_rng(0), 20000, 3)
    middle = float(np.diff(np.quantile(z, [0.1587, 0.8413]))[0]) / 2
    size = {"half": 2.0, "double": 0.5, "heavy": 0.68}.get(kind, 1.0)
    assert middle == pytest.approx(size, rel=0.2)
    after = np.corrcoef(z[1:, 0], z[:-1, 0])[0, 1]
    assert after == pytest.approx(0.7 if kind == "correlated" else after, abs=0.05)


@pytest.mark.parametrize(("number", "faults", "word"), [(10, 1, "right"), (10, 0, "quiet")])
def test_a_twin_is_diagnosed_right_and_one_without_a_fault_quietly(
    number: int, faults: int, word: str
) -> None:
    t = twin(number, kind="gaussian", faults=faults, poses=8, strength=3.0, spread=0.0)
    assert len(t.faults) == faults
    assert judged(t, of_diagnosis(sm.diagnose(t.machine, t.experiment))).word == word


@pytest.mark.parametrize(("number", "spread"), [(52000, 0.3), (62010, 0.0), (62038, 0.3)])
def test_rows_that_slip_are_no_cause(number: int, spread: float) -> None:
    """Two of ten rows are off by 10 to 30 standard deviations in all of their readings, next to small numbers that are off."""
    t = twin(number, kind="outliers", faults=0, poses=10, strength=0.0, spread=spread)
    d = sm.diagnose(t.machine, t.experiment)
    assert d.verdict == "none"
    assert any("far from the others" in line for line in d.limitations)
