"""`stiffmap.design_sweep`: a machine with other numbers, many of them."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import Floats, real_array, trailing
from stiffmap.common.errors import StiffmapError
from stiffmap.model.addresses import known_values, with_values
from stiffmap.solve.compiled import Status
from stiffmap.solve.labels import meaning
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.workspace.maps.inputs import axis
from stiffmap.workspace.maps.loading import track

KEPT = ("displacement", "deflection", "compliance", "status")
Evaluate = Callable[[Machine], Mapping[str, float] | float]


@takes_machine
def design_sweep(
    machine: Machine,
    numbers: Mapping[str, ArrayLike],
    *,
    position: ArrayLike | None = None,
    wrench: ArrayLike | None = None,
    evaluate: Evaluate | None = None,
    rotation: ArrayLike | None = None,
    point: str = "tcp",
    gravity: ArrayLike | None = None,
    method: str = "fast",
    threads: int | None = None,
    progress: bool | None = None,
) -> xr.Dataset:
    """How far the machine yields, over any numbers of its design.

    Parameters
    ----------
    numbers
        Address -> axis of values (SI), as `Machine.with_numbers` takes them: ``{"bar/length": [0.3, 0.4]}``. Several addresses
        make a grid. `Machine.numbers` lists addresses.
    position, rotation
        Commanded poses (..., 3) m and (..., 3, 3), base axes; None: home.
    wrench
        (..., 6) N, N·m at `point`; None: none.
    evaluate
        What else is wanted of each machine: a function from a `Machine` to a number, or to a mapping name -> number.
    point, gravity, method, threads
        As in `Machine.solve`.
    progress
        Show a progress bar on standard error; None: where that is a terminal.

    Returns
    -------
    Dataset with one dimension per address (the slash written as a dot, `bar.length`, which files can hold; the address is in its
    attribute ``address``), then those of the poses (``pose``): displacement (…, component) m and rad, deflection (norm of the
    translation, m), compliance (…, component, wrench_component), status; and what `evaluate` returned. A
    machine that cannot be closed with its numbers holds NaN, status UNREACHABLE, and the reason in ``problem``.

    Raises StiffmapError for bad input: an address that the machine has not names the nearest.
    """
    if not isinstance(numbers, Mapping) or not numbers:
        raise StiffmapError("numbers: expected a mapping address -> values with at least one address")
    axes = {address: axis(values, address) for address, values in numbers.items()}
    plain = machine.description.declared or machine.description
    with_values(plain, {a: known_values(plain, a)[0] * (1 - 1e-7 * i) for i, a in enumerate(axes)})
    given = None if position is None else trailing(position, (3,), "position", "positions (m)")
    cells: dict[tuple[int, ...], dict[str, np.ndarray]] = {}
    problems: dict[tuple[int, ...], str] = {}
    every = list(itertools.product(*(range(a.size) for a in axes.values())))
    for index in track(every, len(every), "designs", progress):
        values = {name: float(a[i]) for (name, a), i in zip(axes.items(), index, strict=True)}
        try:
            made = machine.with_numbers(values)
        except StiffmapError as problem:
            problems[index] = str(problem)
            continue
        here = made.description.home.p if given is None else given
        s = made.solve(here, wrench, rotation=rotation, point=point, gravity=gravity, method=method, threads=threads)  # fmt: skip
        cells[index] = {
            "displacement": s.displacement,
            "compliance": s.compliance,
            "status": s.status,
            "deflection": np.linalg.norm(s.displacement[..., :3], axis=-1),
            **_evaluated(evaluate, made),
        }
        same = [{n: a.shape for n, a in c.items()} for c in (cells[index], next(iter(cells.values())))]
        if same[0] != same[1]:
            raise StiffmapError(
                f"evaluate: expected results of the same names and shapes for every machine, got {same[0]} after {same[1]}"
            )
    if not cells:
        first = next(iter(problems.values()))
        raise StiffmapError(f"numbers: no machine can be made of them; the first: {first}")
    return _dataset(machine, axes, cells, problems, s.to_xarray())


def _evaluated(evaluate: Evaluate | None, machine: Machine) -> dict[str, np.ndarray]:
    if evaluate is None:
        return {}
    if not callable(evaluate):
        raise StiffmapError(f"evaluate: expected a function of a machine, got {evaluate!r}")
    found = evaluate(machine)
    more = dict(found) if isinstance(found, Mapping) else {"value": found}
    if taken := sorted(set(more) & {*KEPT, "problem"}):
        raise StiffmapError(f"evaluate: the name '{taken[0]}' is taken; name the result otherwise")
    return {
        name: real_array(1.0 * value if isinstance(value, bool) else value, f"evaluate: {name}", "a number")
        for name, value in more.items()
    }


def _dataset(
    machine: Machine,
    axes: Mapping[str, Floats],
    cells: Mapping[tuple[int, ...], dict[str, np.ndarray]],
    problems: Mapping[tuple[int, ...], str],
    like: xr.Dataset,
) -> xr.Dataset:
    """What `design_sweep` describes; answers have the labels of one machine's, `like`."""
    shape = tuple(a.size for a in axes.values())
    dims = {address: address.replace("/", ".") for address in axes}
    outer = tuple(dims.values())
    first = next(iter(cells.values()))
    data: dict[str, object] = {}
    for name, sample in first.items():
        fill = int(Status.UNREACHABLE) if name == "status" else np.nan
        values = np.full(shape + sample.shape, fill, dtype=sample.dtype)
        for index, cell in cells.items():
            values[index] = cell[name]
        numbered = xr.Variable([f"{name}_{i}" for i in range(sample.ndim)], sample, meaning("", name))
        own = like.get(name, numbered)
        data[name] = ((*outer, *own.dims), values, own.attrs)
    words = np.full(shape, "", dtype=object)
    for index, text in problems.items():
        words[index] = text
    why = meaning("", "why there is no such machine; empty where there is")
    data["problem"] = (outer, words.astype(str), why)
    table = {str(a): str(u) for a, u in machine.numbers()["unit"].items()}
    coords = {dims[a]: (dims[a], v, {"address": a, "units": _unit(table, a)}) for a, v in axes.items()}
    labels = {n: like[n] for n in ("component", "wrench_component")}
    return xr.Dataset(data, coords={**coords, **labels}, attrs={"machine": machine.name})


def _unit(units: Mapping[str, str], address: str) -> str:
    """Unit of an address that is listed, or of the listed ones that end alike; empty where none is."""
    if address.endswith("/length"):
        return "m"
    found = [u for a, u in units.items() if a == address or a.endswith("." + address.removeprefix("*."))]
    return found[0] if found else ""
