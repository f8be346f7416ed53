"""Every number of the schema in every system of units: what is read is what the same file in SI says.

The numbers of the machine below carry their units as exponents of length (L), force (F), angle (A) and mass (M), by
the tables of docs/machine_files.md; an angle next to a force is in radians in every file and has no A.
"""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import fields, is_dataclass
from fractions import Fraction
from typing import Any, get_args

import pytest

from stiffmap.common.yaml_text import parse, text_of
from stiffmap.model.description import MachineDescription
from stiffmap.model.files import description_from_text
from stiffmap.model.files.schema import MachineFile
from stiffmap.model.files.schema.base import FileModel, Number
from stiffmap.model.files.templates import expanded

PI = Fraction("3.14159265358979323846264338327950288419716939937510582")
SIZES: dict[str, dict[str, Fraction]] = {
    "length": {"m": Fraction(1), "cm": Fraction(1, 100), "mm": Fraction(1, 1000), "um": Fraction(1, 10**6),
               "in": Fraction(254, 10000)},
    "force": {"N": Fraction(1), "kN": Fraction(1000), "MN": Fraction(10**6)},
    "angle": {"rad": Fraction(1), "deg": PI / 180},
    "mass": {"kg": Fraction(1), "g": Fraction(1, 1000), "t": Fraction(1000)},
}  # fmt: skip
STANDS_FOR_OTHERS = {"LegModel.parameters", "TemplateModel.parameters"}
"""Parameters of templates: written into the elements before they are read."""


def numbers(angular: bool) -> dict[str, Any]:
    """What every joint and drive may have, of one that turns or slides."""
    c, e = ("A", "F L") if angular else ("L", "F")
    per = "F L" if angular else "F L-1"  # effort per coordinate
    return {
        "limits": [f"-0.61 {c}", f"0.97 {c}"], "damping": f"41.3 {per}", "loss_factor": 0.031,
        "range": [f"-0.51 {c}", f"0.83 {c}"], "speed": f"1.7 {c}", "force": f"333 {e}",
        "encoder_error": f"1.1e-5 {c}", "compliance_slope": f"0.37 {c}-1", "sag": f"1.3e-3 {c} L-1",
        "friction": {"coulomb": f"7.1 {e}", "viscous": {"value": f"0.83 {per}", "u": f"0.013 {per}"}},
        "command_errors": [{
            "offset": f"1.3e-4 {c}", "slope": 1.1e-4, "amplitude": f"2.3e-5 {c}", "period": f"0.017 {c}",
            "phase": "0.71 A", "reference": f"0.13 {c}", "knots": [[f"-0.3 {c}", f"1e-4 {c}"], [f"0.4 {c}", f"3e-4 {c}"]],
        }],
    }  # fmt: skip


def laws(angular: bool) -> list[dict[str, Any]]:
    """A law of each form."""
    c, e = ("A", "F L") if angular else ("L", "F")
    per, cube = ("F L", "F L") if angular else ("F L-1", "F L-3")
    return [
        {"stiffness": {"value": f"3.7e5 {per}", "u": f"1.1e3 {per}"}, "cubic": f"7.3e8 {cube}"},
        {"stiffness": f"3.7e5 {per}", "knots": [[f"-2e-3 {c}", f"-31 {e}"], [f"3e-3 {c}", f"47 {e}"]]},
    ]


