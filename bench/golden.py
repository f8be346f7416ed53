"""The exact bits that a change of structure must leave as they are.

    python bench/golden.py store before.json --experiments ../shared/experiments
    python bench/golden.py compare before.json --experiments ../shared/experiments
    python bench/golden.py diff before.json after.json

Stored is one hash for each array, with a few of its numbers to read. Parts (`--only`): solve, held, paths, maps,
diagnosis (the sets of `--experiments`), sweep (ten virtual sets), link. Bits hold for one compiler, one CPU level
and one version of NumPy and SciPy. Diagnoses take some minutes, the rest seconds.
"""

from __future__ import annotations

import argparse
import hashlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import stiffmap as sm
from stiffmap.experiment import random_plan, simulate
from stiffmap.model.files import shipped_machines

Item = tuple[str, Any]
FIELDS = ("displacement", "stiffness", "compliance", "status", "flags", "iterations", "actuator_effort",
          "leg_wrench", "coordinates", "free_twists", "indeterminate_mask")  # fmt: skip
KINEMATIC = ("actuators", "position", "rotation", "status", "flags", "coordinates")
HELD = ("wrench", "leg_wrench", "stiffness", "leg_stiffness", "actuator_effort", "coordinates", "status",
        "force_status", "flags")  # fmt: skip
DERIVED = (("length", {"element": "bar", "legs": ["x"], "error": 0.0}), "position", "wrench")
SWEEP = (  # plan, kind, arguments, numbers in SI, seed
    ("deflection", None, {}, {}, 1),
    ("position", None, {}, {}, 2),
    ("deflection", "compliance", {"element": "actuator", "legs": ["x"]}, {"scale": 1.5}, 3),
    ("deflection", "compliance", {"element": "foot", "legs": ["y"]}, {"scale": 1.15}, 4),
    ("deflection", "dead_zone", {"element": "actuator", "legs": ["z"]}, {"half_width": 8e-6}, 5),
    ("deflection", "hardening", {"element": "actuator", "legs": ["x"]}, {"cubic": 3e14}, 6),
    ("position", "length", {"element": "bar", "legs": ["y"]}, {"error": 5e-5}, 7),
    ("position", "zero_offset", {"element": "actuator", "legs": ["z"]}, {"error": 4e-5}, 8),
    ("position", "lead_error", {"element": "actuator", "legs": ["x"]}, {"slope": 3e-4}, 9),
    ("position", "gravity", {}, {"scale": 1.0}, 10),
)


def names() -> list[str]:
    """Every shipped machine."""
    return [m.name for m in shipped_machines()]


