"""What is no argument at all is one clear error of every public function: None, text, a mapping, an array of another shape."""

from __future__ import annotations

import inspect
import pickle
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.experiment.virtual.plans import plan_of_poses, random_plan
from stiffmap.workspace.performance.motion.trajectory import Trajectory

P, W = [0.0, 0.416, 0.0], [10.0, 0, 0, 0, 0, 0]
FEW: dict[str, Any] = {"x": [0.0, 0.05], "y": [0.4, 0.42], "z": 0.0}
FIVE_BAR = sm.load_machine("five-bar")
A_SERVO = "examples/experiments/A-servo"
CIRCLE: dict[str, Any] = {"machine": "orthoglide-revised", "path": "circle", "process": "trimming"}
MODES = [[200.0, 0.02, 1.0, [1.0, 0, 0]]]
CALLS: dict[str, dict[str, Any]] = {
    "accuracy_transmission": {"position": P},
    "assembly_wrenches": {"position": P},
    "deflection_budget": {"position": P, "wrench": W},
    "design_sweep": {"numbers": {"arm/length": [0.3]}},
    "error_map": {"wrench": W, **FEW},
    "force_transmission": {"position": P},
    "inverse_kinematics": {"position": P},
    "map_estimate": {"wrench": W, **FEW},
    "natural_frequencies": {"position": P},
    "plan": {"identify": "zero_offset motor left error=0mrad", "rows": 3, "poses": 5},
    "sweep": {"position": P, "direction": [1, 0, 0], "forces": [10.0]},
    "velocity_section": {"position": P},
    "velocity_transmission": {"position": P},
    "why_unreachable": {"position": P},
    "worst_deflection": {"position": P, "force": 10.0},
    "compensate": {"position": P, "wrench": W},
    "map_statistics": {"wrench": W, **FEW},
    "measures": {"only": ["velocity"], "nodes": 3},
    "cutting_force": {"process": "slot"},
    "floquet_multiplier": {"modes": MODES, "process": "slot", "depth": 1e-4, "speed": 100.0},
    "forward_kinematics": {"actuators": sm.inverse_kinematics(FIVE_BAR, P).actuators},
    "frequency_response": {"position": P, "frequencies": [10.0, 20.0]},
    "identify_link": {
        "points": np.eye(4, 3), "displacements": np.ones((6, 4, 3)), "wrenches": np.eye(6), "reference": [0.0, 0, 0],
    },
    "limiting_depth": {"receptance": MODES, "process": "slot"},
    "load_experiment": {"path": A_SERVO},
    "load_machine": {"source": "five-bar"},
    "load_process": {"source": "slot"},
    "load_requirements": {"source": "trimming"},
    "polar": {"position": P},
    "uncertainty_ranking": {"ds": sm.error_map("five-bar", wrench=W, **FEW)},
    "vibration_map": {"position": P, "process": "slot", "frequencies": [50.0]},
}  # fmt: skip
"""Right arguments of calls that take a moment."""
METHODS: dict[str, tuple[Any, dict[str, Any]]] = {
    "save": (FIVE_BAR, {"path": ...}),
    "solve": (FIVE_BAR, {"position": P, "wrench": W}),
    "solve_joints": (FIVE_BAR, {"actuators": CALLS["forward_kinematics"]["actuators"]}),
    "with_effect": (FIVE_BAR, {"kind": "zero_offset", "element": "motor", "error": 1e-3}),
    "with_number": (FIVE_BAR, {"address": "arm/length", "value": 0.3}),
    "with_numbers": (FIVE_BAR, {"values": {"arm/length": 0.3}}),
    "wrench": (FIVE_BAR, {"position": P, "displacement": [1e-4, 0, 0, 0, 0, 0]}),
    "to_xarray": (FIVE_BAR.solve([P]), {}),
    "save ": (FIVE_BAR.solve(P), {"path": ...}),
    "save  ": (sm.inverse_kinematics(FIVE_BAR, P), {"path": ...}),
    "rms": (sm.compensate(FIVE_BAR, P), {"errors": ...}),
    "write": (sm.compensate(FIVE_BAR, P), {"path": ...}),
    "rows": (sm.load_experiment(A_SERVO), {"keep": ...}),
    "with_readings": (sm.load_experiment(A_SERVO), {"reading": ...}),
    "worst": (sm.residual("orthoglide-revised", A_SERVO), {}),
}
"""Methods, each of an object, with right arguments."""
OTHER = {"progress", "out", "resume", "scheduler", "chunk"}
"""Of long maps: they have tests of their own."""
BAD: dict[str, Any] = {
    "None": None, "1.5": 1.5, "-1": -1, "text": "zzz", "no text": "", "list": [1, 2], "nothing": {}, "mapping": {"zzz": 1},
    "nan": np.nan, "inf": np.inf, "True": True, "object": object(), "array": np.arange(6.0).reshape(2, 3), "function": lambda *_: 1,
}  # fmt: skip
KINDS: dict[str, set[str]] = {
    "None": {"None"},
    "bool": {"True"},
    "int": {"-1"},
    "float": {"1.5", "-1", "inf"},
    "str": {"text", "no text"},
    "PathLike[str]": set(),
    "Callable[[int], None]": {"function"},
    "Progress": {"function"},
    "Experiment": set(),
    "Machine": set(),
    "Process": set(),
    "Tolerances": set(),
    "Mapping[str, str]": {"nothing", "mapping"},
    "Mapping[str, float]": {"nothing", "mapping"},
    "Mapping[str, ArrayLike]": {"nothing", "mapping"},
}
"""Of BAD, what is no mistake of kind, by the words of an annotation."""
FUNCTIONS: dict[str, Callable[..., Any]] = {
    n: f for n in sm.__all__ if inspect.isfunction(f := getattr(sm, n))
}
OF_KIND = [
    (name, p.name, set().union(*(KINDS[w] for w in words)))
    for name, function in FUNCTIONS.items()
    for p in inspect.signature(function).parameters.values()
    if p.name != "machine" and (words := str(p.annotation).split(" | ")) and set(words) <= KINDS.keys()
]
"""Function, argument and what of BAD is of its kind: every argument of these kinds, of new functions too."""


