"""One number of a machine moved, by its full name and field (docs/machine_files.md)."""

from __future__ import annotations

from dataclasses import replace

from stiffmap.description import Body, Drive, Element, Joint, MachineDescription, Offset, Point, Spring, tree
from stiffmap.description.elements import Matrix6
from stiffmap.description.numbers import numbers_of
from stiffmap.description.pose import Pose, Vector


def moved(description: MachineDescription, key: str, delta: float) -> MachineDescription | None:
    """The machine with the number ``full.name/field`` moved by `delta` (SI).

    A length of an offset moves the machine as built; the controller keeps the nominal one. None: this
    machine has no such number, or none that its description keeps apart (sections of a beam, angles).
    """
    full, _, field = key.partition("/")
    sequence, *path = full.split(".")
    if not path:
        return _moved_external(description, sequence, field, delta)

    def change(element: Element) -> Element | None:
        return _moved_number(element, field, delta)

    return tree.edit(description, full, change)


def number(description: MachineDescription, key: str) -> float | None:
    """The number (SI) under ``full.name/field``; None as in `moved`."""
    full, _, field = key.partition("/")
    if "." in full:
        values = (_value(element, field) for element in tree.find(description, full))
        return next((value for value in values if value is not None), None)
    springs = [s for s in description.external_springs if s.name == full and field in ("stiffness", "length")]
    return getattr(springs[0], field) if springs else None


def _moved_number(element: Element, field: str, delta: float) -> Element | None:
    if _value(element, field) is None:
        return None
    name, _, part = field.rpartition(".")
    match element:
        case Spring():
            matrix = element.compliance if name == "compliance" else element.stiffness
            assert matrix is not None
            entries = _moved_entry(matrix, part, delta)
            if name == "compliance":
                return replace(element, compliance=entries)
            return replace(element, stiffness=entries)
        case Joint() if (n := _declared(element, field)) is not None:
            holder, name = n
            changed = replace(holder, **{name: getattr(holder, name) + delta})
            return changed if isinstance(changed, Joint) else replace(element, drive=changed)
        case Joint():
            assert element.law is not None
            return replace(element, law=replace(element.law, **{part: getattr(element.law, part) + delta}))
        case Body():
            if field == "mass":
                return replace(element, mass=element.mass + delta)
            return replace(element, com=_moved_vector(element.com, part, delta))
        case Point():
            return replace(element, offset=_moved_vector(element.offset, part, delta))
        case Offset():
            real = element.actual or element.nominal
            return replace(element, actual=Pose(_moved_vector(real.translation, part, delta), real.rotation))
    return None


def _value(element: Element, field: str) -> float | None:
    name, _, part = field.rpartition(".")
    match element:
        case Spring() if name in ("compliance", "stiffness") and getattr(element, name) is not None:
            i, j = int(part[1]) - 1, int(part[2]) - 1
            return float(getattr(element, name)[i][j])
        case Joint() if (n := _declared(element, field)) is not None:
            return float(getattr(*n))
        case Joint() if element.law is not None and field in ("stiffness", "law.stiffness", "law.cubic"):
            return float(getattr(element.law, part))
        case Body() if field == "mass":
            return element.mass
        case Body() if name == "com":
            return element.com["xyz".index(part)]
        case Point() if name == "at":
            return element.offset["xyz".index(part)]
        case Offset() if name == "translation" and element.actual is None:
            return element.nominal.translation["xyz".index(part)]
        case Offset() if name == "actual.translation" and element.actual is not None:
            return element.actual.translation["xyz".index(part)]
    return None


def _declared(joint: Joint, key: str) -> tuple[Joint | Drive, str] | None:
    """The number that the joint or its drive declares under a file's key and has: holder and name."""
    for holder in (joint, joint.drive):
        for n in () if holder is None else numbers_of(holder):
            if n.key == key and not n.interval and getattr(holder, n.name) is not None:
                assert holder is not None
                return holder, n.name
    return None


def _moved_entry(matrix: Matrix6, entry: str, delta: float) -> Matrix6:
    i, j = int(entry[1]) - 1, int(entry[2]) - 1
    rows = [list(row) for row in matrix]
    rows[i][j] += delta
    if i != j:
        rows[j][i] += delta
    return tuple(tuple(row) for row in rows)


def _moved_vector(v: Vector, part: str, delta: float) -> Vector:
    out = list(v)
    out["xyz".index(part)] += delta
    return (out[0], out[1], out[2])


def _moved_external(
    description: MachineDescription, name: str, field: str, delta: float
) -> MachineDescription | None:
    if field not in ("stiffness", "length") or name not in [s.name for s in description.external_springs]:
        return None
    springs = tuple(
        replace(s, **{field: getattr(s, field) + delta}) if s.name == name else s
        for s in description.external_springs
    )
    return replace(description, external_springs=springs)
