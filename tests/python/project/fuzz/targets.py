"""What is fuzzed: the seeds of each kind of file, and what a user's command does with it."""

from __future__ import annotations

import atexit
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import stiffmap as sm
from stiffmap.common.tables.sheet import read_sheet
from stiffmap.experiment import load_experiment
from stiffmap.experiment.spreadsheet.answers import Answers, Meant
from stiffmap.experiment.spreadsheet.convert import understand, write_folder
from stiffmap.machining.toolpath import load_path, outline_text, sampled
from stiffmap.model.link.linkfile import load_link
from stiffmap.model.link.readers import read_field
from stiffmap.model.urdf.importing import import_urdf
from stiffmap.workspace.maps import plan
from stiffmap.workspace.maps.store import ZarrMap

ROOT = Path(__file__).parents[4]
MACHINES = ROOT / "python/stiffmap/model/machines"
PROCESSES = ROOT / "python/stiffmap/machining/process/library"
EXPERIMENTS = ROOT / "tests/data/experiments"


@dataclass(frozen=True)
class Target:
    """A kind of file: text of its seeds, and what is done with a mutated one in an empty folder."""

    seeds: Callable[[], list[str]]
    run: Callable[[str, Path], None]


def _machine(text: str, folder: Path) -> None:
    path = folder / "m.yaml"
    path.write_text(text, encoding="utf-8", errors="surrogatepass")
    machine = sm.load_machine(path)
    s = machine.solve(np.asarray(machine.description.home.p) + 1e-3, [10.0, -5, 3, 0, 0, 0])
    failed = int(s.status) in (1, 4)
    assert failed == bool(np.isnan(s.displacement).all()) or int(s.status) == 2, "a number without its status"


def _experiment(text: str, folder: Path) -> None:
    _copy("C-backlash", folder)
    (folder / "experiment.yaml").write_text(text, encoding="utf-8", errors="surrogatepass")
    load_experiment(folder)


def _table(text: str, folder: Path) -> None:
    _copy("C-backlash", folder)
    (folder / "data.csv").write_text(text, encoding="utf-8", errors="surrogatepass")
    load_experiment(folder)


def _field(text: str, folder: Path) -> None:
    path = folder / "field.csv"
    path.write_text(text, encoding="utf-8", errors="surrogatepass")
    read_field(path)


def _link(text: str, folder: Path) -> None:
    path = folder / "link.yaml"
    path.write_text(text, encoding="utf-8", errors="surrogatepass")
    load_link(path)


def _urdf(text: str, folder: Path) -> None:
    path = folder / "m.urdf"
    path.write_text(text, encoding="utf-8", errors="surrogatepass")
    import_urdf(path)


def _gcode(text: str, folder: Path) -> None:
    path = folder / "p.ngc"
    path.write_text(text, encoding="utf-8", errors="surrogatepass")
    p = load_path(path)
    assert np.isfinite(p.length).all(), "a move without a length"
    if p.cuts.any():
        q = sampled(p, max(1e-3, float(p.length.sum()) / 1e4))
        assert np.isfinite(q.position).all(), "a point that is nowhere"
        assert np.isfinite(q.tangent).all(), "a point without a direction"


def _process(text: str, folder: Path) -> None:
    path = folder / "p.yaml"
    path.write_text(text, encoding="utf-8", errors="surrogatepass")
    assert np.isfinite(sm.cutting_force(path).mean).all(), "a force that is no number"


def _sheet(text: str, folder: Path) -> None:
    path = folder / "readings.csv"
    path.write_text(text, encoding="utf-8", errors="surrogatepass")
    sheet = read_sheet(path)
    said = Answers({}, {"x": "mm", "y": "mm", "z": "mm", "dx": "mm"}, {"fx": 300.0}, {"dx": 0.01})
    meant = Meant.of_sheet(sheet, said)
    write_folder(understand(meant), meant, folder / "out", "orthoglide-revised", "deflection", "")
    load_experiment(folder / "out")


def _zarr(text: str, folder: Path) -> None:
    name, _, content = text.partition("\n")
    shutil.copytree(_zarr_maps()[1], folder / "m.zarr.partial")
    victim = folder / "m.zarr.partial" / name
    if name in tree(_zarr_maps()[1]):
        victim.write_bytes(content.encode("latin-1", "replace"))
    with _tiles_of_one_row():
        sm.error_map(*_zarr_call()[0], **_zarr_call()[1], out=folder / "m.zarr", resume=True).close()
    assert tree(folder / "m.zarr") == tree(_zarr_maps()[0]), "another map than an uninterrupted one"