@pytest.mark.parametrize(("call", "name", "sound"), OF_KIND, ids=[f"{c}-{n}" for c, n, _ in OF_KIND])
def test_an_argument_of_another_kind_is_refused_by_its_name(call: str, name: str, sound: set[str]) -> None:
    """Before anything else is looked at: nothing but the argument is given, as a keyword and in its place."""
    for label in BAD.keys() - sound:
        with pytest.raises(sm.StiffmapError, match=rf"^{name}: expected \w.*, got \S"):
            FUNCTIONS[call](**{name: BAD[label]})
    before = list(inspect.signature(FUNCTIONS[call]).parameters).index(name)
    if before == 0:
        with pytest.raises(sm.StiffmapError, match=f"^{name}: expected"):
            FUNCTIONS[call](BAD["object"])


OF_NO_KIND = {
    "cutting_force", "drive_efforts", "load_machine", "load_process", "machine_names", "uncertainty_ranking", "why_unreachable",
}  # fmt: skip
"""Functions without an argument of these kinds."""


def test_most_arguments_are_of_a_kind() -> None:
    assert len(OF_KIND) > 200
    assert FUNCTIONS.keys() - {c for c, _, _ in OF_KIND} <= OF_NO_KIND


@pytest.mark.parametrize("name", CALLS)
def test_every_argument_is_checked(name: str) -> None:
    call = FUNCTIONS[name]
    parameters = inspect.signature(call).parameters
    own = {"machine": FIVE_BAR} if "machine" in parameters else {}
    call(**own, **CALLS[name]) if name not in (
        "accuracy_transmission",
        "uncertainty_ranking",
        "identify_link",
    ) else None
    for p in parameters.values():
        for bad in BAD.values() if p.name not in OTHER else ():
            if bad is not None or p.default is not None:
                with suppress(sm.StiffmapError):  # and no other error
                    call(**{**own, **CALLS[name], p.name: bad})