def poses(machine: sm.Machine, count: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """Positions in the workspace and a little outside, wrenches with moments; the same ones always."""
    rng = np.random.default_rng(20261122)
    try:
        low, high = machine.workspace
    except sm.StiffmapError:
        low, high = machine.description.home.p - 0.05, machine.description.home.p + 0.05
    margin = 0.05 * (high - low)
    position = rng.uniform(low - margin, high + margin, (count, 3))
    return position, rng.uniform(-1, 1, (count, 6)) * [300, 300, 300, 5, 5, 5]


def solve() -> Iterator[Item]:
    """Every shipped machine, both methods, with and without gravity; one pose alone; derivatives; kinematics."""
    for name in names():
        machine = sm.load_machine(name)
        p, w = poses(machine)
        for method in ("fast", "reference"):
            for gravity in (None, (0.0, 0.0, -9.81)):
                s = machine.solve(p, w, method=method, gravity=gravity, threads=2)
                yield from fields(f"{name} {method} gravity {gravity is not None}", s, FIELDS)
        yield from fields(f"{name} one pose", machine.solve(tuple(p[0]), tuple(w[0])), FIELDS)
        follower = machine.solve(p, w, load_type="follower")
        yield from fields(f"{name} follower", follower, ("displacement", "status"))
        k = sm.inverse_kinematics(machine, p)
        yield from fields(f"{name} inverse", k, KINEMATIC)
        yield from fields(f"{name} forward", sm.forward_kinematics(machine, k.actuators), KINEMATIC)
    machine = sm.load_machine("orthoglide-revised")
    p, w = poses(machine)
    s = machine.solve(p, w, derivatives=DERIVED, derivatives_of=("displacement", "compliance"))
    yield from ((f"derivative {n}", v) for n, v in s.derivatives.items())
    yield from ((f"derivative of compliance {n}", v) for n, v in s.compliance_derivatives.items())


def held() -> Iterator[Item]:
    """Imposed displacements and internal wrenches of every shipped machine."""
    for name in names():
        machine = sm.load_machine(name)
        p, w = poses(machine, 8)
        d = 0.5 * machine.solve(p, w).displacement
        yield from fields(f"{name} held", machine.wrench(p, np.nan_to_num(d)), HELD)
        inside = sm.assembly_wrenches(machine, p, wrench=w, gravity=(0.0, 0.0, 0.0))
        for group in ("springs", "joints", "legs"):
            yield from ((f"{name} {group} {n}", v) for n, v in getattr(inside, group).items())


def paths() -> Iterator[Item]:
    """Load sweeps by force and along the path."""
    machine = sm.load_machine("orthoglide-revised")
    p = np.array([0.1, -0.05, 0.2])
    direction = np.array([1.0, 0.5, 0.0])
    yield from dataset("sweep", sm.sweep(machine, p, direction, np.linspace(0, 2000, 9)))
    for control, limit in (("force", 5000.0), ("displacement", 2e-3)):
        yield from dataset(f"path {control}", sm.sweep(machine, p, direction, control=control, limit=limit))
    yield from dataset("polar", sm.polar(machine, p, force=300.0, plane="xy"))


def maps() -> Iterator[Item]:
    """A small error map of every shipped machine that declares a box."""
    for name in names():
        machine = sm.load_machine(name)
        if machine.description.workspace is None:
            continue
        low, high = machine.workspace
        x, y, z = (np.linspace(a, b, 4) for a, b in zip(low, high, strict=True))
        force = [100.0, 50, 0, 0, 0, 0]
        yield from dataset(f"map {name}", sm.error_map(machine, x=x, y=y, z=z, wrench=force, compliance=True))


def diagnosis(folder: Path) -> Iterator[Item]:
    """Every experiment of a folder, judged with seed 0."""
    machine = sm.load_machine("orthoglide-revised")
    for path in sorted(p for p in folder.iterdir() if p.is_dir()):
        yield from diagnosed(path.name, sm.diagnose(machine, path, seed=0))


def sweep() -> Iterator[Item]:
    """Ten virtual sets: nothing, and nine effects."""
    machine = sm.load_machine("orthoglide-revised")
    for quantity, kind, place, numbers, seed in SWEEP:
        plan = random_plan(machine, quantity, poses=60 if quantity == "position" else 15, loads=6, seed=1)
        effects = machine.with_effect(kind, **place, **numbers).description.effects if kind else ()
        twin = simulate(machine, plan, effects, seed=seed)
        name = f"{quantity} {kind} {' '.join(place.get('legs', []))}"
        yield f"{name}: readings", twin.reading
        yield from diagnosed(name, sm.diagnose(machine, twin, seed=0))


def link() -> Iterator[Item]:
    """Link identification: small and finite rotations, with noise and exact."""
    rng = np.random.default_rng(1)
    p = rng.uniform(-0.03, 0.03, (60, 3))
    c = np.diag([1e-8, 3e-6, 2e-6, 1e-4, 2e-4, 3e-4])
    w = np.diag([100.0, 10, 10, 1, 1, 1])
    u = np.array([(c @ f)[:3] + np.cross((c @ f)[3:], p) for f in w])
    noisy = u + 1e-9 * rng.standard_normal(u.shape)
    for name, field, options in (
        ("exact", u, {}),
        ("noisy", noisy, {}),
        ("noise given", noisy, {"noise": 1e-9}),
    ):
        found = sm.identify_link(p, field, w, reference=np.zeros(3), **options)
        for quantity in ("compliance", "stiffness", "covariance", "insignificant", "outliers"):
            yield f"link {name}: {quantity}", np.asarray(getattr(found, quantity))


def fields(name: str, holder: Any, wanted: tuple[str, ...]) -> Iterator[Item]:
    """Some arrays of an answer."""
    yield from ((f"{name}: {f}", np.asarray(getattr(holder, f))) for f in wanted)


def dataset(name: str, ds: Any) -> Iterator[Item]:
    """All variables of a dataset."""
    yield from ((f"{name}: {v}", ds[v].values) for v in sorted(map(str, ds.variables)))


def diagnosed(name: str, found: sm.Diagnosis) -> Iterator[Item]:
    """A diagnosis without its clock, part by part."""
    plain = json.loads(found.to_json())
    plain.pop("seconds", None)
    yield from ((f"{name}: {k}", v) for k, v in plain.items())


def stored(value: Any) -> dict[str, Any]:
    """Hash of the bits, and something to read."""
    if isinstance(value, np.ndarray):
        if value.dtype.kind in "fiub":
            bits = (
                value.dtype.str.encode() + str(value.shape).encode() + np.ascontiguousarray(value).tobytes()
            )
            flat = value.ravel()
            some = [float(v) for v in flat[:: max(1, flat.size // 3)][:3]]
            return {"hash": hashlib.sha256(bits).hexdigest()[:16], "shape": list(value.shape), "some": some}
        value = value.astype(str).tolist()
    text = json.dumps(value, sort_keys=True, ensure_ascii=False)
    return {"hash": hashlib.sha256(text.encode()).hexdigest()[:16], "some": text[:300]}


def collect(parts: dict[str, Callable[[], Iterator[Item]]], only: list[str]) -> dict[str, dict[str, Any]]:
    """All items of the parts asked for, as they are stored; a part that fails is stored as its error."""
    out: dict[str, dict[str, Any]] = {}
    for part, items in parts.items():
        if not only or part in only:
            try:
                out |= {f"{part} | {name}": stored(value) for name, value in items()}
            except Exception as problem:
                out[f"{part} | error"] = stored(f"{type(problem).__name__}: {problem}")
            print(f"{part}: {len(out)} items so far", flush=True)
    return out


def differences(a: dict[str, Any], b: dict[str, Any]) -> int:
    """Prints what differs between two stores and counts it."""
    names = sorted(set(a) | set(b))
    wrong = [n for n in names if a.get(n, {}).get("hash") != b.get(n, {}).get("hash")]
    for n in wrong:
        print(f"{n}\n   {a.get(n, {}).get('some', 'absent')}\n   {b.get(n, {}).get('some', 'absent')}")
    print(f"{len(names)} items, {len(wrong)} differ")
    return len(wrong)


def main() -> int:
    """Store, or compare with what was stored."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("action", choices=("store", "compare", "diff"))
    parser.add_argument("file", type=Path, nargs="+")
    parser.add_argument("--experiments", type=Path, default=Path("tests/data/experiments"))
    parser.add_argument("--only", action="append", default=[], help="a part; may be given several times")
    o = parser.parse_args()
    if o.action == "diff":
        return bool(differences(*(json.loads(f.read_text()) for f in o.file)))
    parts = {"solve": solve, "held": held, "paths": paths, "maps": maps, "link": link}
    parts |= {"diagnosis": lambda: diagnosis(o.experiments), "sweep": sweep}
    found = collect(parts, o.only)
    if o.action == "store":
        old = json.loads(o.file[0].read_text()) if o.only and o.file[0].exists() else {}
        o.file[0].write_text(json.dumps(old | found, indent=1, ensure_ascii=False))
        return 0
    before = json.loads(o.file[0].read_text())
    return bool(
        differences({k: v for k, v in before.items() if not o.only or k.split(" | ")[0] in o.only}, found)
    )


if __name__ == "__main__":
    raise SystemExit(main())
