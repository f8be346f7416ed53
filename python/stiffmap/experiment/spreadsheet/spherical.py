"""Places as trackers and total stations read them: two angles and a distance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stiffmap.common.broadcasting import Floats
from stiffmap.experiment.files.fields import POSE, SEEN
from stiffmap.experiment.poses.handeye import places_apart
from stiffmap.experiment.spreadsheet.answers import Meant
from stiffmap.experiment.spreadsheet.guess import READINGS
from stiffmap.experiment.spreadsheet.turned import numbered
from stiffmap.solve.kinematics import forward_kinematics
from stiffmap.solve.machine import Machine

OF = r"(?:(?:tracker|instrument|laser|meas\.?|measured)[ _.-]*)?(?:{})(?:[ _.-]*(?:meas\.?|measured))?"
AROUND = OF.format(r"az(?:imuth)?|azimut|hz|ha|horizontal(?:[ _-]?angle)?|hor\.?[ _-]?angle|horizontalwinkel")
ABOVE = OF.format(r"el|elev(?:ation)?(?:[ _-]?angle)?|h[öo]e?henwinkel")
ZENITH = OF.format(
    r"v|va|ze|zenith?(?:[ _-]?angle)?|zenitwinkel|vertical(?:[ _-]?angle)?|ver\.?[ _-]?angle|vertikalwinkel"
)
AWAY = OF.format(
    r"d|sd|dist(?:ance)?\.?|range|radius|r|slope[ _-]?dist(?:ance)?\.?|schr[äa]e?gstrecke|strecke"
)
CLEAR = 3.0
"""How many times nearer to what was commanded the places must be where the first angle turns clockwise."""


def spherical(m: Meant, machine: Callable[[], Machine]) -> None:
    """Azimuth, elevation or zenith angle, and distance are the places that were seen, where nothing else is a reading. The azimuth
    turns from x to y unless the places then follow what was commanded clearly better the other way round, as total stations count."""
    if any(c.meaning in READINGS and c.meaning != "ll" for c in m.guessed):
        return
    around, above, zenith, away = (m.sheet.find(p) for p in (AROUND, ABOVE, ZENITH, AWAY))
    up = zenith if above is None else above
    if around is None or up is None or away is None or not all(map(m.sheet.is_numeric, (around, up, away))):
        return
    names = [m.sheet.names[i] for i in (around, up, away)]
    turn, rise, distance = (
        m.sheet.numbers(i) * m.unit(i, name, quantity=quantity).size
        for i, name, quantity in zip((around, up, away), names, ("angle", "angle", "length"), strict=True)
    )
    rise = rise if above is not None else 0.5 * np.pi - rise
    flat, high = distance * np.cos(rise), distance * np.sin(rise)
    places = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), high])
    mirrored = places * (1.0, -1.0, 1.0)
    blocks = [numbered(m, name) for name in ("setup", "target")]
    position, rotation = _commanded(m, machine)
    off, other = (places_apart(position, rotation, p, *blocks) for p in (places, mirrored))
    clockwise = CLEAR * other < off
    for seen, values in zip(SEEN, (mirrored if clockwise else places).T, strict=True):
        m.add(f"{seen} of {names[2]}", "mm", 1e3 * values, seen)
    m.chosen["note"] = [*m.chosen.get("note", ()), *(m.sheet.header[i] for i in (around, up, away))]
    way, start = " clockwise" if clockwise else "", "the zenith" if above is None else "the horizon"
    m.said.append(f"places seen are '{names[0]}'{way}, '{names[1]}' from {start} and '{names[2]}'")


def _commanded(m: Meant, machine: Callable[[], Machine]) -> tuple[Floats, Floats]:
    """Positions (n, 3), m, of the tool and rotations (n, 3, 3) that were commanded, by joints or places; NaN where neither was."""
    if m.columns:
        at = forward_kinematics(machine(), m.coordinates())
        return at.position, at.rotation
    of = {c.meaning: c.index for c in m.guessed}
    places = m.metres([of[a] for a in POSE], POSE) if {*POSE} <= {*of} else np.full((len(m.sheet), 3), np.nan)
    return places, np.tile(np.eye(3), (len(places), 1, 1))