@pytest.mark.parametrize("name", METHODS)
def test_every_argument_of_a_method_is_checked(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    of, given = METHODS[name]
    call = getattr(of, name.strip())
    for p in inspect.signature(call).parameters.values():
        for bad in BAD.values() if p.kind is not p.VAR_KEYWORD else ():
            if bad is not None or p.default is not None:
                with suppress(sm.StiffmapError):  # and no other error
                    call(**{**given, p.name: bad})


@pytest.mark.parametrize(
    "name", [n for n, f in FUNCTIONS.items() if "machine" in inspect.signature(f).parameters]
)
def test_machines_are_taken_by_name(name: str) -> None:
    """A shipped name that there is not is refused as such: the call has looked it up."""
    right = {
        "experiment": A_SERVO,
        "plan": A_SERVO,
        "before": A_SERVO,
        "after": A_SERVO,
        "effects": [],
        **CIRCLE,
    }
    needed = {n for n, p in inspect.signature(FUNCTIONS[name]).parameters.items() if p.default is p.empty}
    given = (
        {k: v for k, v in right.items() if k in needed} | CALLS.get(name, {}) | {"machine": "no-such-machine"}
    )
    given |= {"table": "t.csv", "folder": "f"} if name == "experiment_from_table" else {}
    if name == "drive_efforts":
        given["trajectory"] = Trajectory(np.arange(2.0), *np.zeros((4, 2, 3)))
    with pytest.raises(sm.StiffmapError, match="unknown machine 'no-such-machine'"):
        FUNCTIONS[name](**given)


def test_public_functions_are_pickled_by_their_names() -> None:
    assert all(pickle.loads(pickle.dumps(f)) is f for f in FUNCTIONS.values())


@pytest.mark.parametrize("bad", [None, "zzz", {}, -1.5])
def test_plans_check_every_argument(bad: Any) -> None:
    call = {"machine": sm.load_machine("five-bar"), "quantity": "deflection", "poses": [P], "loads": [[W]]}
    plan_of_poses(**call)
    for name in inspect.signature(plan_of_poses).parameters:
        if (name, bad) in (("noise", None), ("noise", -1.5), ("angle_noise", -1.5)):
            continue
        with pytest.raises(sm.StiffmapError, match=None if name == "machine" else name):
            plan_of_poses(**{**call, name: bad})


@pytest.mark.parametrize("bad", [{}, 5, "zzz", ["a"]])
@pytest.mark.parametrize(
    "call", [lambda s: sm.error_map("five-bar", wrench=W, **FEW, scheduler=s),
             lambda s: sm.vibration_map("five-bar", P, "slot", scheduler=s)],
)  # fmt: skip
def test_a_scheduler_is_an_address_or_a_client(call: Any, bad: Any) -> None:
    pytest.importorskip("distributed")
    with pytest.raises(sm.StiffmapError, match="scheduler: expected the address of a running dask scheduler"):
        call(bad)


@pytest.mark.parametrize("bad", [None, {}, 1, [1, 2]])
@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("drive_efforts", {"machine": "five-bar", "trajectory": ...}),
        ("drive_efforts", {"machine": ..., "trajectory": "trim"}),
        ("limiting_depth", {"receptance": ..., "process": "slot"}),
        ("floquet_multiplier", {"modes": ..., "process": "slot", "depth": 1e-3, "speed": 100.0}),
        ("load_requirements", {"source": ...}),
        ("import_urdf", {"urdf": ...}),
        ("import_urdf", {"urdf": "arm.urdf", "sidecar": ...}),
        ("identify_process", {"table": ...}),
        ("identify_process", {"table": {}, "process": ...}),
        ("worst_deflection", {"machine": "five-bar", "force": ...}),
        ("residual", {"machine": "five-bar", "experiment": ...}),
        ("simulate", {"machine": "five-bar", "plan": ...}),
        ("monitor", {"machine": "five-bar", "before": ..., "after": "a", "effects": []}),
        ("optimize", {"design": ...}),
        ("plan", {"machine": "five-bar", "identify": "zero_offset motor left error=0mrad", "rival": ...}),
        ("plan", {"machine": "five-bar", "identify": "zero_offset motor left error=0mrad", "axes": ...}),
        ("uncertainty_ranking", {"ds": ...}),
        ("measures", {"machine": "five-bar", "requirements": "none", "clearance": ...}),
        ("workspace_volume", {"machine": "five-bar", "cells": ...}),
        ("largest_box", {"machine": "five-bar", "tolerance": ...}),
        ("largest_box", {"machine": "five-bar", "clearance": ...}),
        ("largest_box", {"machine": "five-bar", "transmission": ...}),
        ("largest_box", {"machine": "five-bar", "max_evaluations": ...}),
    ],
)
def test_what_is_no_argument_is_one_error(name: str, arguments: dict[str, Any], bad: Any) -> None:
    given = {k: bad if v is ... else v for k, v in arguments.items()}
    optional = {"sidecar", "clearance", "transmission", "process", "cells"} & {
        k for k, v in arguments.items() if v is ...
    }
    sound = (bad is None and optional) or (
        bad == 1 and not isinstance(bad, list | dict) and name in ("worst_deflection", "largest_box")
    )
    if sound or (bad == [1, 2] and "transmission" in arguments):
        return
    with pytest.raises(sm.StiffmapError):
        getattr(sm, name)(**given)


