"""What is fuzzed: the seeds of each kind of file, and what a user's command does with it."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import stiffmap as sm
from stiffmap.experiment import load_experiment
from stiffmap.link.linkfile import load_link
from stiffmap.link.readers import read_field
from stiffmap.urdf.importing import import_urdf

ROOT = Path(__file__).parents[3]
MACHINES = ROOT / "python/stiffmap/machines"
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
    import_urdf(path, None, meshes=False)


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

TARGETS = {
    "machine": Target(lambda: [p.read_text() for p in sorted(MACHINES.glob("*.yaml"))], _machine),
    "experiment": Target(
        lambda: [p.read_text() for p in sorted(EXPERIMENTS.glob("*/experiment.yaml"))], _experiment
    ),
    "table": Target(lambda: [_short((EXPERIMENTS / "C-backlash/data.csv").read_text())], _table),
    "field": Target(_field_seed, _field),
    "link": Target(_link_seed, _link),
    "urdf": Target(lambda: [URDF], _urdf),
}
