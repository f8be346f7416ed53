"""Machines that move in a plane: 3-RRR, 3-PRR, five-bar, xy table."""

from __future__ import annotations

from math import acos, atan2, cos, degrees, hypot, radians, sin, sqrt

from stiffmap.solve.starters.dimension import MachineClass, Values, beam, head, need, slide, turn

Box = tuple[float, float, float]


def elbow(x: float, y: float, arm: float, forearm: float, bend: float) -> tuple[float, float]:
    """Angles (deg) of arm and forearm (from the arm) to a point; `bend` 1: the elbow to the right of the way there, -1: to the left."""
    r = hypot(x, y)
    need(
        abs(arm - forearm) < r < arm + forearm,
        f"--arm, --forearm: links of {arm:g} and {forearm:g} mm do not reach a point {r:.4g} mm away",
    )
    inner = acos((arm**2 + r**2 - forearm**2) / (2 * arm * r))
    first = atan2(y, x) - bend * inner
    second = atan2(y - arm * sin(first), x - arm * cos(first)) - first
    return degrees(first), (degrees(second) + 180) % 360 - 180


def three_rrr(d: Values, box: Box) -> str:
    """Three motors on a circle, two links each, a platform with three pins."""
    out = head("3-rrr", "Planar 3-RRR", d, "[x, y, rz]", "[0, 0, 0]", box)
    out += f"""
templates:
  leg:  # all pins along z
    - {{actuator: motor, kind: revolute, axis: z, {turn(d)}, force: 60000}}
    - {{body: arm, of: arm}}
    - {{offset: arm_length, translation: [{d["arm"]:g}, 0, 0]}}
    - {{spring: arm, beam: {beam(d["arm"], "x", d)}}}
    - {{joint: elbow, kind: revolute, axis: z}}
    - {{body: forearm, of: forearm}}
    - {{offset: forearm_length, translation: [{d["forearm"]:g}, 0, 0]}}
    - {{spring: forearm, beam: {beam(d["forearm"], "x", d)}}}
    - {{joint: pin, kind: revolute, axis: z}}

legs:
"""
    for name, a in (("a", -90.0), ("b", 30.0), ("c", 150.0)):
        c, s = cos(radians(a)), sin(radians(a))
        base, pin = (d["radius"] * c, d["radius"] * s), (d["platform"] * c, d["platform"] * s)
        first, second = elbow(pin[0] - base[0], pin[1] - base[1], d["arm"], d["forearm"], 1.0)
        out += (
            f"  {name}: {{template: leg, frame: {{translation: [{base[0]:.12g}, {base[1]:.12g}, 0]}}, "
            f"attach: {{translation: [{-pin[0]:.12g}, {-pin[1]:.12g}, 0]}},\n"
            f"      home: {{motor: {first:.12g}, elbow: {second:.12g}, pin: {-first - second:.12g}}}}}\n"
        )
    return out + "\nplatform:\n  - {body: platform, mass: 3}\n"


def three_prr(d: Values, box: Box) -> str:
    """Three slides along the sides of a triangle, a rod each, a platform with three pins."""
    need(d["rod"] > d["radius"] - d["platform"], "--rod: expected more than the way from the slides to the platform, "
         f"{d['radius'] - d['platform']:g} mm")  # fmt: skip
    out = head("3-prr", "Planar 3-PRR", d, "[x, y, rz]", "[0, 0, 0]", box)
    out += f"""
templates:
  leg:  # local x inwards to the middle, y along the slide
    - {{actuator: slide, kind: prismatic, axis: y, {slide(d)}, range: [{-d["stroke"] / 2 - d["rod"]:g}, {d["stroke"] / 2 + d["rod"]:g}], force: 2000}}
    - {{body: carriage, mass: 4}}
    - {{joint: pin_slide, kind: revolute, axis: z}}
    - {{body: rod, of: rod}}
    - {{offset: rod_length, translation: [{d["rod"]:g}, 0, 0]}}
    - {{spring: rod, beam: {beam(d["rod"], "x", d)}}}
    - {{joint: pin, kind: revolute, axis: z}}

legs:
"""
    gap = d["radius"] - d["platform"]
    side = sqrt(d["rod"] ** 2 - gap**2)
    angle = degrees(atan2(side, gap))
    for name, a in (("a", -90.0), ("b", 30.0), ("c", 150.0)):
        c, s = cos(radians(a)), sin(radians(a))
        out += (
            f"  {name}: {{template: leg, frame: {{translation: [{d['radius'] * c:.12g}, {d['radius'] * s:.12g}, 0], "
            f"turns: [{{about: z, by: {a + 180:g}}}]}},\n"
            f"      attach: {{translation: [{d['platform']:.12g}, 0, 0], turns: [{{about: z, by: {-a - 180:g}}}]}},\n"
            f"      home: {{slide: {-side:.12g}, pin_slide: {angle:.12g}, pin: {-angle:.12g}}}}}\n"
        )
    return out + "\nplatform:\n  - {body: platform, mass: 3}\n"