def joints(kind: str) -> list[dict[str, Any]]:
    """Joints and drives of one kind."""
    angular = kind == "revolute"
    c, per, yields = ("A", "F L", "F-1 L-1") if angular else ("L", "F L-1", "L F-1")
    cubic, knots = laws(angular)
    all_numbers = numbers(angular)
    passive = {k: all_numbers[k] for k in ("limits", "damping", "loss_factor")}
    drive = {"kind": kind, "axis": "z"}
    return [
        {"actuator": "full", **drive, "home": f"0.21 {c}", "stiffness": f"2.9e6 {per}", **all_numbers},
        {"actuator": "yielding", **drive, "compliance": {"value": f"3.1e-7 {yields}", "u": f"1e-8 {yields}"}},
        {"actuator": "cubic", **drive, "law": cubic},
        {"actuator": "knots", **drive, "law": knots},
        {"joint": "pin", **drive, "home": f"0.11 {c}", "stiffness": f"77 {per}", "rest": f"0.17 {c}", **passive},
        {"joint": "soft", **drive, "home": [f"0.12 {c}"], "compliance": [f"0.013 {yields}"], "rest": [f"0.1 {c}"]},
        {"joint": "curved", **drive, "law": cubic},
        {"spring": "grows", "compliance": MATRIX,
         "stroke": {"joint": "full", "at": f"0.1 {c}", "length": "0.9 L", "along": "x",
                    "rate": "0.23 L A-1" if angular else 0.23}},
        {"spring": "table", "stroke": {"joint": "full", "table": [
            {"at": f"-0.55 {c}", "compliance": MATRIX}, {"at": f"0.99 {c}", "compliance": MATRIX}]}},
    ]  # fmt: skip


MATRIX = [
    "1.1e-7 L F-1",
    "1.3e-7 L F-1",
    "1.7e-7 L F-1",
    "1.9e-6 F-1 L-1",
    "2.3e-6 F-1 L-1",
    "2.9e-6 F-1 L-1",
]
TURNED = [
    ["0.11 L", "0.12 L", "0.13 L"], ["-0.21 L", "0.22 L", "0.23 L"], ["0.31 L", "-0.32 L", "0.33 L"],
]  # fmt: skip
FRAMES = [{"translation": t, "turns": [{"about": [1, 2, 3], "by": {"value": "0.73 A"}}]} for t in TURNED]
STEEL = {"E": "2.1e11 F L-2", "nu": 0.3, "density": "7850 M L-3"}
SECTIONS: dict[str, Any] = {
    "round": {"diameter": "0.071 L"}, "tube": {"outer": "0.083 L", "inner": "0.067 L"},
    "rectangle": {"width": "0.043 L", "height": "0.037 L"},
    "hollow": {"width": "0.047 L", "height": "0.053 L", "wall": "0.0041 L"},
}  # fmt: skip
BEAMS = [
    *({"spring": n, "beam": {"length": "0.57 L", "material": "steel", n: s}} for n, s in SECTIONS.items()),
    {"spring": "own", "beam": {"length": "0.57 L", "material": {"E": "7e10 F L-2", "G": "2.7e10 F L-2"},
                               "round": SECTIONS["round"]}},
    *({"spring": f"products_{a}", "beam": {"length": "0.41 L", "along": a, "EA": "3.3e7 F", "GJ": "8.1e4 F L2",
                                           **dict.fromkeys(second, "9.1e4 F L2")}}
      for a, second in {"x": ("EIy", "EIz"), "y": ("EIz", "EIx")}.items()),
]  # fmt: skip
ROWS = [["0 L F-1"] * 3 + ["0 F-1"] * 3 for _ in range(3)] + [
    ["0 F-1"] * 3 + ["0 F-1 L-1"] * 3 for _ in range(3)
]
for _i, _term in enumerate(MATRIX):
    ROWS[_i][_i] = _term
