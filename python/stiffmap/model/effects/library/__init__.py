"""The kinds of the library by families: every `EffectType` in a module here is one."""

PRECEDENCE = {
    "compliance": 10, "dead_zone": 20, "hardening": 30, "cable_stretch": 35, "bilinear": 40,
    "tabulated": 50, "friction": 60, "hysteresis": 70, "guide_friction": 75,
    "position_dependent_compliance": 80, "zero_offset": 90, "lead_error": 100, "periodic_error": 110,
    "joint_coupling": 115, "straightness": 120, "length": 130, "length_difference": 140,
    "thermal_growth": 150, "position_offset": 160, "cable_anchor": 165, "tilt": 170, "axis_tilt": 180,
    "leg_tilt": 190, "parallelogram_width": 200, "parallelogram_parallelism": 210, "tcp_offset": 220,
    "joint_compliance": 230, "joint_clearance": 240, "joint_friction": 250, "base_compliance": 260,
    "tool_compliance": 270, "preload": 280, "gravity": 290, "payload": 300, "cable_mass": 305,
    "external_spring": 310, "load_direction": 320, "load_offset": 325, "load_gain": 330, "sensor_gain": 340, "sensor_axes": 350,
    "frame_offset": 360, "drift": 370, "frame_jump": 375, "servo_share": 380,
}  # fmt: skip
"""Order in which kinds are listed, and the lower one named of two that readings cannot distinguish; those not here are last."""
