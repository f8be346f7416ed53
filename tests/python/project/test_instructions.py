"""No illegal instruction: what every processor runs holds no AVX, and the module works on an emulated old processor."""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from stiffmap import _core

NEWER = re.compile(
    r"%[yz]mm\d|%k[1-7]\b|\tv[a-z0-9]+ .*%xmm|\t(?:andn|bextr|bls[ir]|blsmsk|bzhi|mulx|p(?:dep|ext)|rorx|s[ah][lr]x|lzcnt|movbe)[lqbw]? "
)
"""Registers and instructions of AVX, FMA, AVX-512, BMI: none of them in x86-64-v2."""
x86 = pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="a processor of another kind")


def libraries() -> dict[str, Path]:
    """The compiled module and the kernels that it loads, by their short names."""
    module = Path(_core.__file__).resolve()
    told = subprocess.run(["ldd", module], capture_output=True, text=True, check=True).stdout
    kernels = re.findall(r"libstiffmap_kernel_(\w+)\.so => (\S+)", told)
    return {"module": module, **{name: Path(path) for name, path in kernels}}


def newer_instructions(library: Path) -> list[str]:
    """Lines of the disassembly that a processor of 2009 can't run."""
    run = subprocess.run(
        ["objdump", "-d", "--no-show-raw-insn", library], capture_output=True, text=True, check=True
    )
    return [line for line in run.stdout.splitlines() if NEWER.search(line)]


@x86
@pytest.mark.skipif(not (shutil.which("objdump") and shutil.which("ldd")), reason="objdump or ldd is missing")
def test_only_the_kernels_of_a_level_hold_its_instructions() -> None:
    found = libraries()
    assert {"module", "base", "v3", "v4"} <= set(found)
    for name in ("module", "base"):
        lines = newer_instructions(found[name])
        assert not lines, f"{found[name].name} holds {len(lines)} newer instructions, such as {lines[0]}"
    assert len(newer_instructions(found["v3"])) > 1000  # the pattern finds what it looks for


MAP = """
import numpy as np, stiffmap as sm
from stiffmap import _core
assert _core.kernel_levels() == ["base"], _core.kernel_levels()
machine = sm.load_machine("orthoglide-revised")
axis = np.linspace(-0.2, 0.3, 3)
ds = sm.error_map(machine, x=axis, y=axis, z=[0.0], wrench=[300.0, 0, 0, 0, 0, 0])
print(" ".join(float(v).hex() for v in ds.deflection.values.ravel()))
"""


@x86
@pytest.mark.skipif(not shutil.which("qemu-x86_64"), reason="qemu-user is missing")
def test_an_old_processor_makes_the_map(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nehalem, 2008: the oldest that NumPy runs on."""
    places = [p for p in sys.path if p]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(places), "OPENBLAS_NUM_THREADS": "1"}
    python = Path(sys.executable).resolve()
    said = [
        subprocess.run(
            [*before, python, "-c", text], capture_output=True, text=True, env=environment | more, check=True
        ).stdout
        for before, text, more in (
            (["qemu-x86_64", "-cpu", "Nehalem"], MAP, {}),
            ([], re.sub(r"assert.*\n", "\n", MAP), {"STIFFMAP_ISA": "base"}),
        )
    ]
    assert said[0] == said[1]
    assert len(said[0].split()) == 9
