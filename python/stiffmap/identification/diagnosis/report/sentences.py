"""A diagnosis in words: its answer and what to do next as a workshop says it (µm); effects, numbers and measurements for the screen (mm)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

from stiffmap.common.number_text import place_text, with_uncertainty, within
from stiffmap.common.units import DISPLAY_UNITS
from stiffmap.identification.candidates.candidates import words
from stiffmap.identification.diagnosis.report.findings import Effect
from stiffmap.identification.diagnosis.report.separation import Separation
from stiffmap.identification.diagnosis.slips.axes import Slip
from stiffmap.identification.inference.kernels import WANDER
from stiffmap.identification.inference.verdict import CLEARLY, NOISIER
from stiffmap.identification.numbers.unknowns import SAG
from stiffmap.model.effects import registry

LISTED = 5
"""Steps left out, numbers, and what cannot be distinguished from an effect: how many are named."""
UNITS = {
    "m": (1e6, "µm"), "m/N": (1e6, "µm/N"), "1/m": (1e-3, "1/mm"),
    "rad": (1e3, "mrad"), "rad/m": (1e3, "mrad/m"), "rad/(N*m)": (1e3, "mrad/(N·m)"), "1": (1.0, ""),
}  # fmt: skip
"""Factor from SI, and the unit that a workshop reads."""
NAMES = {"actuator": "drive"}
NAMELESS = ("none", "unattributed")
ALIASES = 2
"""What cannot be distinguished from an effect: how many the headline names."""


def measured(value: float, low: float, high: float, unit: str) -> str:
    """``0.301 ± 0.002 µm/N`` (one standard uncertainty), to the digits that it carries."""
    factor, name = UNITS.get(unit, (1.0, unit))
    half = factor * abs(high - low) / 2 / 1.96
    if not (half > 0 and isfinite(half)):
        return f"{factor * value:.4g} {name}".rstrip()
    return f"{with_uncertainty(factor * value, half)} {name}".rstrip()


def interval(value: float, low: float, high: float, unit: str) -> tuple[str, str, str]:
    """Value and ends of the interval to the same digits, with the unit that a workshop reads."""
    factor, name = UNITS.get(unit, (1.0, unit))
    own, least, most = (f"{text} {name}".rstrip() for text in digits(factor, value, low, high))
    return own, least, most


def place(e: Effect) -> str:
    """``the drive of leg z``."""
    return f"the {_element(e.element, e.legs)}"


def _element(element: str, legs: Sequence[str]) -> str:
    of = f" of leg{'s' if len(legs) > 1 else ''} {', '.join(legs)}" if legs else ""
    return f"{NAMES.get(element, element)}{of}"


def sentence(e: Effect) -> str:
    """One effect, with its size."""
    p = e.parameters
    compared = registry.get(e.kind).compared
    if compared and "scale" in p and p["scale"][0] > 0:
        return _compared(e, *compared)
    values = ", ".join(f"{n.replace('_', ' ')} {measured(*v)}" for n, v in p.items())
    return f"{registry.get(e.kind).title} at {place(e)}: {values}"


def _compared(e: Effect, more: str, less: str) -> str:
    scale = e.parameters["scale"][0]
    how = f"{scale:.2f} times as {more}" if scale >= 1 else f"{1 / scale:.2f} times as {less}"
    head = f"{_upper(place(e))} is {how} as in your file"
    if "value" not in e.parameters:
        return f"{head}: scale {measured(*e.parameters['scale'])}"
    value, low, high, unit = e.parameters["value"]
    factor, _ = UNITS.get(unit, (1.0, unit))
    return f"{head}: {measured(value, low, high, unit)} instead of {factor * value / scale:.3g}"


def opening(d: Any) -> str:
    """The verdict as one says it: first what is wrong with the readings, then the cause with what cannot be distinguished from it."""
    if not d.slips:
        return _of_machine(d, d.verdict)
    first = ". Then ".join(slip_sentence(s) for s in d.slips)
    kind = inner_verdict(d)
    if not d.slips[-1].undone:
        return f"{_upper(first)}, before any cause is looked for in the machine."
    return f"{_upper(first)}. With that undone: {_of_machine(d, kind)}"


def slip_sentence(s: Slip) -> str:
    """``check the sign of y: gauge y has the opposite sign; or check …``."""
    also = "".join(f", or {a}" for a in s.also)
    return f"{s.check}{also} ({s.seen})"


def inner_verdict(d: Any) -> str:
    """The verdict on readings without their mistakes."""
    if d.effects or (d.calibration and d.calibration.beyond):
        return "ambiguous" if d.alternatives else "effects+unattributed" if d.unexplained else "effects"
    return "unattributed" if d.unexplained or off_as_a_group(d) else "none"


def off_as_a_group(d: Any) -> bool:
    """Whether nothing is left but declared numbers that are off beyond what their uncertainties allow, none of which can be named."""
    return bool(not d.unexplained and d.calibration and d.calibration.wide and not d.calibration.beyond)


def left_is(d: Any, what: str) -> bool:
    """Whether something is left without a name, and nothing else than this."""
    return bool(d.unexplained) and all(p.what.startswith(what) for p in d.unexplained)


def _upper(text: str) -> str:
    return text[:1].upper() + text[1:]


def aliases(e: Effect) -> str:
    """What these readings cannot distinguish from an effect, for the headline; empty where there is nothing."""
    names = list(dict.fromkeys(alias_words(a) for a in e.aliases))
    if not names:
        return ""
    shown = " or ".join(names[:ALIASES])
    more = len(names) - ALIASES
    return (
        f"; these readings cannot distinguish it from {shown}{f' or one of {more} more' if more > 0 else ''}"
    )


def alias_words(a: Mapping[str, Any]) -> str:
    """``the stiffness of the foot of leg z``, as one says it."""
    return f"{registry.get(a['kind']).title} ({_element(a['element'], a['legs'])})"


def _nameless(d: Any, verdict: str) -> tuple[str, str]:
    """The verdict on a machine of which nothing has a name, and what to do with it."""
    before, unit = d.before.size
    size = f"{1e6 * before:.1f} µ{unit} rms, noise {1e6 * d.noise_size:.1f} µ{unit}"
    if verdict == "none":
        if d.calibration is not None:
            return (
                f"No cause apart from the machine's uncertain numbers; they are {d.calibration.verdict} ({size}).",
                "Nothing to mend. machine.yaml holds the machine that predicts readings best which it has not seen.",
            )
        if d.stopped:
            return f"The diagnosis was stopped before it found anything ({size}).", "Let it come to its end."
        agrees = f"The machine agrees with its file within what these readings can show ({size})"
        # the readings differ from it by clearly more than their noise: the first limitation says why
        if d.limitations and before > CLEARLY * d.noise_size / max(1.0, d.noise.scale):
            return (
                f"{agrees}; {d.limitations[0]}.",
                "Nothing to correct at the machine. Check the instrument and read again before you keep these readings as a record.",
            )
        return f"{agrees}.", "Nothing to correct. Keep the readings as the record of this state."
    if left_is(d, NOISIER):
        times = d.noise.scale * before / d.noise_size
        return (
            f"The readings scatter {times:.2g} times as much as is stated ({size}), and show nothing else for certain.",
            "State the noise that the instrument has here, or read every condition twice, and diagnose again.",
        )
    if left_is(d, WANDER):
        return (
            f"What the readings differ by from the file ({size}) goes on from row to row over time, as a drift of the instrument or of the machine does.",
            "Let machine and instrument warm up, and read one pose again and again between the others: it shows the drift alone.",
        )
    if off_as_a_group(d):
        return (
            f"The machine differs from its file ({size}) by more than its numbers are uncertain, and none of them alone can be named.",
            "Read more poses and other loads, which tell numbers apart; or give the uncertainties that they have (u in the machine's "
            "file, or --tolerance). Until then plan and compensate with machine.yaml.",
        )
    nothing = "nothing that was tried" if d.stopped else "no single cause known to stiffmap"
    step = (
        "Look at where the difference is largest (What is left), check the instrument's frame, the tool and "
        "where the load acts first, and read again there."
    )
    return f"The machine differs from its file ({size}), and {nothing} explains how.", step


def _of_machine(d: Any, verdict: str) -> str:
    """The verdict on the machine; the largest share of the difference first, be it an effect or a number."""
    if verdict in NAMELESS:
        return _nameless(d, verdict)[0]
    found = [(e.evidence.get("share", 0.0), sentence(e) + aliases(e)) for e in d.effects]
    found += [(n.share, str(n)) for n in (d.calibration.beyond if d.calibration else ())]
    named = "; ".join(text for _, text in sorted(found, key=lambda f: -f[0]))
    rest = " Part of the difference remains unexplained." if d.unexplained else ""
    head = "The readings are explained by more than one cause. First of them: " * (verdict == "ambiguous")
    return f"{head}{named}.{rest}"


def next_step(d: Any) -> str:
    """What to do with the answer."""
    if d.slips:
        return (
            "Check this at the machine and in the sheet, correct the readings and diagnose again; look for no cause in the "
            "machine before."
        )
    if d.verdict in NAMELESS:
        return _nameless(d, d.verdict)[1]
    if d.verdict == "ambiguous" and not d.alternatives:
        return "Inspect this place, and read more poses or other loads: declared numbers that are off explain these nearly as well."
    if d.verdict == "ambiguous" and d.separations:
        best = min(d.separations, key=lambda s: s.readings or float("inf"))
        if best.readings and best.readings <= d.before.n:  # no more than all that was read
            return f"One more measurement decides: {separation_text(best)}."
        return "Inspect all of these places: no reading that this machine can show distinguishes them with a sensible effort."
    if all(registry.get(e.kind).measurement for e in d.effects) and d.effects:
        return "Check the instrument and how the load was applied, correct the readings and diagnose again: this is no fault of the machine."
    if d.effects and d.which == "calibrated":
        return "Inspect this place. machine.yaml has the machine's numbers adjusted in its stead: it predicts unseen readings better."
    if d.which == "declared":
        return "Inspect this place, and read more poses: no corrected machine predicts unseen readings better than the declared one yet."
    if any(e.aliases for e in d.effects):
        return (
            "Inspect this place and the others that fit the readings as well (the report lists them). The corrected machine file "
            "predicts the tool equally well, whichever of them it is."
        )
    if not d.effects and d.calibration and all(n.group == SAG for n in d.calibration.beyond):
        return (
            "Plan and compensate with machine.yaml: every arm sags. For its stiffness write masses of the links, compliances of the drives "
            "and gravity into the file."
        )
    return "Inspect this place; until it is mended, plan and compensate with machine.yaml."


def digits(factor: float, value: float, low: float, high: float) -> list[str]:
    """A value and the ends of its 95 % interval, times a factor, all to the digits that the value carries."""
    half = factor * abs(high - low) / 2 / 1.96
    return [within(factor * v, half) for v in (value, low, high)]


def effect_text(e: Effect) -> str:
    """``compliance of actuator, leg z: scale 2.148 [2.137, 2.159]``."""
    values = []
    for name, (*numbers, unit) in e.parameters.items():
        factor, label = DISPLAY_UNITS.get(unit, (1.0, unit))
        at, *ends = digits(factor, *numbers)
        text = f"{name} {at} [{', '.join(ends)}]"
        values.append(text if label == "1" else f"{text} {label}")
    others = list(dict.fromkeys(words(a["kind"], a["element"], a["legs"]) for a in e.aliases))
    more = [f"{len(others) - LISTED} more"] if len(others) > LISTED else []
    same = "; ".join([*others[:LISTED], *more])
    same = f" (these readings cannot distinguish it from {same})" if same else ""
    return f"{words(*e.place)}: {', '.join(values)}{same}"


def separation_text(s: Separation) -> str:
    """Where, load, axis, how many."""
    load = ", ".join(f"{v:.0f}" for v in s.force)
    many = f"{s.readings or 'no sensible number of'} reading{'s' if s.readings != 1 else ''}"
    gap = f"{1e3 * s.difference:.4f} mm"
    return f"read {s.axis} at {place_text(s.position, '.0f')} under force ({load}) N: they differ by {gap}, {many}"
