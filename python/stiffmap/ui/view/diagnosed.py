"""What a diagnosis named, on the elements that it named: of a `Diagnosis`, or of the folder that ``stiffmap diagnose -o`` wrote."""

from __future__ import annotations

import json
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from stiffmap.common.errors import FileError
from stiffmap.solve.machine import Machine, load_machine
from stiffmap.ui.plot.elements import element_links

RESULT, CORRECTED = "diagnosis.json", "machine.yaml"


@dataclass(frozen=True)
class Named:
    """An effect on its element; `legs` is empty where the element is in none."""

    kind: str
    element: str
    legs: tuple[str, ...]
    text: str

    def links(self, machine: Machine) -> list[int]:
        """Which links of a drawing are lit for it."""
        return element_links(machine, self.element, self.legs)


@dataclass(frozen=True, eq=False)
class Findings:
    """A verdict, the effects that it names, and the machine with them."""

    verdict: str
    effects: tuple[Named, ...]
    machine: Machine


def findings(diagnosis: Any) -> Findings:
    """Of a `Diagnosis`, or of the folder of one (or its ``diagnosis.json``); FileError where that cannot be read."""
    if isinstance(diagnosis, str | PathLike):
        return _from_folder(Path(diagnosis))
    return Findings(diagnosis.verdict, tuple(map(_named, diagnosis.as_plain()["effects"])), diagnosis.machine)


def _from_folder(given: Path) -> Findings:
    file = given / RESULT if given.is_dir() else given
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
        verdict, effects = str(data["verdict"]), tuple(map(_named, data["effects"]))
    except OSError as problem:
        message = f"{problem.strerror}; expected the folder that stiffmap diagnose -o wrote"
        raise FileError(message, file=str(file)) from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise FileError(f"expected the {RESULT} that stiffmap diagnose -o wrote", file=str(file)) from None
    return Findings(verdict, effects, load_machine(file.with_name(CORRECTED)))


def _named(e: Any) -> Named:
    legs = tuple(map(str, e["legs"]))
    where = f", leg{'s' if len(legs) > 1 else ''} {', '.join(legs)}" if legs else ""
    values = ", ".join(
        f"{name} {v[0]:.4g} [{v[1]:.4g}, {v[2]:.4g}] {v[3]}" for name, v in e["parameters"].items()
    )
    others = len(e["aliases"])
    more = f" (or {others} other place{'s' if others > 1 else ''})" if others else ""
    return Named(
        str(e["kind"]), str(e["element"]), legs, f"{e['kind']} of {e['element']}{where}: {values}{more}"
    )
