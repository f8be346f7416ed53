"""All that a machine can be asked, for machines that hold next to nothing. Run as a program it is a worker: a line of
JSON in (a machine in the small code of `made`), a line out: what went wrong, empty for nothing. A crash ends it."""

from __future__ import annotations

import json
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import stiffmap as sm
from stiffmap.experiment import random_plan
from stiffmap.identification.calibration import calibrate
from stiffmap.model.description import (
    Block,
    Body,
    Branch,
    Element,
    ExternalSpring,
    Joint,
    Law,
    Leg,
    MachineDescription,
    Offset,
    Point,
    Pose,
    Spring,
)
from stiffmap.solve.advice import advice, check_file
from stiffmap.workspace.performance.motion.trajectory import line, timed

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
SOFT, HARD = Law(1e5), Law(1e5, cubic=1e10)
MEASURES = (
    "transmission_min", "transmission_max", "cube_min", "condition", "velocity", "force", "accuracy", "deflection",
    "frequency", "mass", "singularity",
)  # fmt: skip
OFF = np.array([1e-3, -2e-3, 5e-4])


def element(code: str, name: str) -> Element:
    """``o`` offset; ``s`` spring, ``r`` rigid spring, ``f`` spring with free directions; ``b`` body; ``p`` point; joints
    of two letters: kind (t turns, d slides; T, D driven and elastic, R, S driven and rigid, e elastic, u universal,
    k ball) and axis; ``B`` a block of two springs."""
    axis = (AXES.get(code[-1], AXES["z"]),)
    compliance = tuple(tuple(1e-6 * (i == j) for j in range(6)) for i in range(6))
    match code[0]:
        case "o":
            return Offset(name, Pose.of((0.2, 0.05, -0.1)))
        case "s":
            return Spring(name, compliance=compliance)
        case "r":
            return Spring(name, compliance=((0.0,) * 6,) * 6)
        case "f":
            rows = [[1e5 * (i == j and i < 4) for j in range(6)] for i in range(6)]
            return Spring(name, stiffness=tuple(map(tuple, rows)))
        case "b":
            return Body(name, 2.0, com=(0.01, 0.0, 0.02), inertia=((1e-3, 0, 0), (0, 1e-3, 0), (0, 0, 1e-3)))
        case "p":
            return Point(name, (0.0, 0.1, 0.0))
        case "B":
            return Block(
                name, (Branch("one", (element("s", "left"),)), Branch("two", (element("s", "right"),)))
            )
        case "u":
            return Joint(name, "universal", (AXES["x"], AXES["y"]), home=(0.0, 0.0))
        case "k":
            return Joint(name, "spherical", tuple(AXES.values()), home=(0.0,) * 3)
        case "t" | "e" | "T" | "R":
            law = {"e": SOFT, "T": HARD}.get(code[0])
            return Joint(name, "revolute", axis, actuated=code[0] in "TR", law=law)
        case _:
            return Joint(
                name, "prismatic", axis, actuated=code[0] in "DS", law=SOFT if code[0] == "D" else None
            )


def chain(codes: list[str]) -> tuple[Element, ...]:
    return tuple(element(c, f"e{i}") for i, c in enumerate(codes))


def made(spec: dict[str, Any]) -> sm.Machine:
    legs = tuple(Leg(f"leg{i}", chain(codes)) for i, codes in enumerate(spec["legs"]))
    at = 0.2 * np.array([1.0, 0.25, -0.5]) * sum(c == "o" for c in (spec["legs"] or [[]])[0])
    at = at + 0.2 * np.array([1.0, 0.25, -0.5]) * sum(c == "o" for c in spec["base"] + spec["platform"])
    box = (tuple(at - 0.05), tuple(at + 0.05)) if spec["box"] else None
    outside = [ExternalSpring("cord", "tcp", (0.0, 0.0, 1.0), 1e4, 0.5)] if spec["cord"] else []
    return sm.Machine(
        MachineDescription(
            "tiny",
            legs,
            base=chain(spec["base"]),
            platform=chain(spec["platform"]),
            home=Pose.of(at),
            workspace=box,  # type: ignore[arg-type]
            external_springs=tuple(outside),
            task=tuple(spec["task"]),
            gravity=(0.0, 0.0, -9.81) if spec["gravity"] else None,
        )
    )


