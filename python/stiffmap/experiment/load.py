"""Reading an experiment folder."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from stiffmap.errors import FileError
from stiffmap.experiment.experiment import AXES, BRANCHES, WRENCH, Experiment, Floats, Integers, Loop
from stiffmap.experiment.schema import ExperimentFile, NoiseModel
from stiffmap.experiment.table import Table, read_table
from stiffmap.experiment.units import Scales
from stiffmap.files.report import file_error
from stiffmap.files.yaml_text import Document, read

PLAIN = ("id", "x", "y", "z", "repeat", "order", "temperature", "branch", "setup")
ROTATION = ("rotx", "roty", "rotz")
NOISE = tuple(f"u_{a}" for a in AXES)
KNOWN = (*PLAIN, *ROTATION, *WRENCH, *AXES, *NOISE)


def load_experiment(path: str | PathLike[str]) -> Experiment:
    """Experiment from a folder with ``experiment.yaml`` and its CSV file, or from the YAML file.

    Raises `FileError` naming file, row, column or key, what was expected and what was found.
    """
    place = Path(path)
    file = place / "experiment.yaml" if place.is_dir() else place
    if not file.is_file():
        raise FileError(
            "there is no such experiment (expected a folder with experiment.yaml)", file=str(place)
        )
    document = read(file)
    model = _validate(document, str(file))
    scales = Scales.of(model, str(file))
    table = _rename(read_table(file.parent / model.data), model.columns)
    _known_columns(table)
    return _assemble(model, table, scales, file)


def _validate(document: Document, file: str) -> ExperimentFile:
    if not isinstance(document.data, dict):
        raise FileError("an experiment file is a mapping with machine, quantity and units", file=file)
    try:
        return ExperimentFile.model_validate(document.data)
    except ValidationError as error:
        raise file_error(error, document, file) from error


def _rename(table: Table, columns: dict[str, str]) -> Table:
    """Header with the file's own names replaced: ``columns: {dx: DEFL_X}``."""
    back = {theirs: ours for ours, theirs in columns.items()}
    for theirs in back:
        table.text(theirs)
    return Table(table.file, tuple(back.get(c, c) for c in table.header), table.rows, table.lines)


def _known_columns(table: Table) -> None:
    for column in table.header:
        if column not in KNOWN:
            raise FileError(f"unknown column '{column}'; known: {', '.join(KNOWN)}", file=table.file, line=1)


def _assemble(model: ExperimentFile, table: Table, scales: Scales, file: Path) -> Experiment:
    for column in (*AXES[3:], *NOISE[3:]):
        if column in table:
            scales.angle(column)
    reading = scales.motion * _block(table, AXES, blank=True)
    if not np.isfinite(reading).any():
        raise FileError("missing column: no reading (dx, dy, dz, rx, ry, rz) in the file", file=table.file)
    wrench = _wrench(model, table, scales)
    position = scales.length * np.column_stack([table.numbers(c) for c in "xyz"])
    sigma = _sigma(model, table, scales, reading)
    return Experiment(
        name=file.parent.name if file.name == "experiment.yaml" else file.stem,
        machine=model.machine,
        quantity=model.quantity,
        ids=_ids(table),
        position=position,
        wrench=wrench,
        reading=reading,
        sigma=sigma,
        rotation=_rotation(table, scales),
        repeat=_whole(table, "repeat"),
        order=table.numbers("order") if "order" in table else None,
        temperature=table.numbers("temperature") if "temperature" in table else None,
        reference_temperature=model.reference_temperature,
        branch=_branch(table),
        setup=tuple(table.text("setup")) if "setup" in table else (),
        point=model.point,
        load_point=model.load_point or model.point,
        gravity=None if model.gravity is None else (model.gravity[0], model.gravity[1], model.gravity[2]),
        zero_sigma=np.nan_to_num(_declared(model.zero_noise, scales)),
        unloaded=model.unloaded,
        frame=model.frame,
        loop=Loop(**model.metrology.model_dump()),
        title=model.title,
        source=str(file),
    )


def _block(table: Table, names: tuple[str, ...], *, blank: bool, missing: float = np.nan) -> Floats:
    n = len(table.rows)
    return np.column_stack(
        [table.numbers(c, blank=blank) if c in table else np.full(n, missing) for c in names]
    )


def _wrench(model: ExperimentFile, table: Table, scales: Scales) -> Floats:
    given = [c for c in WRENCH if c in table]
    if model.quantity == "deflection" and not given:
        raise FileError("missing column: a deflection needs a load (fx, fy, fz, mx, my, mz)", file=table.file)
    return np.asarray(scales.wrench(given) * _block(table, WRENCH, blank=False, missing=0.0))


def _declared(noise: NoiseModel, scales: Scales) -> Floats:
    values = [getattr(noise, a) for a in AXES]
    return np.asarray(scales.motion * np.array([np.nan if v is None else v for v in values]))


def _sigma(model: ExperimentFile, table: Table, scales: Scales, reading: Floats) -> Floats:
    own = scales.motion * _block(table, NOISE, blank=True)
    if np.any(own < 0):
        row = int(np.flatnonzero((own < 0).any(axis=1))[0])
        raise FileError("a standard deviation is negative", file=table.file, line=table.lines[row])
    sigma = np.where(np.isfinite(own), own, _declared(model.noise, scales))
    return np.where(np.isfinite(reading), sigma, np.nan)


def _ids(table: Table) -> tuple[str, ...]:
    if "id" not in table:
        return tuple(str(i + 1) for i in range(len(table.rows)))
    seen: dict[str, int] = {}
    for name, line in zip(table.text("id"), table.lines, strict=True):
        if name in seen:
            raise FileError(
                f"column 'id': '{name}' occurs twice (first in line {seen[name]})", file=table.file, line=line
            )
        seen[name] = line
    return tuple(seen)


def _whole(table: Table, column: str) -> Integers | None:
    if column not in table:
        return None
    values = table.numbers(column)
    wrong = np.flatnonzero(values != np.round(values))
    if wrong.size:
        raise FileError(
            f"column '{column}': expected whole numbers", file=table.file, line=table.lines[wrong[0]]
        )
    return values.astype(np.intp)


def _branch(table: Table) -> tuple[str, ...]:
    if "branch" not in table:
        return ()
    cells = table.text("branch")
    for cell, line in zip(cells, table.lines, strict=True):
        if cell not in BRANCHES:
            raise FileError(
                f"column 'branch': expected loading or unloading; found '{cell}'", file=table.file, line=line
            )
    return tuple(cells)


def _rotation(table: Table, scales: Scales) -> Floats | None:
    """Commanded orientation from a rotation vector in base axes, against home."""
    if not any(c in table for c in ROTATION):
        return None
    vectors = scales.angle(ROTATION[0]) * _block(table, ROTATION, blank=False, missing=0.0)
    return np.ascontiguousarray(Rotation.from_rotvec(vectors).as_matrix())
