"""A copy of the core with every mutant of a sample compiled in, the base level of the kernels only."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

from .mutant import Mutant

COPIED = ("CMakeLists.txt", "cmake", "cpp", "python/bindings", "tests/cpp")
ATTEMPTS = 12


def build(root: Path, folder: Path, wanted: list[Mutant], count: int) -> dict[int, Mutant]:
    """Compiles the first `count` of `wanted` that compile; by their numbers, from one.

    A token is changed without knowing its type, so that some mutants are no C++: their lines are named by the compiler,
    and the next of the sample take their places. Raises RuntimeError where errors remain.
    """
    given = dict(enumerate(wanted, 1))
    known = folder / "no_cpp.json"
    lines = json.loads(known.read_text(encoding="utf-8")) if known.exists() else []
    refused = {n for n, m in given.items() if [m.file, m.before, m.text] in lines}
    taken = [n for n in given if n not in refused][:count]
    for _ in range(ATTEMPTS):
        sources = write(root, folder, {n: given[n] for n in taken})
        errors = compile_all(root, folder)
        if not errors:
            return {n: given[n] for n in taken}
        places = {(str(sources[file]), int(line)) for file, line in PLACE.findall(errors) if file in sources}
        bad = {n for n in taken if (given[n].file, given[n].line) in places}
        if not bad:
            raise RuntimeError(errors[-4000:])
        refused |= bad
        lines = [[given[n].file, given[n].before, given[n].text] for n in sorted(refused)]
        known.write_text(json.dumps(lines), encoding="utf-8")
        taken = [n for n in given if n not in refused][:count]
        print(f"{len(refused)} mutants are no C++", flush=True)
    raise RuntimeError(f"errors remain after {ATTEMPTS} attempts")


PLACE = re.compile(r"(\S+?\.[ch]pp):(\d+):")


def write(root: Path, folder: Path, mutants: dict[int, Mutant]) -> dict[str, str]:
    """Brings the copy up to date, file by file where it differs; by path there, the path in the repository."""
    by_file: dict[str, dict[int, Mutant]] = defaultdict(dict)
    for n, mutant in mutants.items():
        by_file[mutant.file][n] = mutant
    out = {}
    for path in sorted(p for top in COPIED for p in [root / top, *(root / top).rglob("*")] if p.is_file()):
        name = path.relative_to(root).as_posix()
        text = path.read_text(encoding="utf-8")
        target = folder / "source" / name
        target.parent.mkdir(parents=True, exist_ok=True)
        text = mutated(text, by_file.get(name, {}))
        if not target.exists() or target.read_text(encoding="utf-8") != text:
            target.write_text(text, encoding="utf-8")
        out[str(target)] = name
    return out


def mutated(source: str, mutants: dict[int, Mutant]) -> str:
    """A source with several mutants in it, none of which touches another."""
    for n, m in sorted(mutants.items(), key=lambda item: -item[1].start):
        source = source[: m.start] + m.text.replace("@", str(n)) + source[m.end :]
    return source


def compile_all(root: Path, folder: Path) -> str:
    """What the compiler objects to."""
    out = folder / "build"
    bin = Path(sys.executable).parent
    cmake = str(bin / "cmake") if (bin / "cmake").exists() else "cmake"
    flags = f"-O1 -fno-math-errno -w -include {folder / 'source/tests/cpp/mutant.hpp'}"
    subprocess.run(
        [cmake, "-S", folder / "source", "-B", out, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=None"]
        + [f"-DCMAKE_CXX_FLAGS={flags}", f"-DPython_EXECUTABLE={sys.executable}"]
        + [f"-DSTIFFMAP_{key}" for key in ("PYTHON=ON", "TESTS=ON", "HAS_LEVELS=OFF")],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    done = subprocess.run(
        [cmake, "--build", out, "--parallel", "2", "--", "-k", "0"], capture_output=True, text=True
    )
    return done.stdout + done.stderr if done.returncode else ""


def library(folder: Path) -> Path:
    """The Python module of the copy."""
    (found,) = (folder / "build/python/bindings").glob("_core*.so")
    return found


def install(folder: Path, package: Path) -> None:
    """Puts the module into a copy of the Python package."""
    for old in package.glob("_core*.so"):
        old.unlink()
    shutil.copy(library(folder), package)