ROWS[1][5] = ROWS[5][1] = "1.7e-7 F-1"
SPRINGS: list[dict[str, Any]] = [
    {"spring": "diagonal", "compliance": MATRIX, "loss_factor": 0.01,
     "rest": ["1e-4 L", "2e-4 L", "3e-4 L", "1e-3 A", "2e-3 A", "3e-3 A"],
     "laws": {"tx": laws(False)[0], "ty": laws(False)[1], "rx": laws(True)[0], "rz": laws(True)[1]}},
    {"spring": "rows", "compliance": ROWS},
    {"spring": "entries", "stiffness": {"k11": "1.1e7 F L-1", "k22": "1.2e7 F L-1", "k33": "1.3e7 F L-1",
     "k44": "1.4e6 F L", "k55": "1.5e6 F L", "k66": "1.6e6 F L", "k26": {"value": "3.1e5 F", "u": "77 F"}}},
]  # fmt: skip
MACHINE: dict[str, Any] = {
    "name": "units",
    "units": ...,
    "gravity": [0.1, -0.2, -9.81],
    "home": FRAMES[0],
    "workspace": {"x": ["-0.17 L", "0.19 L"], "y": ["-0.23 L", "0.29 L"], "z": ["0.31 L", "0.37 L"]},
    "materials": {"steel": STEEL},
    "templates": {"shared": {"parameters": {"reach": None, "swing": "0.27 A"}, "elements": [
        {"actuator": "a", "kind": "revolute", "axis": "z", "home": "$swing", "stiffness": "1e6 F L"},
        {"offset": "o", "translation": ["$reach", "2*$reach", "0.1 L"]}]}},
    "base": [{"offset": "stand", **FRAMES[1]}],
    "legs": {
        **{kind: {"elements": joints(kind), "frame": FRAMES[1], "attach": FRAMES[2],
                  "home": {"pin": "0.15 A" if kind == "revolute" else "0.15 L"}}
           for kind in ("revolute", "prismatic")},
        "springs": {"elements": [*SPRINGS, *BEAMS, {"offset": "bent", **FRAMES[0], "actual": FRAMES[2]},
            {"offset": "straight", "translation": TURNED[1], "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]},
            {"joint": "cross", "kind": "universal", "axes": ["x", "y"], "home": ["0.1 A", "0.2 A"],
             "rest": ["0.3 A", "0.2 A"], "stiffness": ["11 F L", "12 F L"]},
            {"body": "b", "mass": "3.3 M", "com": TURNED[0], "inertia": ["0.31 M L2", "0.37 M L2", "0.41 M L2"]},
            {"body": "rows", "mass": "3.3 M", "inertia": [
                ["0.31 M L2", "0.01 M L2", "0 M L2"], ["0.01 M L2", "0.37 M L2", "0 M L2"],
                ["0 M L2", "0 M L2", "0.41 M L2"]]},
            {"point": "tip", "at": TURNED[2]}]},
        "shared": {"template": "shared", "with": {"reach": "0.33 L"}},
    },
    "platform": [{"cable": "c", "anchor": TURNED[0], "at": TURNED[1], "elasticity": "1.1e6 F", "stiffness": "3e6 F L-1",
                  "lead": "1.3 L", "pretension": "77 F", "radius": "0.021 L",
                  **numbers(False)}],
    "modal_damping": [0.01, 0.02],
    "external_springs": {"hose": {"point": "springs.tip", "anchor": TURNED[1], "stiffness": "1234 F L-1",
                                  "length": "0.44 L"}},
}  # fmt: skip


def written(data: Any, system: dict[str, str]) -> Any:
    """The machine in a system of units; each number is the decimal nearest to what it should be."""
    if isinstance(data, dict):
        return {k: dict(system) if v is ... else written(v, system) for k, v in data.items()}
    if isinstance(data, list):
        return [written(v, system) for v in data]
    match = re.fullmatch(r"(-?[\d.]+(?:e-?\d+)?)((?: [LFAM]-?\d*)+)", data) if isinstance(data, str) else None
    if match is None:
        return data
    size = Fraction(1)
    for letter, power in re.findall(r"([LFAM])(-?\d*)", match[2]):
        quantity = {"L": "length", "F": "force", "A": "angle", "M": "mass"}[letter]
        size *= SIZES[quantity][system[quantity]] ** int(power or 1)
    return float(Fraction(match[1]) / size)


def read(system: dict[str, str]) -> MachineDescription:
    """The machine from its file in these units."""
    return description_from_text(text_of(written(MACHINE, system)), "units.yaml")


SI = {"length": "m", "force": "N", "angle": "rad", "mass": "kg"}
SYSTEMS = [dict(zip(SIZES, names, strict=True)) for names in itertools.product(*SIZES.values())]
COMPUTED = re.compile(r"springs\.(round|tube|rectangle|hollow|own|products_.)\.compliance")
"""Products of up to seven numbers of a beam, each of which is compared by itself."""


def flat(value: Any, path: str = "") -> dict[str, float]:
    """Every number of a description by its way."""
    if is_dataclass(value) and not isinstance(value, type):
        name = getattr(value, "name", "")
        inside = {f.name: getattr(value, f.name) for f in fields(value) if f.name != "units"}
        path = f"{path}.{name}" if name and "." not in path[-1:] else path
    elif isinstance(value, tuple):
        inside = {getattr(v, "name", str(i)): v for i, v in enumerate(value)}
        if len(inside) != len(value):
            inside = {str(i): v for i, v in enumerate(value)}
    else:
        return {path: float(value)} if isinstance(value, (int, float)) else {}
    out: dict[str, float] = {}
    for key, v in inside.items():
        own = getattr(v, "name", None) == key
        out |= flat(v, path if own else f"{path}.{key}")
    return out


@pytest.mark.parametrize("system", SYSTEMS, ids=lambda s: "-".join(s.values()))
def test_every_number_in_every_unit(system: dict[str, str]) -> None:
    want, got = flat(read(SI)), flat(read(system))
    assert want.keys() == got.keys() and len(want) > 500
    off = {
        k: (v, got[k])
        for k, v in want.items()
        if not math.isclose(v, got[k], rel_tol=1e-14 if COMPUTED.search(k) else 1e-15, abs_tol=1e-30)
    }
    assert not off


def models(annotation: Any) -> list[type[FileModel]]:
    """Models that an annotation holds, at any depth of lists, mappings and choices."""
    if isinstance(annotation, type) and issubclass(annotation, FileModel):
        return [annotation]
    return [m for a in get_args(annotation) for m in models(a)]


def key_of(model: type[FileModel], name: str) -> str:
    """The key with the model that first declares it."""
    return next(
        f"{m.__name__}.{name}" for m in reversed(model.__mro__) if name in getattr(m, "model_fields", {})
    )


def declared() -> set[str]:
    """Every key of the schema that holds numbers."""
    found: set[str] = set()
    seen: set[type[FileModel]] = set()
    todo: list[type[FileModel]] = [MachineFile]
    while todo:
        model = todo.pop()
        if model in seen:
            continue
        seen.add(model)
        for name, field in model.model_fields.items():
            inner = models(field.annotation)
            if Number in inner:
                found.add(key_of(model, name))
            todo += [m for m in inner if m is not Number]
    return found


def used(value: Any) -> set[str]:
    """Keys of a validated file that hold numbers."""
    if isinstance(value, dict):
        return {k for v in value.values() for k in used(v)}
    if isinstance(value, (list, tuple)):
        return {k for v in value for k in used(v)}
    if not isinstance(value, FileModel) or isinstance(value, Number):
        return {"number"} if isinstance(value, Number) else set()
    out: set[str] = set()
    for name in type(value).model_fields:
        inside = used(getattr(value, name))
        out |= {key_of(type(value), name)} if "number" in inside else set()
        out |= inside - {"number"}
    return out


def test_no_number_of_the_schema_is_left_out() -> None:
    document = expanded(parse(text_of(written(MACHINE, SI)), "units.yaml"), "units.yaml")
    tried = used(MachineFile.model_validate(document.data))
    assert declared() - tried == STANDS_FOR_OTHERS


def test_left_out_a_rate_is_one_unit_of_length_per_unit_of_the_coordinate() -> None:
    machine = {**MACHINE, "legs": {"revolute": MACHINE["legs"]["revolute"]}, "external_springs": {}}
    texts = []
    for rate in ({}, {"rate": 1}):
        data = written(machine, {**SI, "length": "mm", "angle": "deg"})
        spring = next(e for e in data["legs"]["revolute"]["elements"] if e.get("spring") == "grows")
        spring["stroke"] = {k: v for k, v in spring["stroke"].items() if k != "rate"} | {
            **rate,
            "length": 900,
        }
        texts.append(text_of(data))
    one, other = (description_from_text(t, "units.yaml") for t in texts)
    assert one == other
