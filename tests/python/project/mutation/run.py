"""How many of a sample of small changes to the sources do the fast tests notice?

usage: python -m tests.python.project.mutation.run python|cpp [--count 150] [--seed 26] [--wide] [--out build/mutation]
       [--among FOLDER ...]

C++: the mutants that compile, all built at once (base kernels); the C++ tests first, then pytest. Python: one at a
time in a copy of the package. Fast tests only, those of the mutant's room, with --wide all others for what these miss;
each run ends at the first failure. `--among` takes the mutants in Python of these folders or files below
python/stiffmap only, as `machining/toolpath common/number_text.py`. Prints every survivor; results stand in
OUT/python.jsonl and cpp.jsonl, and a run that was stopped goes on where it was.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import subprocess
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

from . import cpp_sites, python_sites, server
from .cpp_build import build, install
from .mutant import Mutant, shuffled
from .table import all_folders, folders, test_files

ROOT = Path(__file__).parents[4]
PACKAGE = Path("python/stiffmap")
CPU_SECONDS = 400


def main() -> int:
    """Exit code 1 where fewer than 90 % are caught."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("language", choices=("python", "cpp"))
    options.add_argument("--count", type=int, default=150)
    options.add_argument("--seed", type=int, default=26)
    options.add_argument("--wide", action="store_true", help="all fast tests for what those of the room miss")
    options.add_argument(
        "--again", action="store_true", help="survivors of the last run, and those not yet run, only"
    )
    options.add_argument("--among", nargs="+", metavar="FOLDER", default=[""], help="below python/stiffmap")
    options.add_argument("--out", type=Path, default=ROOT / "build/mutation")
    given = options.parse_args()
    out = given.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    server.warm()
    package = copy_of_package(out / given.language)
    results = out / f"{given.language}.jsonl"
    known = read(results)
    caught = 0
    chosen = list(sample(given.language, given.count, given.seed, out, given.among))
    if given.language == "cpp":
        install(out / "cpp", package / "stiffmap")
    with results.open("a", encoding="utf-8") as file:
        for n, mutant in chosen:
            result = known.get(key(mutant))
            if result is None or (given.again and not result["caught"]):
                judge = judge_cpp if given.language == "cpp" else judge_python
                outcome = judge(n, mutant, package, out, given.wide)
                result = {**asdict(outcome), **asdict(mutant), "number": n}
                file.write(json.dumps(result) + "\n")
                file.flush()
            caught += result["caught"]
            if not result["caught"]:
                print(
                    f"survivor {n}: {mutant.file}:{mutant.line}: {mutant.kind}: {mutant.before} | {mutant.text}",
                    flush=True,
                )
    print(
        f"{given.language}: {caught} of {len(chosen)} caught ({100 * caught / len(chosen):.1f} %), seed {given.seed}"
    )
    return int(caught < 0.9 * len(chosen))


def sample(
    language: str, count: int, seed: int, out: Path, among: Sequence[str]
) -> Iterator[tuple[int, Mutant]]:
    """The mutants of a run with their numbers; those in Python below the folders `among` only."""
    if language == "python":
        places = [PACKAGE / folder for folder in among]
        chosen = [m for m in python_sites.mutants_of(ROOT) if any(map(Path(m.file).is_relative_to, places))]
        yield from enumerate(shuffled(chosen, seed)[:count], 1)
        return
    yield from build(ROOT, out / "cpp", shuffled(cpp_sites.mutants_of(ROOT), seed), count).items()


def key(mutant: Mutant) -> tuple[str, str, str, str]:
    """What a mutant is known by, wherever its line moves."""
    return mutant.file, mutant.kind, mutant.text, mutant.before


def read(results: Path) -> dict[tuple[str, str, str, str], dict[str, object]]:
    """The last result of each mutant."""
    if not results.exists():
        return {}
    rows = map(json.loads, results.read_text(encoding="utf-8").splitlines())
    return {(r["file"], r["kind"], r["text"], r["before"]): r for r in rows}


def copy_of_package(folder: Path) -> Path:
    """A folder for PYTHONPATH with the package in it, its module included."""
    target = folder / "package"
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(ROOT / "python", target, ignore=shutil.ignore_patterns("__pycache__", "bindings"))
    return target


def judge_python(n: int, mutant: Mutant, package: Path, out: Path, wide: bool) -> server.Outcome:
    """Writes the mutant into the copy, runs the tests, and takes it back."""
    path = package / Path(mutant.file).relative_to("python")
    source = (ROOT / mutant.file).read_text(encoding="utf-8")
    path.write_text(source[: mutant.start] + mutant.text + source[mutant.end :], encoding="utf-8")
    os.utime(path, (time.time(), 2_000_000_000 + n))  # compiled files are kept by this time and the size
    try:
        return tests_of(mutant, source, package, out, wide, {})
    finally:
        path.write_text(source, encoding="utf-8")
        os.utime(path, (time.time(), 1_900_000_000 + n))


def judge_cpp(n: int, mutant: Mutant, package: Path, out: Path, wide: bool) -> server.Outcome:
    """The C++ tests, then those in Python."""
    begun = time.monotonic()
    environment = {"STIFFMAP_MUTANT": str(n)}

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (60, 65))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

    tests = out / "cpp/build/tests/cpp/stiffmap_tests"
    done = subprocess.run(
        [tests],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        preexec_fn=limit,
        check=False,
    )
    if done.returncode:
        return server.Outcome(True, "C++ tests", time.monotonic() - begun)
    return tests_of(mutant, "", package, out, wide, environment)


def tests_of(
    mutant: Mutant, source: str, package: Path, out: Path, wide: bool, environment: dict[str, str]
) -> server.Outcome:
    """The tests of the mutant's room, or all, up to the first failure of one that passes without a mutant."""
    chosen = all_folders(mutant.file) if wide else folders(mutant.file)
    tests = test_files(mutant.file, source, mutant.start, chosen)
    known = out / "without_a_mutant.json"
    passes: dict[str, bool] = json.loads(known.read_text(encoding="utf-8")) if known.exists() else {}
    while True:
        unfit = [f"--deselect={name}" for name, passed in passes.items() if not passed]
        outcome = server.run(package, tests, out / "pytest.log", CPU_SECONDS, environment, "-x", *unfit)
        name = outcome.by
        if not outcome.caught or "::" not in name or passes.get(name):
            return outcome
        alone = server.run(copy_of_package(out / "unchanged"), [name], out / "unchanged.log", CPU_SECONDS, {})
        passes[name] = not alone.caught
        known.write_text(json.dumps(passes), encoding="utf-8")
        if passes[name]:
            return outcome
        print(f"fails without a mutant: {name}", flush=True)


if __name__ == "__main__":
    raise SystemExit(main())
