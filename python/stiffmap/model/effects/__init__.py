"""Effects: whatever a real machine has beyond the declared one. The kinds are in `library`, one file for each family."""

from stiffmap.model.effects.apply import add_effect, apply_records, place_text
from stiffmap.model.effects.parse import effect_text, parse_effect
from stiffmap.model.effects.registry import get, kinds, load_effects, register, unregister
from stiffmap.model.effects.types import EffectType, Option, Parameter, Placed

__all__ = [
    "EffectType", "Option", "Parameter", "Placed", "add_effect", "apply_records", "effect_text", "get",
    "kinds", "load_effects", "parse_effect", "place_text", "register", "unregister",
]  # fmt: skip