@pytest.mark.parametrize("force", ["300", [1.0, 2.0], np.nan, -1.0, None])
def test_a_force_is_one_positive_number(force: Any) -> None:
    with pytest.raises(sm.StiffmapError, match=r"force: expected a (positive )?number"):
        sm.worst_deflection("five-bar", P, force=force)


MANY = [[0.0, 0.416, 0.0], [0.05, 0.416, 0.0]]


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: sm.stability_lobes("five-bar", "slot", MANY), "position: expected one pose for a diagram, got 2"),
        (lambda: sm.worst_deflection("five-bar", np.zeros((3, 5)), force=1.0), r"position: expected .* \(3, 5\)"),
        (lambda: sm.worst_deflection("five-bar", P, box=[P, P], force=1.0), "expected position or box, got both"),
        (lambda: sm.worst_deflection("five-bar", P, force=1.0, direction=[0, 0, 0]), "direction: expected one or 1"),
        (lambda: sm.worst_deflection("five-bar", MANY, force=1.0, direction=np.ones((3, 3))), "one or 2 vectors"),
        (lambda: sm.workspace_volume("five-bar", cells=4).at(np.zeros((3, 2))), r"position: expected .* \(3, 2\)"),
    ],
)  # fmt: skip
def test_poses_are_neither_left_out_nor_reshaped(call: Any, words: str) -> None:
    with pytest.raises(sm.StiffmapError, match=words):
        call()


@pytest.mark.parametrize(
    ("given", "words"),
    [({"force": -3.0}, "force"), ({"force": 0.0}, "force"), ({"force": np.nan}, "force"), ({"plane": "XY"}, "plane"),
     ({"plane": ""}, "plane"), ({"nodes": 1}, "nodes"), ({"nodes": 2.5}, "nodes"), ({"coarse": 0}, "coarse")],
)  # fmt: skip
def test_measures_refuse_what_would_leave_rows_without_a_number(given: dict[str, Any], words: str) -> None:
    with pytest.raises(sm.StiffmapError, match=f"{words}: expected"):
        sm.measures("five-bar", **{"only": ["velocity"], "nodes": 3, **given})


@pytest.mark.parametrize("bad", [{}, [1, 2], "zzz"])
@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        *(("mill", {**CIRCLE, n: ...}) for n in
          ("path", "at", "turn", "size", "step", "within", "passes", "place", "tolerance", "thickness", "stock")),
        *((call, {"machine": "orthoglide-revised", "experiment": A_SERVO, n: ...})
          for call in ("diagnose", "calibrate") for n in ("exclude", "time_limit", "tolerances")),
        ("simulate", {"machine": "orthoglide-revised", "plan": A_SERVO, "outlier_share": ...}),
        ("load_experiment", {"path": ...}),
        ("compensate", {"machine": "five-bar", "position": P, "gravity": ...}),
    ],
)  # fmt: skip
def test_what_is_no_argument_of_long_calls_is_one_error(
    name: str, arguments: dict[str, Any], bad: Any
) -> None:
    if bad == {} and {"exclude", "tolerances"} & {k for k, v in arguments.items() if v is ...}:
        return  # none
    with pytest.raises(sm.StiffmapError):
        getattr(sm, name)(**{k: bad if v is ... else v for k, v in arguments.items()})


