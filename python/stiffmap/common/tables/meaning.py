"""What the name of a column stands for, in the words of workshops in several languages."""

from __future__ import annotations

import re

FORCE = "force|kraft|last|load|effort|charge|forza|carico|fuerza|carga"
MOMENT = "moment|torque|drehmoment|momento|couple"
DEFLECTION = (
    "defl|deflection|displ?\\.?|displacement|déplacement|flèche|verschiebung|verlagerung|verformung|durchbiegung|"
    "spostamento|freccia|desplazamiento|deflexión|flecha"
)
COMMANDED = "target|cmd|nom|nominal|command|commanded|ref|desired|soll"
MEASURED = "act|actual|meas|measured|achieved|attained|ist"
PATTERNS: tuple[tuple[str, str], ...] = (
    ("id", r"#|id|nr\.?|no\.?|lfd\.? ?nr\.?|number|nummer|row|zeile|punkt|messpunkt|point|messpunkt nr\.?|point no\.?|punto"),
    ("temperature", r"t|temp|temperature|temperatur"),
    ("order", r"order|reihenfolge|sequence"),
    ("setup", r"set-?up|aufbau|aufspannung"),
    ("branch", r"branch|richtung der last|loading"),
    *((f"f{a}", rf"f ?_?{a}|({FORCE})[ _.]?(in |en |f[ _]?)?{a}|{a} ?({FORCE})") for a in "xyz"),
    *((f"m{a}", rf"m ?_?{a}|({MOMENT})[ _.]?(in |en |m[ _]?)?{a}") for a in "xyz"),
    *((f"u_d{a}", rf"(u|±|sigma|std|uncertainty) ?_?d?{a}") for a in "xyz"),
    *((f"d{a}", rf"(d|delta|δ|{DEFLECTION}|abweichung|error|dev|(dial )?gau?ge|dial|indicator|(mess)?uhr|reading|auslenkung|weg|dehnung)[ _.]?(in |en |[dδ][ _]?)?{a}|{a} ?_?(dif|diff|difference|dev|deviation|err|error|abweichung)|{a}[ _-]?({DEFLECTION}|dial|gau?ge|uhr|reading)") for a in "xyz"),
    *((f"p{a}", rf"p_?{a}") for a in "xyz"),
    ("ll", r"l|ll|(measured |gemessene )?(length|länge|laenge)|(draw[ -]?)?wire( ?length)?|(cable|string|ball-?bar|bar) ?length|seil(zug)?(länge)?|distance|abstand"),
    *((f"r{a}", rf"r ?_?{a}|rotation ?_?{a}") for a in "xyz"),
    *((a, rf"{a}|pos\.?[ _-]?{a}|{a}[ _-]?pos\.?|position ?_?{a}|(pose|punkt|messpunkt|tcp|ort|lage|koordinate|coordinate) ?_?{a}|{a}[ _-]?(t|{COMMANDED})|({COMMANDED})[ _-]?{a}") for a in "xyz"),
)  # fmt: skip


def meaning_of(name: str) -> str:
    """``x``, ``fz``, ``dx``, ``temperature``, ``id`` and the like, of a name without its unit; empty for what is none of them."""
    plain = re.sub(r"\s+", " ", name.strip().lower())
    return next((m for m, pattern in PATTERNS if re.fullmatch(pattern, plain)), "")
