"""Inputs of array calls: kinds of numbers and shapes checked by name, broadcast together.

What numpy would turn into a float without a word is refused here, with the argument's name: masks, imaginary parts,
truth values, dates, text, None.
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Collection, Iterable
from decimal import Decimal
from numbers import Real
from operator import index
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stiffmap.common.errors import StiffmapError

Floats = NDArray[np.float64]
Integers = NDArray[np.intp]
Mask = NDArray[np.bool_]
MOST_THREADS = 4096
"""More than any machine has cores, and no more than a system starts."""


KINDS = {
    "b": "truth values", "c": "complex numbers", "m": "spans of time", "M": "dates", "U": "text", "S": "bytes", "T": "text",
    "V": "records",
}  # fmt: skip
"""Kinds of numpy's types that are no real numbers."""


def real_array(values: object, name: str, what: str = "numbers") -> Floats:
    """Float array of real numbers; StiffmapError with the argument's name for anything else."""
    if type(values) is np.ndarray and values.dtype == np.float64:
        return values
    if isinstance(values, list | tuple) and any(
        type(v) is bool for row in values for v in (row if isinstance(row, list | tuple) else (row,))
    ):
        raise refused(name, what, KINDS["b"])  # numpy takes them for numbers where numbers are among them
    if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
        raise refused(
            name, what, f"{int(np.ma.getmaskarray(values).sum())} masked values; fill or leave them out"
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # a masked element in a list
            given = np.asarray(values)
            if given.dtype.kind not in "fiuO":
                raise refused(name, what, KINDS.get(given.dtype.kind, str(given.dtype)))
            if given.dtype.kind == "O":
                wrong = [v for v in given.flat if isinstance(v, bool) or not isinstance(v, Real | Decimal)]
                if wrong:
                    raise refused(name, what, f"{type(wrong[0]).__name__} among them")
            out: Floats = given.astype(np.float64)
            return out
    except StiffmapError:
        raise
    except (TypeError, ValueError, OverflowError, Warning) as problem:
        raise refused(name, what, f"{type(values).__name__} ({problem})") from None


def given_path(value: Any, name: str, what: str = "a file") -> Path:
    """A path; StiffmapError with the argument's name for what is none."""
    try:
        return Path(value)
    except TypeError:
        raise refused(name, what, type(value).__name__) from None


def instance_of(value: object, kind: Any, name: str, what: str) -> Any:
    """The value itself where it is of this kind; else StiffmapError with the argument's name and what is expected."""
    if not isinstance(value, kind):
        raise refused(name, what, repr(value) if isinstance(value, str) else type(value).__name__)
    return value


def names_of(value: Any, name: str, least: int = 0) -> tuple[str, ...]:
    """Different names, of which one may stand by itself; StiffmapError with the argument's name for anything else."""
    given = (value,) if isinstance(value, str) else tuple(instance_of(value, Iterable, name, "names"))
    twice = [n for i, n in enumerate(given) if instance_of(n, str, name, "names") in given[:i]]
    if twice or len(given) < least:
        raise refused(name, "different names", f"{twice[0]!r} twice" if twice else "none")
    return given


def one_of(value: object, known: Collection[str], name: str) -> str:
    """One of these words; StiffmapError with the argument's name and the words for anything else."""
    if not isinstance(value, str) or value not in known:
        raise refused(name, f"one of {', '.join(known)}", repr(value))
    return value


def refused(name: str, what: str, found: str) -> StiffmapError:
    """The error of an argument that is something else than what is expected."""
    return StiffmapError(f"{name}: expected {what}, got {found}")


def real_number(value: object, name: str, what: str = "a number") -> float:
    """One real number; StiffmapError with the argument's name for anything else."""
    out = real_array(value, name, what)
    if out.ndim:
        raise refused(name, what, f"an array of shape {out.shape}")
    return float(out)


def whole_number(value: Any, name: str, least: int, most: int | None = None, what: str = "") -> int:
    """An integer between bounds; StiffmapError with the argument's name for anything else, 1.5 and True included; `what` says
    what is expected in other words."""
    try:
        if isinstance(value, bool | np.bool_):
            raise TypeError
        out = index(value)
    except TypeError:
        raise refused(name, what or f"a whole number, {least} or more", repr(value)) from None
    if out < least or (most is not None and out > most):
        expected = f"{least} or more" if out < least else f"at most {most}"
        raise refused(name, what or expected, str(out))
    return out


def random_numbers(seed: object, *more: int) -> np.random.Generator:
    """The generator of a seed, a whole number of 0 or more; StiffmapError for anything else."""
    number = whole_number(seed, "seed", 0)
    return np.random.default_rng([number, *more] if more else number)


def trailing(values: ArrayLike, shape: tuple[int, ...], name: str, what: str) -> Floats:
    """Float array whose last axes have `shape`; StiffmapError otherwise."""
    out = real_array(values, name, what)
    n = len(shape)
    if out.ndim < n or out.shape[out.ndim - n :] != shape:
        wanted = ", ".join(str(s) for s in shape)
        raise StiffmapError(f"{name}: expected {what} of shape (..., {wanted}), got shape {out.shape}")
    return out


WRENCHES = "wrenches [fx fy fz mx my mz] (N, N·m)"


def wrench_array(values: ArrayLike | None, name: str = "wrench") -> Floats:
    """(..., 6); a bare force is refused, since its moment must be said."""
    if values is None:
        return np.zeros(6)
    given = real_array(values, name, WRENCHES)
    if given.ndim and given.shape[-1] == 3:
        raise StiffmapError(
            f"{name}: expected 6 numbers [fx fy fz mx my mz] (N, N·m), got 3; append the moment, "
            "for a pure force [fx, fy, fz, 0, 0, 0]"
        )
    out = trailing(given, (6,), name, WRENCHES)
    if not np.isfinite(out).all():
        raise StiffmapError(f"{name}: expected finite numbers, got {np.sum(~np.isfinite(out))} that are not")
    return out


def batch(*shapes: tuple[int, ...]) -> tuple[int, ...]:
    """Common batch shape; StiffmapError where they do not broadcast."""
    try:
        return np.broadcast_shapes(*shapes)
    except ValueError:
        raise StiffmapError(f"batch axes do not broadcast together: {', '.join(map(str, shapes))}") from None


def rows(values: Floats, shape: tuple[int, ...], tail: tuple[int, ...]) -> Floats:
    """C-contiguous copy of shape (batch size, *tail)."""
    return np.ascontiguousarray(np.broadcast_to(values, shape + tail)).reshape((math.prod(shape),) + tail)


def thread_count(threads: int | None) -> int:
    """Number of threads: all that this process may use unless said otherwise."""
    if threads is None:
        affinity = getattr(os, "sched_getaffinity", None)
        return len(affinity(0)) if affinity else os.cpu_count() or 1
    return whole_number(threads, "threads", 1, MOST_THREADS)