def test_more_is_refused_by_name() -> None:
    machine = sm.load_machine("five-bar")
    for call in (sm.diagnose, sm.calibrate):
        for less in (-1, float("nan")):
            with pytest.raises(sm.StiffmapError, match=r"time_limit: expected .*got (-1|nan)"):
                call("orthoglide-revised", A_SERVO, time_limit=less)
    with pytest.raises(sm.StiffmapError, match="wrench: expected one row or 2"):
        sm.compensate(machine, MANY, wrench=[W, W, W])
    with pytest.raises(sm.StiffmapError, match="outlier_share: expected a share from 0 to 1, got 5"):
        sm.simulate("orthoglide-revised", A_SERVO, outlier_share=5)
    with pytest.raises(sm.StiffmapError, match="points: expected a whole number"):
        sm.error_map(machine, points=3.5)
    for bad in ("no", None):
        with pytest.raises(sm.StiffmapError, match="stiffness: expected True or False"):
            machine.solve(P, W, stiffness=bad)  # type: ignore[arg-type]
    with pytest.raises(sm.StiffmapError, match="wrenches: expected a mapping point -> wrench, got list"):
        machine.solve(P, wrenches=W)  # type: ignore[arg-type]


def test_one_name_may_stand_by_itself() -> None:
    machine = sm.load_machine("five-bar")
    assert machine.solve(P, W, read_points="tcp").status == sm.Status.CONVERGED
    assert [r.measure.name for r in sm.measures(machine, only="condition", nodes=3).rows] == ["condition"]
    assert (
        sm.error_map(machine, wrench=W, cases="cut", **FEW).sizes
        == sm.error_map(machine, wrench=W, cases=["cut"], **FEW).sizes
    )
    with pytest.raises(sm.StiffmapError, match="unknown group 'stifness'"):
        sm.calibrate("orthoglide-revised", A_SERVO, exclude="stifness")
    assert sm.map_statistics(machine, wrench=W, percentiles=95, **FEW).percentile.size == 1
    circle = [sm.mill(**CIRCLE, at=(0.05, 0.05, 0), step=0.02, size=size) for size in (0.06, [0.06])]
    assert np.array_equal(circle[0].error, circle[1].error)


def test_arguments_that_contradict_each_other_are_refused() -> None:
    machine = sm.load_machine("orthoglide-revised")
    few: dict[str, Any] = {"x": 0.0, "y": 0.0, "z": 0.0}
    for words, call in (
        ("no cases= with a mapping", lambda: sm.error_map(machine, **few, wrench={"a": W}, cases=["b"])),
        ("resume: nothing is kept without out=", lambda: sm.error_map(machine, **few, wrench=W, resume=True)),
        (
            "place: not together with at",
            lambda: sm.mill(machine, "circle", "trimming", place=2, at=(0, 0, 0)),
        ),
        ("place: not together with at", lambda: sm.mill(machine, "circle", "trimming", place=2, turn=0.1)),
    ):
        with pytest.raises(sm.StiffmapError, match=words):
            call()


def test_plans_take_no_argument_that_means_nothing() -> None:
    """A pose of the workpiece without its map, readings without an axis or with an impossible spread."""
    machine, found = sm.load_machine("orthoglide-revised"), "dead_zone actuator y half_width=10um"
    given: dict[str, Any]
    for words, given in (
        ("only with aim 'map'", {"position": [[0, 0, 0]]}),
        ("only with aim 'map'", {"wrench": W}),
        ("axes: expected one of dx", {"axes": ()}),
        ("noise: expected a positive number", {"noise": 0.0}),
        ("noise: expected a positive number", {"noise": -1e-6}),
    ):
        with pytest.raises(sm.StiffmapError, match=words):
            sm.plan(machine, found, rows=2, poses=4, **given)


def test_an_experiment_without_rows_is_refused() -> None:
    machine = sm.load_machine("orthoglide-revised")
    none = random_plan(machine, poses=2).rows([])
    calls: tuple[Callable[..., Any], ...] = (sm.residual, sm.simulate, sm.calibrate, sm.diagnose)
    for call in calls:
        with pytest.raises(sm.StiffmapError, match="at least one row"):
            call(machine, none)