def calls(m: sm.Machine, folder: Path) -> Iterator[tuple[str, Callable[[], Any]]]:
    """Everything, by name."""
    home = np.array(m.description.home.p)
    poses = np.array([home, home + OFF, home + 0.3, [np.nan, 0.0, 0.0]])
    load = np.array([10.0, -20.0, 30.0, 0.5, 1.0, -2.0])
    wrench = np.array([load, 0 * load])[:, None, :]
    for how in ("fast", "reference"):
        yield f"solve {how}", lambda how=how: honest(m.solve(poses, wrench, method=how))
        yield (
            f"follower {how}",
            lambda how=how: honest(m.solve(poses, load, method=how, load_type="follower")),
        )
        yield f"one {how}", lambda how=how: honest(m.solve(poses[1], load, method=how))
    yield "derivatives", lambda: m.solve(poses, load, derivatives=["position", "rotation", "wrench"])
    yield "joints", lambda: honest(m.solve_joints(np.zeros((2, len(m.actuators))) + [[0.0], [0.01]], load))
    yield "holding", lambda: m.wrench(poses, np.full(6, 1e-5))
    yield "inverse", lambda: sm.inverse_kinematics(m, poses)
    yield "forward", lambda: sm.forward_kinematics(m, np.zeros((2, len(m.actuators))))
    at = {"x": [home[0]], "y": [home[1], home[1] + 0.01], "z": [home[2]]}
    yield "map", lambda: sm.error_map(m, **at, wrench=load)
    yield "polar", lambda: sm.polar(m, poses[1], directions=4)
    yield "sweep", lambda: sm.sweep(m, poses[1], [1.0, 0, 0], [10.0, 20.0])
    yield "budget", lambda: sm.deflection_budget(m, None, load)
    yield "stress", lambda: sm.assembly_wrenches(m, poses[1])
    yield "velocity", lambda: sm.velocity_transmission(m, poses)
    yield "section", lambda: sm.velocity_section(m, poses)
    yield "force", lambda: sm.force_transmission(m, poses, limits=100.0)
    yield "accuracy", lambda: sm.accuracy_transmission(m, poses, errors=1e-5)
    yield "frequencies", lambda: sm.natural_frequencies(m, poses)
    yield "worst", lambda: sm.worst_deflection(m, home, force=10.0)
    yield "volume", lambda: sm.workspace_volume(m, cells=5)
    yield "box", lambda: sm.largest_box(m, tolerance=0.02)
    yield "measures", lambda: sm.measures(m, nodes=3, coarse=2, box_tolerance=0.02, only=MEASURES)
    yield "efforts", lambda: sm.drive_efforts(m, timed(line(home, home + OFF, 5), 1.0))
    yield "compensate", lambda: sm.compensate(m, poses[:2], load)

    def of_readings(what: Callable[[sm.Machine, Any], Any]) -> None:
        plan = random_plan(m, "deflection", poses=2, loads=3, repeats=1)
        what(m, sm.simulate(m, plan))

    yield "residual", lambda: of_readings(sm.residual)
    yield "diagnose", lambda: of_readings(sm.diagnose)
    yield "calibrate", lambda: of_readings(calibrate)
    file = folder / "tiny.yaml"

    def looked_over() -> None:
        m.save(file)
        advice(sm.Machine(check_file(str(file)).description), str(file))

    yield "check", looked_over


def honest(s: sm.Solution) -> None:
    """A number has its status: what is CONVERGED is finite, what failed is not a number."""
    ok = s.status == sm.Status.CONVERGED
    lost = (s.status == sm.Status.UNREACHABLE) | (s.status == sm.Status.NOT_CONVERGED)
    assert np.isfinite(s.displacement[ok]).all(), "CONVERGED without a displacement"
    assert np.isnan(s.displacement[lost]).all(), "a failed pose with a displacement"


def trouble(spec: dict[str, Any]) -> str:
    """What went wrong; empty: every call answered, or refused in words of ours."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            machine = made(spec)
        except sm.StiffmapError:
            return ""
        for name, call in calls(machine, Path(folder)):
            try:
                call()
            except sm.StiffmapError as error:
                if "defect" in str(error) or not str(error).strip():
                    return f"{name}: {error}"
            except Exception:
                return f"{name}: {traceback.format_exc()}"
    return ""


if __name__ == "__main__":
    print("ready", flush=True)
    for given in sys.stdin:
        print(json.dumps(trouble(json.loads(given))), flush=True)
