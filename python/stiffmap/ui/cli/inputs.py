"""Values of options that several commands share: mm, N, N·mm and deg become SI here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import typer

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import StiffmapError
from stiffmap.common.number_text import number_in, place_text
from stiffmap.common.tables.table_file import TableFile
from stiffmap.model.effects import apply_records, parse_effect
from stiffmap.solve.machine import Machine, load_machine

MM = 1e-3


def numbers(text: str, name: str, count: int | None = None) -> Floats:
    """Finite numbers, separated by commas or blanks."""
    expected = {None: "numbers", 1: "a number"}.get(count, f"{count} numbers")
    try:
        out = np.array([number_in(part) for part in text.replace(",", " ").split()])
    except ValueError:
        raise StiffmapError(
            f"--{name}: expected {expected} without units, such as {'100' if count == 1 else '100,0,-50'}; got '{text}'"
        ) from None
    if (count is not None and out.size != count) or not out.size:
        raise StiffmapError(f"--{name}: expected {expected} separated by commas, got '{text}'")
    if not np.isfinite(out).all():
        raise StiffmapError(f"--{name}: expected finite numbers, got '{text}'")
    return out


def in_si(given: str | float | None, name: str = "", count: int | None = None, unit: float = MM) -> Any:
    """A number or the numbers of a text times their unit (mm where nothing else is said); None where nothing is given."""
    if given is None:
        return None
    return unit * (numbers(given, name, count) if isinstance(given, str) else given)


def percent(text: str, name: str, count: int | None = None) -> Floats:
    """Ratios given in %, the sign with them or not: what is below 0.1 without it may as well be a ratio (0.02 for 2 %)."""
    out = numbers(text.replace("%", " "), name, count)
    if not ((out > 0) & (out < 100) & ((out >= 0.1) | ("%" in text))).all():
        expected = "% above 0 and below 100, such as 2; below 0.1 with the sign: 0.02% (0.02 may be a ratio)"
        raise StiffmapError(f"--{name}: expected {expected}; got '{text}'")
    return out / 100


def words(text: str | None) -> list[str] | None:
    """What stands between commas; None where nothing is given."""
    return None if text is None else [part.strip() for part in text.split(",")]


def words_of_all(texts: Sequence[str] | None) -> list[str]:
    """What stands between the commas of an option that may be repeated."""
    return [word for text in texts or () for word in words(text) or ()]


PAIRS = {
    "map": "x='X pos'", "unit": "x=um", "record": "operator=Miller", "set": "z=0", "noise": "dx=0.03", "offset": "G54=0,0,100",
}  # fmt: skip
"""What may stand behind an option of names and values."""


def pairs(given: Sequence[str] | None, name: str) -> dict[str, str]:
    """The values of NAME=VALUE by their names."""
    out = {}
    for text in given or []:
        key, equals, value = text.partition("=")
        if not equals or not value or key.strip() in out:
            expected = f"NAME=VALUE, such as --{name} {PAIRS[name]}, each name once"
            raise StiffmapError(f"--{name}: expected {expected}; got '{text}'")
        out[key.strip()] = value.strip()
    return out


def as_table(
    path: Any, columns: Sequence[str] | None, units: Sequence[str] | None, header: str | None, **more: Any
) -> TableFile:
    """The file of a table with what options say of it."""
    if path is None:
        raise StiffmapError("--map, --unit, --sheet, --header, --table: only with a table")
    names = words(header) or ()
    return TableFile(path, columns=pairs(columns, "map"), units=pairs(units, "unit"), header=names, **more)


def position(text: str | None, machine: Machine) -> Floats:
    """A TCP position given in mm, in m: all three coordinates or those that the machine commands, the others as at home;
    the home position where none is given. StiffmapError for another value of what is not commanded."""
    home, task = machine.description.home.p, machine.description.task
    if text is None:
        return home
    commanded = [i for i, axis in enumerate("xyz") if axis in task]
    few = len(text.replace(",", " ").split()) == len(commanded)
    given = MM * numbers(text, "at", len(commanded) if few else 3)
    if few:
        out = home.copy()
        out[commanded] = given
        return out
    for i in {0, 1, 2} - set(commanded):
        if abs(given[i] - home[i]) > 1e-6 * MM:
            raise StiffmapError(
                f"--at: {machine.name} does not command {'xyz'[i]}, which is {home[i] / MM:g} mm at home; got "
                f"{given[i] / MM:g} (commanded: {', '.join(task)})"
            )
    return given


def position_words(at: Floats, machine: Machine) -> str:
    """``at (0, 400, 0) mm; not commanded: z``."""
    others = [axis for axis in "xyz" if axis not in machine.description.task]
    words = f"at {place_text(at)}"
    return f"{words}; not commanded: {', '.join(others)}" if others else words


def rotation(text: str | None) -> Any:
    """A rotation matrix from a rotation vector in deg, or None."""
    if text is None:
        return None
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(numbers(text, "rotation", 3), degrees=True).as_matrix()


def gravity(text: str | None) -> Any:
    """Gravity as given, or None."""
    return in_si(text, "gravity", 3, 1.0)


def force_given(text: str) -> tuple[float, Floats | None]:
    """``300``: a size in N, in any direction. ``300,0,0``: a vector in N, base axes, with its size."""
    given = numbers(text, "force")
    if given.size not in (1, 3):
        raise StiffmapError(
            f"--force: expected a size, such as 300, or a vector, such as 300,0,0; got '{text}'"
        )
    if given.size == 1 and given[0] <= 0:
        raise StiffmapError(f"--force: a size is a positive number (a direction takes three); got '{text}'")
    return float(np.linalg.norm(given)), given if given.size == 3 else None


def machine_at(
    name: str,
    effects: Sequence[str] | None,
    at: str | None,
    turned: str | None = None,
    acting: str | None = None,
) -> tuple[Machine, Floats, dict[str, Any]]:
    """A machine with effects, its commanded position, and rotation and gravity as keywords."""
    machine = machine_with(name, effects)
    return machine, position(at, machine), {"rotation": rotation(turned), "gravity": gravity(acting)}


def machine_with(name: str, effects: Sequence[str] | None) -> Machine:
    """A machine with effects added."""
    machine = load_machine(name)
    if not effects:
        return machine
    records = [parse_effect(text, machine.description) for text in effects]
    return Machine(apply_records(machine.description, records))


def refuse_unused(context: typer.Context, unused: Mapping[str, str]) -> None:
    """StiffmapError for an option that is given and not used: ``{"with taps": "rows noise"}``, ``{"without until": "twin"}``."""
    flags, given = flags_of(context), options_given(context)
    for case, names in unused.items():
        word, _, other = case.partition(" ")
        if bool(context.params[other]) != (word == "with"):
            continue
        for name in names.split():
            if name in given:
                raise StiffmapError(f"{flags[name]}: not {word} {flags[other]}")


def flags_of(context: typer.Context) -> dict[str, str]:
    """How the parameters of a command are written, by their names."""
    return {p.name or "": max(p.opts, key=len) for p in context.command.params}


def options_given(context: typer.Context) -> list[str]:
    """The parameters whose value the command line gives, be it that of the default."""
    source = context.get_parameter_source
    return [n for n in flags_of(context) if getattr(source(n), "name", "") == "COMMANDLINE"]
