"""Which sets of effects are found: on columns whose truth is known, and on readings of machines."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.python.identification.inference.synthetic import CHANNELS, READINGS, columns

import stiffmap as sm
from stiffmap.experiment import Experiment, Predictor, load_experiment, random_plan, simulate
from stiffmap.identification.candidates.candidates import Candidate
from stiffmap.identification.candidates.sensitivity import plan_of
from stiffmap.identification.inference.amplitudes import fitted
from stiffmap.identification.inference.chosen import Chosen
from stiffmap.identification.inference.columns import Columns
from stiffmap.identification.inference.constants import ODDS
from stiffmap.identification.inference.names import Search, infer, searched, with_travel
from stiffmap.identification.inference.parts import Parts
from stiffmap.identification.inference.places import Place, Shape
from stiffmap.identification.inference.verdict import TOLERABLE, Beyond, effect_of, judged
from stiffmap.identification.inference.world import Model, World
from stiffmap.identification.numbers.unknowns import Unknown
from stiffmap.model import effects
from stiffmap.model.description import AppliedEffect

DATA = Path(__file__).parents[3] / "data/experiments"


def place(name: str, column: np.ndarray, free: np.ndarray, most: float = np.inf) -> Place:
    """One direction that is a candidate of its own."""
    scale = effects.get("compliance").parameter("scale")
    candidate = Candidate(
        "compliance",
        name,
        ("a",),
        (replace(scale, name="strength", lower=-np.inf, plausible=None, upper=np.inf),),
    )
    lines = (free @ column)[None]
    variant: Any = SimpleNamespace(
        lines=lambda use: lines[:, use], candidate=candidate, shape=(), sign=np.ones(1), most=most
    )
    return Place(candidate, (Shape(variant, (column / np.linalg.norm(column))[:, None], 0),))


def setting(seed: int, strengths: tuple[float, float, float]) -> Any:
    """Three legs and all of them together as candidates, each leg with a strength in noise (norm)."""
    rng = np.random.default_rng(seed)
    c = columns(rng)
    legs = np.linalg.qr(rng.normal(size=(len(c), 3)))[0] @ np.array([[1, 0.3, 0.3], [0, 1, 0.3], [0, 0, 1]])
    legs /= np.linalg.norm(legs, axis=0)
    names = [place(f"leg {k + 1}", legs[:, k], c.free) for k in range(3)]
    every = place("all legs", legs.sum(axis=1), c.free)
    residual = legs @ np.array(strengths) + rng.normal(size=len(c))
    return replace(c, residual=residual, zero=np.zeros((len(c), len(c))), places=(*names, every))


def found(c: Any) -> set[str]:
    return {s.place.candidate.element for s in searched(c).best.chosen}


@pytest.mark.parametrize("seed", range(3))
def test_two_legs_are_found_though_all_of_them_together_explain_more_than_each(seed):
    """All legs less the third would be the end of single steps."""
    assert found(setting(seed, (0.0, 40.0, 30.0))) == {"leg 2", "leg 3"}


@pytest.mark.parametrize("seed", range(3))
def test_one_effect_is_one_and_nothing_is_nothing(seed):
    assert found(setting(seed, (25.0, 25.0, 25.0))) == {"all legs"}
    assert found(setting(seed, (0.0, 30.0, 0.0))) == {"leg 2"}
    assert found(setting(seed, (0.0, 0.0, 0.0))) == set()


@pytest.mark.parametrize(
    "bend", [200.0, 20.0]
)  # the second is beyond what corrections of straight lines follow
def test_an_effect_that_bends_is_found_with_its_own_strength(bend: float) -> None:
    """A strength v shows v + v²/bend along its direction, which a straight line takes for a larger one."""
    c = setting(2, (0.0, 30.0 + 30.0**2 / bend, 0.0))

    def predict(chosen: Any) -> np.ndarray:
        lines = [s.rotated(c) @ s.values for s in chosen]
        return np.sum([v * (1 + np.linalg.norm(v) / bend) for v in lines], axis=0)

    best = searched(c, predict).best
    assert [s.place.candidate.element for s in best.chosen] == ["leg 2"]
    (one,) = best.chosen
    strength = one.by_posterior(best.fit) if bend > 100 else one
    line = strength.rotated(c) @ strength.values
    assert np.sign(line @ c.residual) * np.linalg.norm(line) == pytest.approx(30.0, abs=3.0)


def test_no_machine_is_asked_for_what_none_can_have() -> None:
    """As a spring that shows by its stiffness alone, and would tear the tool away."""
    c = setting(2, (0.0, 30.0, 0.0))
    limited: Any = c.places[1].shapes[0].variant
    strength = 30.0 / np.linalg.norm(limited.lines(slice(None)))
    asked: list[float] = []

    def predict(chosen: Any) -> np.ndarray:
        asked.extend(float(np.abs(s.values).max()) for s in chosen if s.variant is limited)
        return np.sum([s.rotated(c) @ s.values for s in chosen], axis=0)

    limited.most = 2.0 * strength
    assert [s.variant for s in searched(c, predict).best.chosen] == [limited]
    limited.most = 0.5 * strength
    asked.clear()
    assert limited not in [s.variant for s in searched(c, predict).best.chosen]
    assert max(asked, default=0.0) <= limited.most


def test_an_effect_that_the_machine_cannot_have_gives_way_to_what_shows_nearly_the_same() -> None:
    """As a compliance that falls below zero within the travel: named, it would have no corrected machine, and no other a name."""
    c = setting(2, (0.0, 30.0, 0.0))
    impossible = c.places[1]
    near = impossible.shapes[0].directions[:, 0] + 0.03 * c.places[0].shapes[0].directions[:, 0]
    c = replace(c, places=(*c.places, place("near leg 2", near, c.free)))

    def predict(chosen: Any) -> np.ndarray:
        shown = np.sum([s.rotated(c) @ s.values for s in chosen], axis=0)
        return np.full_like(shown, np.nan) if any(s.place is impossible for s in chosen) else shown

    assert found(c) == {"leg 2"}
    assert [s.place.candidate.element for s in searched(c, predict).best.chosen] == ["near leg 2"]


def test_what_shows_the_same_is_an_equivalent():
    c = setting(1, (0.0, 30.0, 0.0))
    twin = place("twin of leg 2", c.places[1].shapes[0].directions[:, 0] + 1e-3, c.free)
    s = searched(replace(c, places=(*c.places, twin)))
    (near,) = s.equivalents
    assert {s.best.chosen[0].place.candidate.element, *(p.candidate.element for p, _ in near)} == {
        "leg 2",
        "twin of leg 2",
    }
    assert all(abs(x) < np.log(ODDS) for _, x in near)
    assert judged_word(s) == "ambiguous"


@pytest.mark.parametrize("number", [0, 1])
def test_what_is_nothing_at_the_optimum_leaves_the_search_and_the_others_are_fitted_anew(number: int) -> None:
    c = setting(1, (0.0, 40.0, 30.0))
    c = replace(c, experiment=one_place(len(c.rows)))
    s = searched(c)
    gone, (other,) = s.best.chosen[number], [o for o in s.best.chosen if o is not s.best.chosen[number]]
    t = s.less(gone)
    assert [o.part.name for o in t.best.chosen] == [other.part.name]
    assert t.gain == (s.gain[1 - number],) and t.equivalents == (s.equivalents[1 - number],)
    assert t.best.fit.noise > 3.0 * s.best.fit.noise
    v = judged(c, s.less(gone), ((gone, "nothing"),))
    assert [why for _, why in v.gone] == ["nothing"] and gone.place not in [n.chosen.place for n in v.named]
    again = s.less(gone, gone.place)
    assert {id(o.place) for o in again.best.chosen} == {id(other.place), id(gone.place)}
    of = [dict(zip((o.part.name for o in x.best.chosen), x.gain, strict=True)) for x in (s, again)]
    assert of[0] == of[1]
    assert s.less(replace(gone, part=replace(gone.part, name="a number"))) is s


def inferred(machine: sm.Machine, experiment: Experiment) -> tuple[Columns, Search]:
    """The columns of an experiment, and the set of effects with the best evidence."""
    predictor = Predictor(machine, experiment)
    found = infer(predictor, plan_of(predictor))
    return found.columns, found.search


def judged_word(s: Any) -> str:
    return "ambiguous" if any(s.equivalents) else "effects"


@pytest.mark.parametrize(
    ("name", "kind", "element", "leg"),
    [("A-servo", "compliance", "actuator", "z"), ("C-backlash", "dead_zone", "actuator", "y")],
)
def test_an_experiment_on_disk_has_its_cause(name, kind, element, leg):
    folder = DATA / name
    machine = sm.load_machine("orthoglide-revised")
    c, s = inferred(machine, load_experiment(folder))
    v = judged(c, s)
    assert v.word in ("effects", "ambiguous") and not v.beyond and not v.rest
    (one,) = v.named
    places = [one.chosen.place, *one.equivalents]
    assert (kind, element, (leg,)) in [a.place for p in places for a in (p.candidate, *p.aliases)]
    assert s.best.fit.noise == pytest.approx(1.0, abs=0.15)


def test_a_machine_as_declared_gets_no_name_and_a_soft_drive_its_size():
    machine = sm.load_machine("linear-delta")
    plan = random_plan(machine, poses=5, loads=4, repeats=1, seed=2)
    c, s = inferred(machine, simulate(machine, plan, seed=3))
    assert judged(c, s).word == "none" and s.best.chosen == ()
    soft = AppliedEffect("compliance", "carriage", ("b",), (("scale", 1.5),))
    c, s = inferred(machine, simulate(machine, plan, [soft], seed=3))
    v = judged(c, s)
    (one,) = v.named
    assert one.chosen.place.candidate.place == ("compliance", "carriage", ("b",))
    assert dict(one.chosen.term.parameters)["scale"] == pytest.approx(1.5, abs=0.05)


def test_readings_of_two_set_ups_whose_frames_are_unknown():
    """What frames could be is gone from every column."""
    machine = sm.load_machine("linear-delta")
    plan = replace(random_plan(machine, "position", poses=8, repeats=1, seed=4), frame="unknown")
    c, s = inferred(machine, simulate(machine, plan, seed=5))
    assert len(c) == READINGS - 16 - 6  # eight poses of three readings, a frame of six
    assert c.free.T @ c.free == pytest.approx(np.eye(len(c)), abs=1e-12)
    assert judged(c, s).word == "none"


@pytest.mark.parametrize(("strengths", "word"), [((8.0, -9.0, 7.0), "none"), ((0.0, 200.0, 0.0), "effects")])
def test_what_numbers_within_their_tolerance_show_has_no_name(strengths, word):
    """Each leg's column is ten times that of a number's uncertainty."""
    c = setting(2, strengths)
    d = 10.0 * np.stack([p.shapes[0].directions[:, 0] for p in c.places[:3]], axis=1)
    unknowns = tuple(Unknown(f"length of leg {k}", "link lengths", "m", 1e-4) for k in range(3))
    c = replace(c, numbers=d, unknowns=unknowns, experiment=one_place(len(c.rows)))
    v = judged(c, searched(c))
    assert v.word == word
    if word == "effects":
        assert [x.chosen.place.candidate.element for x in v.named] == ["leg 2"] or v.beyond


def test_a_number_out_of_tolerance_is_no_effect_that_has_gone() -> None:
    c = setting(2, (0.0, 200.0, 0.0))
    d = 10.0 * np.stack([p.shapes[0].directions[:, 0] for p in c.places[:3]], axis=1)
    unknowns = tuple(Unknown(f"length of leg {k}", "link lengths", "m", 1e-4) for k in range(3))
    c = replace(c, numbers=d, unknowns=unknowns, experiment=one_place(len(c.rows)))
    s = searched(c)
    s = replace(s, best=Model("together", (), s.calibrated, 0.0), gain=(), equivalents=(), instead=())
    (one,) = judged(c, s).named
    v = judged(c, s, ((one.chosen, "nothing"),))
    assert judged(c, s).as_effects and not v.named and not v.as_effects
    assert [b.unknown.name for b in v.beyond] == ["length of leg 1"]


def one_place(n: int) -> Any:
    """An experiment of poses of four readings each, with nothing to cut it into parts by."""
    return SimpleNamespace(
        channels=CHANNELS,
        position=np.zeros((n, 3)),
        wrench=np.zeros((n, 6)),
        command=None,
        order=None,
        hours=None,
        runs=np.zeros(n, int),
        groups=np.arange(n) // 4,
    )


def test_a_name_needs_odds_against_the_best_model_of_another_world_without_it():
    c = setting(1, (0.0, 30.0, 0.0))
    c = replace(c, experiment=one_place(len(c.rows)))
    s = searched(c)
    for odds, word in ((2.0 * ODDS, "effects"), (1.1, "effects"), (0.9, "none")):
        v = judged(c, replace(s, instead=((s.null, float(np.log(odds))),)))
        assert v.word == word and len(v.named) == (word != "none")
        assert [n.against_numbers for n in v.named] == [np.log(odds)] * len(v.named)
        assert [why for _, why in v.refused] == [TOLERABLE] * (word == "none")


def test_what_numbers_within_tolerances_show_is_not_unexplained_whatever_else_refuses_the_name(monkeypatch):
    c = setting(1, (0.0, 30.0, 0.0))
    c = replace(c, experiment=one_place(len(c.rows)))
    s = searched(c)
    monkeypatch.setattr(
        "stiffmap.identification.inference.verdict.refusal", lambda *_: (0.0, "another reason")
    )
    for odds, why, word in ((0.9, TOLERABLE, "none"), (1.1, "another reason", "unattributed")):
        v = judged(c, replace(s, instead=((s.null, float(np.log(odds))),)))
        assert [w for _, w in v.refused] == [why] and v.word == word


def test_an_effect_pays_for_the_places_that_it_may_be_at():
    """Numbers that are off show the same as an effect, with a little less evidence: they need no place, the effect may be at any."""
    c = setting(1, (0.0, 6.0, 0.0))
    rng = np.random.default_rng(9)
    others = [place(f"other {k}", rng.normal(size=len(c)), c.free) for k in range(20)]
    c = replace(c, places=(*c.places, *others))
    unknown = Unknown("zero of a drive", "zeros", "m", 1e-4)
    off = replace(c, numbers=0.3 * c.places[1].shapes[0].directions[:, :1], unknowns=(unknown,))
    exact, best = searched(c).best, searched(off).best
    assert exact.chosen and not best.chosen
    assert exact.score - np.log(len(c.places)) < best.score < exact.score


@pytest.mark.parametrize(("aside", "numbers"), [(0.3, ["zero of a drive"]), (0.0, [])])
def test_declared_numbers_out_of_tolerance_in_the_stead_of_a_name_do_not_take_it_away(aside, numbers):
    """A number that shows the same as the effect is the effect by another name, and makes nothing ambiguous."""
    c = setting(1, (0.0, 30.0, 0.0))
    along, other = (c.places[k].shapes[0].directions[:, :1] for k in (1, 2))
    unknown = Unknown("zero of a drive", "zeros", "m", 1e-4)
    s = searched(c)
    d = 6.0 * (along + aside * other)
    c = replace(c, experiment=one_place(len(c.rows)), numbers=d, unknowns=(unknown,))
    part = Parts(c).together
    none = fitted(c, part)
    for fit, named in ((none, 1), (none.without([part[0].name]), 0)):
        instead = Model("together", (), fit, s.best.score), 0.0
        v = judged(c, replace(s, instead=(instead,) * len(s.best.chosen)))
        assert len(v.named) == named
        assert [b.unknown.name for n in v.named for b in n.numbers] == numbers * named
        assert v.word == (("ambiguous" if numbers else "effects") if named else "none")


@pytest.mark.parametrize("name", ["exact", "groups"])
def test_pairs_far_below_the_best_are_fitted_in_the_exact_world_alone(
    name: str, monkeypatch: pytest.MonkeyPatch
):
    c = setting(3, (9.0, 8.0, 0.0))
    world = World(c, (), name, (), None, lambda: False, {})
    null = world.null
    fit = fitted(c, tuple(Chosen.at(p, 0).part for p in c.places[:2]))
    model = Model(name, tuple(Chosen.at(p, 0).by_posterior(fit) for p in c.places[:2]), fit, fit.score)
    tried: list[int] = []
    monkeypatch.setattr(World, "_with", lambda self, m, places, anchor: tried.append(len(places)) or null)
    for much, expected in ((0.0, True), (1000.0, name == "exact")):
        tried.clear()
        fast = replace(model, score=model.score + much, fit=replace(fit, score=fit.score + much))
        world._by_pairs(fast)
        assert bool(tried) is expected


def test_errors_along_the_travel_are_found_next_to_rows_that_slipped():
    rng = np.random.default_rng(2)
    bare = replace(columns(rng), rows=np.arange(READINGS) // 4)
    along = np.linalg.qr(rng.normal(size=(len(bare), 3)))[0] * np.sqrt(len(bare) / 3)
    slipped = np.where(bare.rows < 2, 25.0 * rng.normal(size=READINGS), 0.0)
    residual = along @ (6.0, -4.0, 5.0) + rng.normal(size=len(bare)) + bare.free.T @ slipped
    c = replace(bare, residual=residual, travel=(("a along its travel", along, 1.0),))
    plain = fitted(c, ())
    same, anew = (with_travel(plain, anew=a) for a in (False, True))
    assert not same.columns.tied and anew.columns.tied  # the lengths of a row share a weight
    assert anew.score > same.score > plain.score
    assert anew.amplitude("a along its travel") == pytest.approx(5.0, rel=0.5)
    assert np.all(anew.weights[:8] < 0.1) and np.all(anew.weights[8:] > 0.1)
    none = replace(plain, columns=bare)
    assert with_travel(none, anew=True) is none


def test_a_number_is_no_effect_that_contains_a_named_one():
    """A tilt about three axes is no second name beside the zero that is one of them: together neither has a size."""
    c = setting(1, (0.0, 30.0, 0.0))
    narrow, other = c.places[1], c.places[2]
    both = np.linalg.qr(np.hstack([p.shapes[0].directions for p in (narrow, other)]))[0]
    candidate = replace(
        narrow.candidate, element="both", parameters=tuple(
            replace(narrow.candidate.parameters[0], name=n) for n in ("first", "second")
        ),
    )  # fmt: skip
    lines = (c.free @ both).T
    wide = Place(
        candidate,
        (
            Shape(
                SimpleNamespace(
                    lines=lambda use: lines[:, use],
                    candidate=candidate,
                    shape=(),
                    sign=np.ones(1),
                    most=np.inf,
                ),
                both,
                0,
            ),
        ),
    )
    narrow = replace(narrow, wider=(candidate,))
    d = other.shapes[0].directions
    unknown = Unknown("turn of an axis", "joints", "rad", 1e-4)
    c = replace(c, places=(narrow, wide), numbers=8.0 * d, unknowns=(unknown,))
    b = Beyond(unknown, 5.0, 0.1, 1.0)
    assert effect_of(c, b, [Chosen.at(narrow, 0)]) is None
    assert effect_of(c, b, []).place is wide


def test_a_world_that_others_leave_far_behind_is_given_up_early(monkeypatch):
    """Numbers are off in fifteen ways, of which effects on a machine that is exact can explain three."""
    c = setting(1, (0.0, 0.0, 0.0))
    rng = np.random.default_rng(5)
    legs = [p.shapes[0].directions for p in c.places[:3]]
    d = np.linalg.qr(np.hstack([*legs, rng.normal(size=(len(c), 12))]))[0]
    unknowns = tuple(Unknown(f"number {k}", "link lengths", "m", 1e-4) for k in range(15))
    residual = c.residual + d @ np.append([600.0, -500.0, 400.0], 30.0 * rng.normal(size=12))
    whole = replace(
        c, numbers=10.0 * d, unknowns=unknowns, residual=residual, experiment=one_place(len(c.rows))
    )
    made: list[tuple[str, int]] = []
    inner = World._fit
    monkeypatch.setattr(
        World,
        "_fit",
        lambda w, chosen, *given: [made.append((w.name, len(chosen))), inner(w, chosen, *given)][1],
    )
    assert searched(whole).best.world != "exact"
    assert max(k for name, k in made if name == "exact") == 1
    made.clear()
    searched(replace(whole, numbers=d[:, :0], unknowns=()))
    assert max(k for _, k in made) > 1


def test_a_search_in_another_world_begins_with_what_was_found(monkeypatch):
    c = setting(1, (0.0, 40.0, 30.0))
    d = 10.0 * np.linalg.qr(np.random.default_rng(5).normal(size=(len(c), 3)))[0]
    unknowns = tuple(Unknown(f"number {k}", "link lengths", "m", 1e-4) for k in range(3))
    c = replace(c, numbers=d, unknowns=unknowns, experiment=one_place(len(c.rows)))
    begun: list[tuple[str, set[str]]] = []
    inner = World.search
    monkeypatch.setattr(
        World,
        "search",
        lambda w, m: [begun.append((w.name, {x.place.candidate.element for x in m.chosen})), inner(w, m)][1],
    )
    s = searched(c)
    assert {x.place.candidate.element for x in s.best.chosen} == {"leg 2", "leg 3"}
    assert [b for _, b in begun] == [set(), {"leg 2", "leg 3"}, {"leg 2", "leg 3"}]
