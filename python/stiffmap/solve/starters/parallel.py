"""Machines of several legs in space: hexapod, rotary and linear delta, Orthoglide."""

from __future__ import annotations

from math import asin, atan2, cos, degrees, radians, sin, sqrt

import numpy as np

from stiffmap.solve.starters.dimension import MachineClass, Values, beam, head, need, slide, turn
from stiffmap.solve.starters.planar import Box

PAIR = 15.0
"""deg: half the angle between two neighbouring joints of a hexapod's base; on the platform the pairs are turned by 60."""


def hexapod(d: Values, box: Box) -> str:
    """Six struts between cardan joints on the base and ball joints on the platform."""
    out = head("hexapod", "Gough-Stewart hexapod, 6-UPS", d, "", f"[0, 0, {d['height']:.12g}]", box)
    base = [120.0 * k + s * PAIR for k in range(3) for s in (-1, 1)]
    platform = [120.0 * k + s * (60.0 - PAIR) for k in range(3) for s in (-1, 1)]
    rows = []
    for i, (b, p) in enumerate(zip(base, platform, strict=True)):
        foot = d["radius"] * np.array([cos(radians(b)), sin(radians(b)), 0.0])
        ball = d["platform"] * np.array([cos(radians(p)), sin(radians(p)), 0.0])
        way = ball + [0.0, 0.0, d["height"]] - foot
        length = float(np.linalg.norm(way))
        u = way / length
        across, up = degrees(asin(u[0])), degrees(atan2(-u[1], u[2]))
        rows.append(
            f"  {i + 1}: {{template: leg, frame: {{translation: [{foot[0]:.12g}, {foot[1]:.12g}, 0]}}, "
            f"attach: {{translation: [{-ball[0]:.12g}, {-ball[1]:.12g}, 0]}},\n"
            f"      home: {{cardan: [{up:.12g}, {across:.12g}], strut: {length:.12g}, "
            f"ball: [0, {-across:.12g}, {-up:.12g}]}}}}\n"
        )
    rod = length / 2
    return (
        out
        + f"""
templates:
  leg:  # local z runs along the strut once the cardan joint is at its home angles
    - {{joint: cardan, kind: universal, axes: [x, y]}}
    - {{body: cylinder, mass: 8, com: [0, 0, {rod / 2:.6g}]}}
    - {{actuator: strut, kind: prismatic, axis: z, {slide(d)}, range: [{0.6 * length:.6g}, {1.4 * length:.6g}], force: 8000}}
    - {{joint: spin, kind: revolute, axis: z, note: the rod may turn in its cylinder}}
    - {{body: rod, of: rod}}
    - {{spring: rod, beam: {beam(rod, "z", d)}}}
    - {{joint: ball, kind: spherical, axes: [z, y, x]}}

legs:
{"".join(rows)}
platform:
  - {{body: platform, mass: 20}}
"""
    )


def _parallelogram(rod: float, spread: float, home: float, d: Values) -> str:
    sides = ""
    for name, s in (("left", -1), ("right", 1)):
        sides += f"""
        {name}:
          - {{offset: spread, translation: [0, {s * spread:g}, 0]}}
          - {{joint: ball_upper, kind: spherical, axes: [y, z, x], home: [{home:.12g}, 0, 0]}}
          - {{body: rod, of: rod}}
          - {{offset: rod_length, translation: [{rod:.12g}, 0, 0]}}
          - {{spring: rod, beam: {beam(rod, "x", d)}}}
          - {{joint: ball_lower, kind: spherical, axes: [x, z, y], home: [0, 0, {-home:.12g}]}}
          - {{offset: close, translation: [0, {-s * spread:g}, 0]}}"""
    return f"""\
    - block: parallelogram
      branches:{sides}
"""


def _circle(radius: float, toward_middle: bool) -> str:
    out = ""
    for name, a in (("a", 0.0), ("b", 120.0), ("c", 240.0)):
        c, s = cos(radians(a)), sin(radians(a))
        by = a + 180.0 if toward_middle else a
        out += (
            f"  {name}: {{template: leg, frame: {{translation: [{radius * c:.12g}, {radius * s:.12g}, 0], "
            f"turns: [{{about: z, by: {by:g}}}]}}, attach: base_axes}}\n"
        )
    return out


def delta(d: Values, box: Box) -> str:
    """Three cranks, level at home, with parallelograms of rods on balls."""
    inward = d["radius"] + d["arm"] - d["platform"]
    need(
        0 < inward < d["rod"],
        f"--rod: expected more than radius + arm - platform, {inward:g} mm, which is to be positive",
    )
    down = sqrt(d["rod"] ** 2 - inward**2)
    home = degrees(atan2(down, -inward))
    out = head("delta", "Rotary delta", d, "[x, y, z]", f"[0, 0, {-down:.12g}]", box)
    return (
        out
        + f"""
templates:
  leg:  # local x points outwards, z up; a positive crank angle goes down
    - {{actuator: motor, kind: revolute, axis: y, {turn(d)}, range: [-60, 90], force: 120000}}
    - {{body: crank, of: crank}}
    - {{offset: crank_length, translation: [{d["arm"]:g}, 0, 0]}}
    - {{spring: crank, beam: {beam(d["arm"], "x", d)}}}
{_parallelogram(d["rod"], d["platform"] * 0.6, home, d)}\
    - {{offset: plate, translation: [{-d["platform"]:g}, 0, 0]}}

legs:
{_circle(d["radius"], False)}
platform:
  - {{body: platform, mass: 1}}
"""
    )


