"""The driver itself: what it changes, what it leaves alone, and that a sample depends on its seed only."""

from __future__ import annotations

import ast

from .cpp_build import mutated
from .cpp_sites import sites as cpp_sites
from .mutant import Mutant, shuffled
from .python_sites import sites as python_sites
from .run import ROOT
from .table import all_folders, folders

CPP = """
// a - b in a comment
constexpr double small = 1e-9;
double f(double a, double b) {
  require(a > 0, "a", "a - b", a);
  for (int i = 0; i < 3; ++i) a += 2.0 * b;
  return a - b > small ? -a : std::min(a, b);
}
"""
PYTHON = '''
def f(a: float, b: float) -> float:
    """a - b."""
    if a < 0:
        raise ValueError(f"{a - b}")
    return g(a, b) - 2.5 * min(a, b) if a > 1e-9 else -a
'''


def applied(source: str, mutants: list[Mutant]) -> set[tuple[str, str]]:
    """Kind and line of each mutated source, without its number."""
    out = set()
    for m in mutants:
        changed = source[: m.start] + m.text + source[m.end :]
        (line,) = set(changed.splitlines()) - set(source.splitlines())
        out.add((m.kind, line.strip()))
    return out


def test_cpp() -> None:
    got = applied(CPP, list(cpp_sites(CPP, "f.cpp")))
    assert got == {
        ("threshold", "constexpr mutant::Number small{@, 1e-9, 1e-06};"),
        ("sign", "for (int i = 0; i < 3; ++i) a += mutant::sign(@) * (2.0 * b);"),
        ("dropped term", "for (int i = 0; i < 3; ++i) a += mutant::drop(@) * (2.0 * b);"),
        ("factor", "for (int i = 0; i < 3; ++i) a += 2.0 * mutant::twice(@) * b;"),
        ("factor", "for (int i = 0; i < 3; ++i) a += mutant::number(@, 2.0, 4.0) * b;"),
        ("sign", "return a - mutant::sign(@) * b > small ? -a : std::min(a, b);"),
        ("dropped term", "return a - mutant::drop(@) * b > small ? -a : std::min(a, b);"),
        ("comparison", "return a - b > mutant::Compare{@} > small ? -a : std::min(a, b);"),
        ("sign", "return a - b > small ? mutant::minus(@) * a : std::min(a, b);"),
        ("comparison", "return a - b > small ? -a : mutant::minimum<@>(a, b);"),
    }


def test_python() -> None:
    got = applied(PYTHON, list(python_sites(PYTHON, "f.py")))
    assert got == {
        ("sign", "return (g(a, b) + (2.5 * min(a, b))) if a > 1e-9 else -a"),
        ("dropped term", "return (g(a, b)) if a > 1e-9 else -a"),
        ("factor", "return g(a, b) - (2.5 / min(a, b)) if a > 1e-9 else -a"),
        ("factor", "return g(a, b) - 5.0 * min(a, b) if a > 1e-9 else -a"),
        ("comparison", "return g(a, b) - 2.5 * max(a, b) if a > 1e-9 else -a"),
        ("comparison", "return g(a, b) - 2.5 * min(a, b) if (a <= 1e-9) else -a"),
        ("threshold", "return g(a, b) - 2.5 * min(a, b) if a > 1e-06 else -a"),
        ("sign", "return g(a, b) - 2.5 * min(a, b) if a > 1e-9 else (a)"),
        ("swapped arguments", "return g(b, a) - 2.5 * min(a, b) if a > 1e-9 else -a"),
    }
    for _, line in got:
        ast.parse(line)


def test_a_sample_depends_on_its_seed_only_and_no_two_touch() -> None:
    every = list(cpp_sites(CPP, "f.cpp"))
    once, again = shuffled(every, 5), shuffled(reversed(every), 5)
    assert once == again != shuffled(every, 6)
    for i, a in enumerate(once):
        assert all(a.end < b.start or b.end < a.start for b in once[:i])
    many = dict(enumerate(once, 1))
    source = mutated(CPP, many)
    assert source.count("\n") == CPP.count("\n")  # the compiler's line numbers are those of the source
    assert all(
        source.count(f"({n})") + source.count(f"({n},") + source.count(f"{{{n}") + source.count(f"<{n}>")
        for n in many
    )


def test_every_room_has_tests() -> None:
    assert folders("python/stiffmap/model/effects/library/links.py")[0] == "model/effects"
    assert folders("python/stiffmap/solve/budget.py")[0] == "solve"
    everything = {
        f for file in ("python/stiffmap/ui/cli/app.py", "cpp/src/model/law.cpp") for f in folders(file)
    }
    assert all(any((ROOT / "tests/python" / f).glob("test_*.py")) for f in everything)
    assert set(folders("cpp/src/model/law.cpp")) < set(all_folders("cpp/src/model/law.cpp"))