def five_bar(d: Values, box: Box) -> str:
    """Two motors, two links each, one common pin at the tool."""
    half = d["radius"]
    height = d["height"]
    left = elbow(half, height, d["arm"], d["forearm"], -1.0)
    right = elbow(-half, height, d["arm"], d["forearm"], 1.0)
    out = head("five-bar", "Planar five-bar", d, "[x, y]", f"[0, {height:.12g}, 0]", box)
    out += f"""
templates:
  leg:  # all pins along z
    - {{actuator: motor, kind: revolute, axis: z, {turn(d)}, force: 60000}}
    - {{body: arm, of: arm}}
    - {{offset: arm_length, translation: [{d["arm"]:g}, 0, 0]}}
    - {{spring: arm, beam: {beam(d["arm"], "x", d)}}}
    - {{joint: elbow, kind: revolute, axis: z}}
    - {{body: forearm, of: forearm}}
    - {{offset: forearm_length, translation: [{d["forearm"]:g}, 0, 0]}}
    - {{spring: forearm, beam: {beam(d["forearm"], "x", d)}}}
    - {{joint: pin, kind: revolute, axis: z}}

legs:  # the tool's angle is that of the left forearm, whose pin is held by a stiff spring
"""
    for name, x, (first, second) in (("left", -half, left), ("right", half, right)):
        if name == "left":
            out += f"""\
  left:
    frame: {{translation: [{x:.12g}, 0, 0]}}
    elements:
      - {{actuator: motor, kind: revolute, axis: z, home: {first:.12g}, {turn(d)}, force: 60000}}
      - {{body: arm, of: arm}}
      - {{offset: arm_length, translation: [{d["arm"]:g}, 0, 0]}}
      - {{spring: arm, beam: {beam(d["arm"], "x", d)}}}
      - {{joint: elbow, kind: revolute, axis: z, home: {second:.12g}}}
      - {{body: forearm, of: forearm}}
      - {{offset: forearm_length, translation: [{d["forearm"]:g}, 0, 0]}}
      - {{spring: forearm, beam: {beam(d["forearm"], "x", d)}}}
    attach: {{turns: [{{about: z, by: {-first - second:.12g}}}]}}
"""
        else:
            out += (
                f"  right: {{template: leg, frame: {{translation: [{x:.12g}, 0, 0]}}, "
                f"home: {{motor: {first:.12g}, elbow: {second:.12g}, pin: {-first - second:.12g}}}}}\n"
            )
    out = out.replace("whose pin is held by a stiff spring", "to which it is fixed")
    return out + "\nplatform:\n  - {body: tool, mass: 1}\n"


def xy_table(d: Values, box: Box) -> str:
    """Two slides, one on the other, and a tool on a post that bends."""
    out = head("xy-table", "Table of two crossed slides", d, "[x, y]", f"[0, 0, {d['height']:.12g}]", box)
    return (
        out
        + f"""
legs:
  table:
    elements:
      - {{actuator: x, kind: prismatic, axis: x, {slide(d)}, range: [{-d["stroke"] / 2:g}, {d["stroke"] / 2:g}], force: 2000}}
      - {{body: saddle, mass: 30}}
      - {{actuator: y, kind: prismatic, axis: y, {slide(d)}, range: [{-d["stroke"] / 2:g}, {d["stroke"] / 2:g}], force: 2000}}
      - {{body: table, mass: 20}}
      - {{offset: post_length, translation: [0, 0, {d["height"]:g}]}}
      - {{spring: post, beam: {beam(d["height"], "z", d)}}}

platform:
  - {{body: work, mass: 5}}
"""
    )


PLANAR = (
    MachineClass(
        "3-rrr",
        "planar, three motors with two links each",
        {"radius": 300, "platform": 80, "arm": 180, "forearm": 200, "tube": 40, "wall": 4, "drive": 50},
        three_rrr,
        lambda d: (0.2 * d["arm"], 0.2 * d["arm"], 0.0),
    ),
    MachineClass(
        "3-prr",
        "planar, three slides with a rod each",
        {"radius": 400, "platform": 100, "rod": 450, "stroke": 400, "tube": 40, "wall": 4, "drive": 50},
        three_prr,
        lambda d: (0.2 * d["stroke"], 0.2 * d["stroke"], 0.0),
    ),
    MachineClass(
        "five-bar",
        "planar, two motors with two links each and one pin",
        {"radius": 150, "arm": 300, "forearm": 380, "height": 420, "tube": 50, "wall": 4, "drive": 50},
        five_bar,
        lambda d: (0.35 * d["arm"], 0.25 * d["arm"], 0.0),
    ),
    MachineClass(
        "xy-table",
        "planar, one slide on the other",
        {"stroke": 400, "height": 100, "tube": 60, "wall": 6, "drive": 100},
        xy_table,
        lambda d: (0.45 * d["stroke"], 0.45 * d["stroke"], 0.0),
    ),
)