def linear_delta(d: Values, box: Box) -> str:
    """Three towers with carriages, and parallelograms of rods on balls."""
    inward = d["radius"] - d["platform"]
    need(
        0 < inward < d["rod"],
        f"--rod: expected more than radius - platform, {inward:g} mm, which is to be positive",
    )
    down = sqrt(d["rod"] ** 2 - inward**2)
    home = degrees(atan2(down, inward))
    z = d["height"] - down
    out = head("linear-delta", "Linear delta", d, "[x, y, z]", f"[0, 0, {z:.12g}]", box)
    return (
        out
        + f"""
templates:
  leg:  # local x points from the tower to the machine's axis, z up
    - {{actuator: carriage, kind: prismatic, axis: z, home: {d["height"]:g}, {slide(d)}, range: [{d["height"] - d["stroke"] / 2:g}, {d["height"] + d["stroke"] / 2:g}], force: 500}}
    - {{body: carriage, mass: 0.5}}
{_parallelogram(d["rod"], d["platform"] * 0.6, home, d)}\
    - {{offset: plate, translation: [{d["platform"]:g}, 0, 0]}}

legs:
{_circle(d["radius"], True)}
platform:
  - {{body: platform, mass: 1}}
"""
    )


def orthoglide(d: Values, box: Box) -> str:
    """Three perpendicular slides with parallelograms."""
    reach = d["platform"]
    out = head("orthoglide", "Orthoglide", d, "[x, y, z]", "[0, 0, 0]", box)
    sides = ""
    for name, s in (("low", -1), ("high", 1)):
        sides += f"""
        {name}:
          - {{offset: spread, translation: [0, 0, {s * 0.15 * d["rod"]:.12g}]}}
          - {{joint: pin_near, kind: revolute, axis: y}}
          - {{body: bar, of: bar}}
          - {{offset: bar_length, translation: [{d["rod"]:g}, 0, 0]}}
          - {{spring: bar, beam: {beam(d["rod"], "x", d)}}}
          - {{joint: pin_far, kind: revolute, axis: y}}
          - {{offset: close, translation: [0, 0, {-s * 0.15 * d["rod"]:.12g}]}}"""
    home = -(d["rod"] + reach)
    return (
        out
        + f"""
templates:
  leg:  # local x is the guide of the leg
    - {{actuator: slide, kind: prismatic, axis: x, home: {home:g}, {slide(d)}, range: [{home - d["stroke"]:g}, {home + d["stroke"]:g}], force: 2000}}
    - {{body: carriage, mass: 4}}
    - {{joint: near, kind: revolute, axis: z}}
    - block: parallelogram
      branches:{sides}
    - {{joint: far, kind: revolute, axis: z}}
    - {{offset: flange, translation: [{reach:g}, 0, 0]}}

legs:
  x: {{template: leg, frame: {{axes: xyz}}, attach: base_axes}}
  y: {{template: leg, frame: {{axes: yzx}}, attach: base_axes}}
  z: {{template: leg, frame: {{axes: zxy}}, attach: base_axes}}

platform:
  - {{body: platform, mass: 5}}
"""
    )


PARALLEL = (
    MachineClass(
        "hexapod",
        "six struts (6-UPS)",
        {"radius": 500, "platform": 250, "height": 700, "tube": 50, "wall": 8, "drive": 100},
        hexapod,
        lambda d: (0.3 * d["radius"], 0.3 * d["radius"], 0.1 * d["height"]),
    ),
    MachineClass(
        "delta",
        "rotary delta: three cranks with parallelograms",
        {"radius": 200, "platform": 70, "arm": 350, "rod": 800, "tube": 40, "wall": 4, "drive": 50},
        delta,
        lambda d: (0.6 * d["arm"], 0.6 * d["arm"], 0.3 * d["arm"]),
    ),
    MachineClass(
        "linear-delta",
        "linear delta: three towers with parallelograms",
        {
            "radius": 350,
            "platform": 50,
            "rod": 500,
            "height": 700,
            "stroke": 500,
            "tube": 20,
            "wall": 2,
            "drive": 10,
        },
        linear_delta,
        lambda d: (0.2 * d["rod"], 0.2 * d["rod"], 0.3 * d["stroke"]),
    ),
    MachineClass(
        "orthoglide",
        "three perpendicular slides with parallelograms",
        {"rod": 500, "platform": 50, "stroke": 400, "tube": 40, "wall": 4, "drive": 50},
        orthoglide,
        lambda d: (0.3 * d["rod"], 0.3 * d["rod"], 0.3 * d["rod"]),
    ),
)
