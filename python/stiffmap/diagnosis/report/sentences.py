"""The answer of a diagnosis in a sentence, and what to do next."""

from __future__ import annotations

from math import floor, log10
from typing import Any

from stiffmap.diagnosis.report.findings import Effect
from stiffmap.diagnosis.report.wording import noise_size, separation_text
from stiffmap.effects import registry

UNITS = {
    "m": (1e6, "µm"),
    "m/N": (1e6, "µm/N"),
    "rad": (1e3, "mrad"),
    "rad/(N*m)": (1e3, "mrad/(N·m)"),
    "1/m": (1e-3, "1/mm"),
    "1": (1.0, ""),
}
"""Factor from SI, and the unit that a workshop reads."""
NAMES = {"actuator": "drive", "motor": "motor"}


def measured(value: float, low: float, high: float, unit: str) -> str:
    """``0.301 ± 0.002 µm/N`` (one standard uncertainty), digits as many as the interval carries."""
    factor, name = UNITS.get(unit, (1.0, unit))
    half = factor * abs(high - low) / 2 / 1.96
    digits = 3 if not half > 0 else max(0, min(6, int(-_exponent(half)) + (0 if half < 1 else 1)))
    text = f"{factor * value:.{digits}f} ± {half:.{digits}f}" if half > 0 else f"{factor * value:.4g}"
    return f"{text} {name}".rstrip()


def _exponent(value: float) -> float:
    return floor(log10(value))


def place(e: Effect) -> str:
    """``the drive of leg z``."""
    element = NAMES.get(e.element, e.element)
    if not e.legs:
        return f"the {element}"
    return f"the {element} of leg{'s' if len(e.legs) > 1 else ''} {', '.join(e.legs)}"


def sentence(e: Effect) -> str:
    """One effect, with its size."""
    p = e.parameters
    words = registry.get(e.kind).compared
    if words and "scale" in p and p["scale"][0] > 0:
        return _compared(e, *words)
    values = ", ".join(f"{n.replace('_', ' ')} {measured(*v)}" for n, v in p.items())
    return f"{registry.get(e.kind).title} at {place(e)}: {values}"


def _compared(e: Effect, more: str, less: str) -> str:
    scale = e.parameters["scale"][0]
    how = (
        f"{scale:.2f} times as {more} as in your file"
        if scale >= 1
        else f"{1 / scale:.2f} times as {less} as in your file"
    )
    head = f"{place(e).capitalize() if place(e)[0] != 't' else 'T' + place(e)[1:]} is {how}"
    if "value" not in e.parameters:
        return f"{head}: scale {measured(*e.parameters['scale'])}"
    value, low, high, unit = e.parameters["value"]
    factor, _ = UNITS.get(unit, (1.0, unit))
    return f"{head}: {measured(value, low, high, unit)} instead of {factor * value / scale:.3g}"


def opening(d: Any) -> str:
    """The verdict as one says it."""
    before, unit = d.before.size
    size = f"{1e6 * before:.1f} µ{unit} rms, noise {1e6 * noise_size(d):.1f} µ{unit}"
    named = "; ".join(sentence(e) for e in d.effects)
    if d.verdict == "none" and d.calibration is not None and d.calibration.verdict != "as declared":
        return f"No cause beside the machine's uncertain numbers; these: {d.calibration.verdict} ({size})."
    if d.verdict == "none" and d.stopped:
        return f"The diagnosis was stopped before it found anything ({size})."
    if d.verdict == "none":
        return f"The machine agrees with its file within what these readings can show ({size})."
    if d.verdict == "unattributed" and d.stopped:
        return f"The machine differs from its file ({size}), and nothing that was tried explains how."
    if d.verdict == "unattributed":
        return (
            f"The machine differs from its file ({size}), and no single cause known to stiffmap explains how."
        )
    if d.verdict == "ambiguous" and not d.effects:
        return f"No single number of the machine stands out; {d.calibration.verdict} ({size})."
    if d.verdict == "ambiguous":
        return f"The readings are explained by more than one cause. First of them: {named}."
    rest = " Part of the difference remains unexplained." if "unattributed" in d.verdict else ""
    return f"{named}.{rest}"


def next_step(d: Any) -> str:
    """What to do with the answer."""
    if d.verdict == "none" and d.calibration is not None and d.calibration.beyond:
        return "Inspect the number that is beyond tolerance; machine.yaml has it."
    if d.verdict == "none" and d.calibration is not None and d.calibration.verdict != "as declared":
        return "Nothing to mend. machine.yaml holds the calibrated numbers and predicts this machine better than the declared file."
    if d.verdict == "none" and d.stopped:
        return "Let it come to its end."
    if d.verdict == "none":
        return "Nothing to correct. Keep the readings as the record of this state."
    if d.verdict == "ambiguous" and not d.effects:
        tilt = "" if d.experiment.axis_read[3:6].any() else ", the tilt of the tool as well (rx, ry, rz)"
        return f"Read what tells these groups apart{tilt}; `stiffmap plan` proposes poses."
    if d.verdict == "unattributed":
        return (
            "Look at where the difference is largest (What is left), check the instrument's frame and the tool "
            "first, and read again there."
        )
    if d.verdict == "ambiguous" and d.separations:
        return f"One more measurement decides: {separation_text(d.separations[0])}."
    if d.verdict == "ambiguous" and not d.alternatives:
        return "Inspect this place, and read more poses or other loads: numbers within tolerance explain these nearly as well."
    if any(e.aliases for e in d.effects):
        return (
            "Inspect this place and those which these readings cannot tell from it (the report names them); the corrected "
            "machine file predicts the tool equally well whichever it is."
        )
    return "Inspect this place; until it is mended, plan and compensate with the corrected machine file."
