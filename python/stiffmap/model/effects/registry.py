"""All kinds of effects that are known, by name and by synonym: those of the library, and those that users register."""

from __future__ import annotations

from dataclasses import replace
from difflib import get_close_matches
from functools import cache
from os import PathLike

from stiffmap.common.errors import FileError, StiffmapError
from stiffmap.common.python_file import modules_of, run_python_file
from stiffmap.model.effects.evidence import RECORDS
from stiffmap.model.effects.types import EffectType


@cache
def _library() -> dict[str, EffectType]:
    import stiffmap.model.effects.library as library

    found = (e for m in modules_of(library) for e in vars(m).values() if isinstance(e, EffectType))
    return {e.kind: replace(e, precedence=library.PRECEDENCE.get(e.kind, e.precedence)) for e in found}


@cache
def _known() -> dict[str, EffectType]:
    return dict(_library())


def kinds() -> tuple[str, ...]:
    """Names of all kinds, those of the machine first, those of the measurement last."""
    ordered = sorted(_known().values(), key=lambda e: (e.measurement, e.precedence, e.kind))
    return tuple(effect.kind for effect in ordered)


def get(kind: str) -> EffectType:
    """The kind of that name; StiffmapError lists those that exist."""
    if kind not in _known():
        near = [*found_by(str(kind), kinds())[:2], *get_close_matches(str(kind), kinds(), 1)]
        hint = f" (did you mean {' or '.join(map(repr, dict.fromkeys(near)))}?)" if near else ""
        raise StiffmapError(f"no effect {kind!r}{hint}; there are: {', '.join(kinds())}")
    return _known()[kind]


def register(effect: EffectType) -> EffectType:
    """Make a kind known to everything: machines, files, command line, diagnosis. Returns it.

    Raises StiffmapError where the library has a kind of that name, or where the definition contradicts itself. A
    kind that was registered before is replaced.
    """
    if effect.kind in _library():
        raise StiffmapError(f"effect {effect.kind!r}: the library has a kind of that name")
    _check(effect)
    _known()[effect.kind] = effect
    return effect


def unregister(kind: str) -> None:
    """Forget a kind that was registered."""
    _known().pop(kind, None)


def load_effects(path: str | PathLike[str]) -> tuple[EffectType, ...]:
    """Run a Python file and register its ``EFFECT``, or each of its ``EFFECTS``.

    Raises `FileError` where it cannot be run or defines none.
    """
    module = run_python_file(path, "effect", "an effect")
    one = getattr(module, "EFFECT", None)
    found = tuple(getattr(module, "EFFECTS", ())) or ((one,) if isinstance(one, EffectType) else ())
    if not found:
        raise FileError("defines no effect: expected EFFECT = EffectType(...)", file=str(path))
    return tuple(register(e) for e in found)


def _check(effect: EffectType) -> None:
    unknown = [n for n in (*effect.needs, *effect.better_with) if n not in RECORDS]
    if unknown:
        raise StiffmapError(f"effect {effect.kind!r}: needs {unknown[0]!r}; known: {', '.join(RECORDS)}")
    if effect.apply is None and not (effect.load or effect.reading or effect.drive):
        raise StiffmapError(f"effect {effect.kind!r}: give one of apply, load, reading, drive")
    for p in effect.parameters:
        if not p.lower <= (p.lower if p.null is None else p.null) <= p.upper or not p.scale > 0:
            raise StiffmapError(
                f"effect {effect.kind!r}: {p.name}: expected lower ≤ null ≤ upper and a positive scale"
            )


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
    "frame_jump": ("tracker was moved", "bumped", "stationing", "Umstellung", "Stoß"),
    "frame_offset": ("instrument frame", "registration", "Ausrichtung"),
    "sensor_gain": ("calibration factor", "scale of the sensor", "Kalibrierfaktor"),
    "load_gain": ("force sensor calibration", "wrong force", "Kraftsensor"),
    "load_direction": ("skewed force", "oblique pull", "Schrägzug"),
    "load_offset": ("lever of the load", "eccentric load", "Hebelarm", "Exzentrizität"),
}


def found_by(word: str, kinds: tuple[str, ...]) -> list[str]:
    """Kinds whose own words or synonyms hold the word, exact ones first."""
    wanted = word.strip().lower().replace("_", " ")
    exact = [k for k in kinds if wanted in [s.lower() for s in SYNONYMS.get(k, ())]]
    part = [k for k in kinds if any(wanted in s.lower() for s in (k.replace("_", " "), *SYNONYMS.get(k, ())))]
    return [*exact, *(k for k in part if k not in exact)] if len(wanted) > 2 else exact