def tree(folder: Path) -> dict[str, bytes]:
    """Bytes of all files of a folder."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@cache
def _zarr_call() -> tuple[tuple[sm.Machine], dict[str, Any]]:
    grid = {"x": [0.0, 0.1], "y": [0.0, 0.1, 0.2], "z": [0.0]}
    return (sm.load_machine("orthoglide-revised"),), {**grid, "wrench": [300.0, 0, 0, 0, 0, 0], "plane": None}


@contextmanager
def _tiles_of_one_row() -> Iterator[None]:
    usual, plan.TILE_POSES = plan.TILE_POSES, 2
    try:
        yield
    finally:
        plan.TILE_POSES = usual


class PowerCut(Exception):
    """Stands for one."""


@cache
def _zarr_maps() -> tuple[Path, Path]:
    """A finished map, and one that was cut off after two of its three tiles."""
    place = Path(tempfile.mkdtemp())
    atexit.register(shutil.rmtree, place, ignore_errors=True)
    machine, call = _zarr_call()
    put, count = ZarrMap.put, iter(range(2))

    def failing(self: ZarrMap, tile: slice, values: dict[str, Any]) -> None:
        if next(count, None) is None:
            raise PowerCut
        put(self, tile, values)

    with _tiles_of_one_row():
        sm.error_map(*machine, **call, out=place / "m.zarr").close()
        ZarrMap.put = failing  # type: ignore[method-assign]
        try:
            sm.error_map(*machine, **call, out=place / "n.zarr", threads=1)
        except PowerCut:
            pass
        finally:
            ZarrMap.put = put  # type: ignore[method-assign]
    return place / "m.zarr", place / "n.zarr.partial"


def _zarr_seeds() -> list[str]:
    """Name of a file, then its bytes."""
    return [f"{name}\n{raw.decode('latin-1')}" for name, raw in tree(_zarr_maps()[1]).items()]


def _copy(name: str, folder: Path) -> None:
    for path in (EXPERIMENTS / name).iterdir():
        shutil.copy(path, folder / path.name)


def _short(text: str) -> str:
    return "\n".join(text.split("\n")[:12]) + "\n"


def _field_seed() -> list[str]:
    rng = np.random.default_rng(0)
    rows = [",".join(f"{v:.9g}" for v in rng.uniform(-1, 1, 9)) for _ in range(6)]
    return ["x [mm],y [mm],z [mm],ux [mm],uy [mm],uz [mm],ux [mm],uy [mm],uz [mm]\n" + "\n".join(rows) + "\n"]


def _link_seed() -> list[str]:
    rows = [[1e-6 * (i == k) for k in range(6)] for i in range(6)]
    units = "units: {length: m, force: N, angle: rad}"
    return [
        f"kind: stiffmap-link\nname: bar\n{units}\nreference: [0.0, 0.1, 0.0]\n"
        f"compliance: {rows}\nstandard_error: {rows}\nprovenance: {{nodes: 12}}\n"
    ]


URDF = """<robot name="arm"><link name="base"/><link name="a"/><link name="tool"/>
<joint name="q1" type="revolute"><origin xyz="0 0 0.3" rpy="0 0 0.2"/><axis xyz="0 0 1"/><parent link="base"/>
<child link="a"/><limit lower="-2" upper="2" effort="100" velocity="2"/></joint>
<joint name="q2" type="prismatic"><origin xyz="0.4 0 0"/><axis xyz="1 0 0"/><parent link="a"/><child link="tool"/>
<limit lower="0" upper="1" effort="9" velocity="2"/></joint></robot>
"""

SHEETS = (
    "Messung 12;;;\nX [mm];Y [mm];Z [mm];Uhr 1 [µm];Uhr 2 [µm]\n0;0;0;12,5;12,7\n10;0;0;13,5;n/a\n20;5,5;0;14;14,2\n",
    "# dial gauge\nx,y,z,dx,dy,dz,note\n1,2,3,0.01,0.02,0.03,a\n2,2,3,0.01,0.02,0.03,b\n",
    "x\ty\tz\tdx\n1\t2\t3\t0.1\n4\t5\t6\t-0.1\n",
)

GCODE = (
    "%\n(part) G21 G90 G17 G94 G40 G54\nS6000 M3\nG0 X10 Y0 Z5\nG1 Z-1 F300\nG3 X0 Y10 I-10 J0\n/G2 X10 Y0 R-10 Z-3\nG91 G1 X5 (side) Y-5\n"
    "G90.1 G3 X10 Y0 I0 J0 P2\nG18 G2 X0 Z7 R20\nG93 G1 X1 F20\nN90 M5\nM30\n",
    "G20 G90 F10 S100 M3\ng0x+0. 12 34y 7\nG1 X1 Y1 ; end\nG19 G2 Y2 Z1 J.5 K.5\nG43 H1\nG64 P0.01\nG53 G0 Z0\nM2\n",
)

TARGETS = {
    "machine": Target(lambda: [p.read_text() for p in sorted(MACHINES.glob("*.yaml"))], _machine),
    "experiment": Target(
        lambda: [p.read_text() for p in sorted(EXPERIMENTS.glob("*/experiment.yaml"))], _experiment
    ),
    "table": Target(lambda: [_short((EXPERIMENTS / "C-backlash/data.csv").read_text())], _table),
    "field": Target(_field_seed, _field),
    "link": Target(_link_seed, _link),
    "urdf": Target(lambda: [URDF], _urdf),
    "gcode": Target(lambda: [*GCODE, outline_text("washbasin")], _gcode),
    "process": Target(lambda: [p.read_text() for p in sorted(PROCESSES.glob("*.yaml"))], _process),
    "sheet": Target(lambda: list(SHEETS), _sheet),
    "zarr": Target(_zarr_seeds, _zarr),
}
