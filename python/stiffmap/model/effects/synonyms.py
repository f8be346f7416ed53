"""Words that people use for effects, in English and German."""

from __future__ import annotations

SYNONYMS = {
    "dead_zone": ("backlash", "play", "lost motion", "slack", "gap", "Spiel", "Umkehrspiel", "Lose"),
    "joint_clearance": ("clearance", "bearing play", "Lagerspiel", "Gelenkspiel"),
    "friction": ("stiction", "stick-slip", "hysteresis", "Reibung", "Haftreibung", "Hysterese"),
    "joint_friction": ("friction of a pin", "Gelenkreibung"),
    "compliance": ("softness", "soft drive", "soft link", "elasticity", "servo stiffness", "Nachgiebigkeit"),
    "joint_compliance": ("bearing compliance", "Lagernachgiebigkeit"),
    "base_compliance": ("soft foundation", "frame compliance", "Fundament", "Gestell"),
    "tool_compliance": ("soft tool holder", "spindle compliance", "Werkzeughalter"),
    "gravity": ("sag", "weight", "droop", "Durchhang", "Schwerkraft", "Gewicht"),
    "payload": ("mass on the tool", "tool weight", "Nutzlast"),
    "thermal_growth": ("heat", "warm-up", "expansion", "temperature", "Wärmedehnung"),
    "joint_coupling": (
        "gear coupling",
        "wrist coupling",
        "screw turns along",
        "Koppelfehler",
        "Achskopplung",
    ),
    "lead_error": ("pitch error", "screw error", "scale error", "Steigungsfehler", "Spindelsteigung"),
    "periodic_error": ("cyclic error", "wobble", "interpolation error", "Periodenfehler"),
    "zero_offset": ("homing error", "reference offset", "encoder offset", "Nullpunkt", "Referenzfehler"),
    "length": ("link length error", "bar too long", "Längenfehler"),
    "tilt": ("squareness", "guide not square", "Rechtwinkligkeit", "Neigung"),
    "straightness": ("bent guide", "guide error", "Geradheit"),
    "cable_stretch": ("rope stiffness", "belt stretch", "Seildehnung", "Riemendehnung"),
    "cable_anchor": ("wrong anchor", "pulley position", "Ankerpunkt"),
    "guide_friction": ("pulley friction", "capstan", "Umlenkrolle", "Rollenreibung"),
    "cable_mass": ("rope weight", "Seilgewicht"),
    "preload": ("pretension", "Vorspannung"),
    "hardening": ("stiffening", "progressive spring", "progressiv"),
    "drift": ("creep of the zero", "wandering", "Drift"),
    "frame_offset": ("instrument frame", "registration", "Ausrichtung"),
    "sensor_gain": ("calibration factor", "scale of the sensor", "Kalibrierfaktor"),
    "load_gain": ("force sensor calibration", "wrong force", "Kraftsensor"),
    "load_direction": ("skewed force", "oblique pull", "Schrägzug"),
}


def found_by(word: str, kinds: tuple[str, ...]) -> list[str]:
    """Kinds whose own words or synonyms hold the word, exact ones first."""
    wanted = word.strip().lower().replace("_", " ")
    exact = [k for k in kinds if wanted in [s.lower() for s in SYNONYMS.get(k, ())]]
    part = [k for k in kinds if any(wanted in s.lower() for s in (k.replace("_", " "), *SYNONYMS.get(k, ())))]
    return [*exact, *(k for k in part if k not in exact)] if len(wanted) > 2 else exact
