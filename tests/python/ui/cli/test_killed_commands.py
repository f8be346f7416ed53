"""Every command that writes, killed at one of its renames, and twice at once: what stands there is whole, and the same
command then ends as if nothing had happened.

Run as a program (name of a command, folder) this file does it in processes of its own, which never ran a thread before.
"""

from __future__ import annotations

import importlib
import json
import os
import shlex
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import matplotlib
import pytest

ROOT = Path(__file__).parents[4]
KR210, TAPS = (shlex.quote(str(ROOT / "examples/taps" / n)) for n in ("kr210.yaml", "taps.csv"))
DESIGN = """
name: small
machine: orthoglide-revised
variables: {carriage: {low: 1, high: 9}}
numbers: {"templates.leg.body[carriage].mass": carriage}
objectives: [mass]
search: {population: 4, generations: 1, seed: 4, nodes: 2}
"""
BAR = "units: {length: mm}\npart: {shape: bar, length: 300, width: 30, height: 30}\nmaterial: steel\n"
COMMANDS = {
    "map": "map orthoglide-revised --points 3 --z 0 -o out",
    "mill": "mill orthoglide-revised circle --size 20 --process trimming --at 50,50,0 --step 20 -o out",
    "sweep": "sweep orthoglide-revised --at 0,0,0 --direction 1,0,0 --to 300 --points 3 -o out",
    "diagnose": "diagnose five-bar measured -o out",
    "calibrate": "calibrate five-bar measured -o out",
    "optimize": "optimize small.yaml --processes 1 -o out",
    "plan": "plan orthoglide-revised --identify 'compliance actuator x scale=1' --rows 4 -o out.csv",
    "link": "link bar.yaml --size 15 --out out.yaml",
    "taps": f"taps {KR210} {TAPS} --only compliance -o out",
    "view": "view orthoglide-revised --at 0,0,0 --html out.html",
}


@pytest.mark.skipif(not hasattr(os, "fork"), reason="kills processes")
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] if n != "sweep" else []) for n in COMMANDS]
)
def test_killed_or_twice_at_once_nothing_is_half_written(name: str, tmp_path: Path) -> None:
    for package in {"link": ["skfem", "gmsh"], "optimize": ["pymoo"]}.get(name, []):
        pytest.importorskip(package)
    alone = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "XDG_CACHE_HOME": str(tmp_path / "cache")}
    alone |= {"MPLCONFIGDIR": matplotlib.get_cachedir()}  # its list of fonts takes seconds
    done = subprocess.run(
        [sys.executable, "-B", __file__, name, str(tmp_path / "work")],
        check=False, capture_output=True, text=True, env=alone,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, "whole\n"), done.stderr[-3000:]


def _started(arguments: list[str], kill_at: int | None = None) -> int:
    """A process that runs the command and dies before its rename of that number; its rename count stands in ``count``."""
    child = os.fork()
    if child:
        return child
    from stiffmap.ui.cli import main

    sink = os.open(os.devnull, os.O_WRONLY)
    os.dup2(sink, 1)
    rename, count = os.replace, 0

    def counted(source: str, target: str) -> None:
        nonlocal count
        if Path(target).resolve().is_relative_to(Path.cwd()):
            if count == kill_at:
                os.kill(os.getpid(), signal.SIGKILL)
            count += 1
        rename(source, target)

    os.replace = os.rename = counted
    code = main(arguments)
    if kill_at is None and code != 2:  # the one of two that was refused wrote nothing
        Path("../count").write_text(str(count))
        Path("../modules").write_text("\n".join(sys.modules))
    os._exit(code)


def _files() -> dict[str, Path]:
    return {str(p): p for p in Path().rglob("*") if p.is_file()}


def _whole(path: Path, complete: int) -> bool:
    """Whether a file of a killed command is complete: by its form; by its lines where its form has no end."""
    import netCDF4

    if path.suffix == ".json":
        json.loads(path.read_text())
    elif path.suffix == ".nc":
        netCDF4.Dataset(path).close()
    elif path.suffix == ".png":
        return path.read_bytes()[-8:-4] == b"IEND"
    elif path.suffix == ".html":
        return path.read_text().rstrip().endswith("</html>")
    elif path.suffix in (".csv", ".txt", ".yaml", ".ngc"):
        return len(path.read_text().splitlines()) == complete
    return path.stat().st_size > 0


def _lines(path: Path) -> int:
    return len(path.read_bytes().decode("latin-1").splitlines())


def _quicker(name: str) -> None:
    """The same files with less in them: figures are empty, a design is measured at few poses."""
    if name == "diagnose":
        import stiffmap.ui.report.diagnosis.pictures as pictures
        from stiffmap.ui.plot.style import new_figure

        pictures.drawn = lambda *_: new_figure(1, 1)
    if name == "optimize":
        from stiffmap.workspace.design import chosen, judging

        judging.ROUNDS, judging.RADII = 1, (0.1,)
        chosen.measured.__defaults__ = (3, 2)  # nodes, draws
        chosen.robustness = lambda *_, **__: None


def _tried(name: str, folder: Path) -> None:
    import distributed  # noqa: F401 - here once, not in each process
    import scipy.optimize  # noqa: F401

    import stiffmap.ui.cli.app as app
    import stiffmap.ui.plot  # noqa: F401

    app.load(next(c for c in app.COMMANDS if c.name == name))
    _quicker(name)
    arguments = shlex.split(COMMANDS[name])
    folder.mkdir()
    os.chdir(folder)
    Path("small.yaml").write_text(DESIGN)
    Path("bar.yaml").write_text(BAR)
    if name in ("diagnose", "calibrate"):
        simulate = shlex.split("simulate five-bar --poses 4 -o measured")
        assert os.waitstatus_to_exitcode(os.waitpid(_started(simulate), 0)[1]) == 0
    given = set(_files())

    def run(kill_at: int | None = None) -> int:
        return os.waitstatus_to_exitcode(os.waitpid(_started(arguments, kill_at), 0)[1])

    codes = [
        os.waitstatus_to_exitcode(os.waitpid(p, 0)[1]) for p in (_started(arguments), _started(arguments))
    ]
    code = min(codes)
    assert code in (0, 1) and set(codes) <= {code, 2}, codes
    complete = {n: _lines(p) for n, p in _files().items() if n not in given}
    count = int(Path("../count").read_text())
    for module in Path("../modules").read_text().split():  # here once, not in each process
        with suppress(Exception):
            importlib.import_module(module)
    assert complete and count, "the command wrote nothing"
    assert all(_whole(Path(n), lines) for n, lines in complete.items())
    for name_ in complete:
        Path(name_).unlink()
    assert run(count // 2) == -signal.SIGKILL
    shown = {n: p for n, p in _files().items() if n not in given and not _hidden(n)}
    assert set(shown) <= set(complete), set(shown) - set(complete)
    assert all(_whole(p, complete[n]) for n, p in shown.items())
    assert run() == code
    assert {n for n in _files() if n not in given} == set(complete), _files()
    print("whole")


def _hidden(name: str) -> bool:
    return any(part.startswith(".") or part.endswith(".partial") for part in Path(name).parts)


if __name__ == "__main__":
    _tried(sys.argv[1], Path(sys.argv[2]))
