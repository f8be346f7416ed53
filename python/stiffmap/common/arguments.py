"""Arguments of public calls against their annotations, before anything is computed; arrays are checked by the calls."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache, wraps
from inspect import signature, unwrap
from math import isnan
from os import PathLike
from types import NoneType, SimpleNamespace, UnionType
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

from stiffmap.common.broadcasting import real_number, refused, whole_number
from stiffmap.common.errors import StiffmapError

Test = tuple[Callable[[Any], bool], str]
F = TypeVar("F", bound=Callable[..., Any])
NAMES: Test = (lambda v: isinstance(v, Iterable) and getattr(v, "dtype", np.dtype(str)).kind in "OU", "names")
PLAIN: dict[Any, Test] = {
    Sequence[str]: NAMES,
    tuple[str, ...]: NAMES,
    Mapping[str, str]: (
        lambda v: isinstance(v, Mapping) and {*map(type, v.values())} <= {str},
        "a mapping to texts",
    ),
    Iterable[object]: (lambda v: isinstance(v, Iterable), "several"),
    bool: (lambda v: isinstance(v, bool | np.bool_), "True or False"),
    int: (lambda v: whole_number(v, "", v) == v, "a whole number"),
    float: (lambda v: not isnan(real_number(v, "")), "a number"),
    str: (lambda v: isinstance(v, str), "text"),
    NoneType: (lambda v: v is None, ""),
    Callable: (callable, "a function"),
    Mapping: (lambda v: isinstance(v, Mapping), "a mapping"),
    PathLike: (lambda v: isinstance(v, PathLike), "a path"),
}


def checked(function: F) -> F:
    """The function, with its arguments checked first."""
    tests = cache(lambda: _tests_of(function))

    @wraps(function)
    def call(*args: Any, **options: Any) -> Any:
        for name, value in [*zip(tests(), args, strict=False), *options.items()]:
            known = tests().get(name)
            if known and not any(_fits(test, value) for test, _ in known):
                found = repr(value) if isinstance(value, str | float | int | None) else type(value).__name__
                raise refused(name, " or ".join(words for _, words in known if words), found)
        return function(*args, **options)

    return cast(F, call)


def _fits(test: Callable[[Any], bool], value: Any) -> bool:
    with suppress(StiffmapError):
        return test(value)
    return False


def _tests_of(function: Callable[..., Any]) -> dict[str, list[Test]]:
    """Every argument in its order, and what it may be; nothing where its annotation, perhaps another module's, does not say that."""
    out: dict[str, list[Test]] = {}
    names = {"ArrayLike": object} | globals() | unwrap(function).__globals__
    for p in signature(function).parameters.values():
        out[p.name] = []
        with suppress(NameError, LookupError):  # known to type checkers only, or an array
            hint = get_type_hints(SimpleNamespace(__annotations__={"": p.annotation}), names)[""]
            out[p.name] = [] if p.name == "machine" else list(_tests(hint))  # judged where it is loaded
    return out


def _tests(hint: Any) -> Iterator[Test]:
    """A test for each kind of value that the annotation allows; LookupError for one that none can judge."""
    origin, inner = get_origin(hint) or hint, get_args(hint)
    if origin in (Union, UnionType):
        for part in inner:
            yield from _tests(part)
    elif origin is Literal:
        yield lambda v: isinstance(v, str) and v in inner, " or ".join(map(repr, inner))
    elif getattr(origin, "__module__", "").partition(".")[0] in (
        "stiffmap",
        "xarray",
        "pandas",
        "matplotlib",
    ):
        yield lambda v: isinstance(v, origin), f"a{'n' * (origin.__name__[0] in 'AEIOU')} {origin.__name__}"
    elif origin is Sequence and hint not in (Sequence[float], Sequence[str]):  # arrays are numbers too
        of = [*_tests(*inner)]
        each = f"several, each {' or '.join(words for _, words in of)}"
        yield lambda v: isinstance(v, Collection) and all(any(_fits(t, e) for t, _ in of) for e in v), each
    else:
        yield PLAIN.get(hint) or PLAIN[origin]
