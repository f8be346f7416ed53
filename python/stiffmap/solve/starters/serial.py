"""Machines of one chain: SCARA, gantry, five-axis machine, six-axis arm."""

from __future__ import annotations

from math import sqrt

from stiffmap.solve.starters.dimension import MachineClass, Values, beam, head, slide, turn
from stiffmap.solve.starters.planar import Box


def scara(d: Values, box: Box) -> str:
    """Two links that turn about vertical axes, the forearm square to the arm at home, and a vertical slide with a wrist."""
    out = head(
        "scara",
        "SCARA",
        d,
        "[x, y, z, rz]",
        f"[{d['arm']:.12g}, {d['forearm']:.12g}, {d['height']:.12g}]",
        box,
    )
    return (
        out
        + f"""
legs:
  arm:
    elements:
      - {{offset: column, translation: [0, 0, {d["height"] + d["stroke"] / 2:g}]}}
      - {{actuator: shoulder, kind: revolute, axis: z, {turn(d)}, range: [-150, 150], force: 200000}}
      - {{body: arm, of: arm}}
      - {{offset: arm_length, translation: [{d["arm"]:g}, 0, 0]}}
      - {{spring: arm, beam: {beam(d["arm"], "x", d)}}}
      - {{actuator: elbow, kind: revolute, axis: z, home: 90, {turn(d)}, range: [-150, 150], force: 100000}}
      - {{body: forearm, of: forearm}}
      - {{offset: forearm_length, translation: [{d["forearm"]:g}, 0, 0]}}
      - {{spring: forearm, beam: {beam(d["forearm"], "x", d)}}}
      - {{actuator: quill, kind: prismatic, axis: z, home: {-d["stroke"] / 2:g}, stiffness: 50000, range: [{-d["stroke"]:g}, 0], force: 500}}
      - {{actuator: wrist, kind: revolute, axis: z, home: -90, {turn(d)}, range: [-360, 360], force: 20000}}

platform:
  - {{body: tool, mass: 2}}
"""
    )


def _portal(d: Values) -> str:
    half = d["stroke"] / 2
    lines = "".join(
        f"      - {{actuator: {a}, kind: prismatic, axis: {a}, {slide(d)}, range: [{-half:g}, {half:g}], force: 5000}}\n"
        f"      - {{body: {name}, mass: {mass}}}\n"
        for a, name, mass in (("x", "bridge", 200), ("y", "carriage", 80), ("z", "ram", 40))
    )
    return (
        lines
        + f"""\
      - {{offset: ram_length, translation: [0, 0, {-d["height"]:g}]}}
      - {{spring: ram, beam: {beam(d["height"], "-z", d)}}}
"""
    )


def gantry(d: Values, box: Box) -> str:
    """Three slides and a ram that hangs down."""
    out = head("gantry", "Gantry of three slides", d, "[x, y, z]", f"[0, 0, {-d['height']:.12g}]", box)
    return (
        out
        + f"""
legs:
  gantry:
    elements:
{_portal(d)}
platform:
  - {{body: spindle, mass: 15}}
"""
    )


def five_axis(d: Values, box: Box) -> str:
    """A gantry with a fork head: C about z, A about x, and the tool below their crossing."""
    down = d["height"] + d["reach"]
    out = head("five-axis", "Gantry with a fork head", d, "[x, y, z, rx, ry]", f"[0, 0, {-down:.12g}]", box)
    out = out.replace("task: [x, y, z, rx, ry]\n", "")
    return (
        out
        + f"""
legs:
  machine:
    elements:
{_portal(d)}\
      - {{actuator: c, kind: revolute, axis: z, home: 90, stiffness: 5.0e8, range: [-360, 360], force: 500000}}
      - {{actuator: a, kind: revolute, axis: x, home: 0, stiffness: 5.0e8, range: [-110, 110], force: 500000}}
      - {{body: spindle, mass: 20}}
      - {{offset: tool, translation: [0, 0, {-d["reach"]:g}], turns: [{{about: z, by: -90}}]}}

platform:
  - {{point: nose, at: [0, 0, {d["reach"] / 2:g}]}}
"""
    )


def arm(d: Values, box: Box) -> str:
    """Six axes: the arm upright and the forearm level at home, the tool pointing down."""
    x = d["forearm"]
    z = d["height"] + d["arm"] - d["reach"]
    out = head("arm", "Six-axis arm", d, "", f"[{x:.12g}, 0, {z:.12g}]", box)
    wrist = "stiffness: {:.12g}".format(d["drive"] * 1e6 / 5)
    return (
        out
        + f"""
legs:
  arm:
    elements:
      - {{actuator: base, kind: revolute, axis: z, {turn(d)}, range: [-180, 180], force: 2.0e6}}
      - {{offset: column, translation: [0, 0, {d["height"]:g}]}}
      - {{actuator: shoulder, kind: revolute, axis: y, {turn(d)}, range: [-120, 120], force: 2.0e6}}
      - {{body: arm, of: arm}}
      - {{offset: arm_length, translation: [0, 0, {d["arm"]:g}]}}
      - {{spring: arm, beam: {beam(d["arm"], "z", d)}}}
      - {{actuator: elbow, kind: revolute, axis: y, {turn(d)}, range: [-150, 150], force: 1.0e6}}
      - {{body: forearm, of: forearm}}
      - {{offset: forearm_length, translation: [{d["forearm"]:g}, 0, 0]}}
      - {{spring: forearm, beam: {beam(d["forearm"], "x", d)}}}
      - {{actuator: roll, kind: revolute, axis: x, {wrist}, range: [-360, 360], force: 3.0e5}}
      - {{actuator: pitch, kind: revolute, axis: y, {wrist}, range: [-150, 150], force: 3.0e5}}
      - {{offset: flange, translation: [0, 0, {-d["reach"]:g}]}}
      - {{actuator: turn, kind: revolute, axis: z, {wrist}, range: [-360, 360], force: 1.0e5}}

platform:
  - {{body: tool, mass: 5}}
"""
    )


SERIAL = (
    MachineClass(
        "scara",
        "two links about vertical axes, a quill and a wrist",
        {"arm": 300, "forearm": 250, "height": 200, "stroke": 150, "tube": 80, "wall": 5, "drive": 50},
        scara,
        lambda d: (0.3 * d["arm"], 0.3 * d["forearm"], 0.4 * d["stroke"]),
    ),
    MachineClass(
        "gantry",
        "three slides and a ram",
        {"stroke": 1000, "height": 500, "tube": 150, "wall": 15, "drive": 100},
        gantry,
        lambda d: (0.45 * d["stroke"],) * 3,
    ),
    MachineClass(
        "five-axis",
        "a gantry with a fork head",
        {"stroke": 1000, "height": 500, "reach": 200, "tube": 150, "wall": 15, "drive": 100},
        five_axis,
        lambda d: (0.45 * d["stroke"],) * 3,
    ),
    MachineClass(
        "arm",
        "six-axis arm",
        {"height": 400, "arm": 600, "forearm": 600, "reach": 120, "tube": 120, "wall": 8, "drive": 500},
        arm,
        lambda d: (0.25 * sqrt(d["arm"] * d["forearm"]),) * 3,
    ),
)
