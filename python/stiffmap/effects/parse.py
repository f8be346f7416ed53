from __future__ import annotations
def parse_effect(text): raise NotImplementedError
def effect_text(r): raise NotImplementedError
