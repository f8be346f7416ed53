"""Makes the pictures of the documentation anew.

python docs/images.py [NAME ...]: all of them, or those whose path below docs/img begins with a name.
"""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.figure import Figure

import stiffmap as sm
from stiffmap.experiment import Predictor, random_plan
from stiffmap.identification.numbers import unknowns
from stiffmap.identification.numbers.sensitivity import predicted
from stiffmap.model.description import AppliedEffect, Offset, Pose
from stiffmap.ui.cli import main as stiffmap
from stiffmap.ui.plot import path_figure, save, stress_figure
from stiffmap.ui.report.diagnosis.pictures import shared_out

HERE = Path(__file__).parent
TARGET = HERE / "img"
CORNER = "--at -200,-200,-200"
COMMANDS = {  # picture: the command that writes it, and the file's name where they differ
    "machine.png": ("show orthoglide-revised -o {out}/machine.png", ""),
    "polar.png": (f"polar orthoglide-revised {CORNER} -o {{out}}", ""),
    "sweep.png": (f"sweep orthoglide-revised {CORNER} --direction 1,1,0 -o {{out}}", ""),
    "machines/linear-delta-mode.png": (
        "sweep linear-delta --direction 0,0,-1 --limit 9000 -o {out}",
        "mode_1.png",
    ),
    "machines/travelling-column-map.png": (
        "map travelling-column --force 0,0,-1000 --x 0 --plane yz -o {out}",
        "map-F.png",
    ),
} | {
    f"machines/{name}.png": (f"show {name} -o {{out}}/{name}.png", "")
    for name in ("hexapod", "linear-delta", "rotary-delta", "ur10", "hybrid", "five-bar", "swing-table", "3-rps",
                 "travelling-column")
}  # fmt: skip
ALL_OF_IT = "measures orthoglide-revised --requirements trimming --toolpath trim --nodes 21 -o {out}"
COMMANDS |= {
    f"measures/{name}": (ALL_OF_IT, "")
    for name in ("requirements.png", "transmission.png", "largest-box.png", "map-workspace.png", "map-deflection.png",
                 "toolpath.png", "modes.gif")
} | {"measures/efforts.png": ("efforts orthoglide-revised trim -o {out}", "")}  # fmt: skip
COMMANDS |= {
    f"design/{name}.png": ("optimize redesign -o {out}", "")
    for name in ("fronts", "parallel", "beside", "toolpath")
}
COMMANDS |= {
    f"milling/{name}.png": ("mill orthoglide-revised washbasin --process trimming --at 50,50,0 --band -o {out}", "")
    for name in ("outline", "error")
} | {"milling/arm.png": (f"mill {HERE.parent / 'examples/ur10-spindle.yaml'} washbasin --process trimming --at=-750,-100,300 "
                         "--redundancy 72 --step 4 -o {out}", "error.png")}  # fmt: skip
TAPS = "examples/taps"
CUT = f"{TAPS}/kr210.yaml --process {TAPS}/cut.yaml --damping 3 --speeds 500,1500 --depth 1"
COMMANDS |= {
    "vibration/response.png": (f"taps {TAPS}/kr210.yaml {TAPS}/taps.csv -o {{out}}", ""),
    "vibration/before.png": (f"lobes {CUT} -o {{out}}", "lobes.png"),
    "vibration/after.png": (f"lobes {CUT} --effect 'compliance a2 arm scale=1.828' -o {{out}}", "lobes.png"),
}
PAPER = ("figure5", "figure6", "figure7-worst", "figure7-best", "figure7-Fx", "figure7-Fy")
COMMANDS |= {f"{name}.png": ("paper -o {out}", "") for name in PAPER}


def _structures() -> object:
    """Trusses and columns with known answers, from the tests."""
    sys.path.insert(0, str(HERE.parent))
    from tests.python.solve import structures

    return structures


def snap_through() -> Figure:
    """Two bars on pins, pushed through."""
    s = _structures()
    position = s.truss().description.home.p  # type: ignore[attr-defined]
    push = sm.sweep(s.truss(), position, (0, -1, 0), control="displacement", limit=2.3 * s.RISE, steps=80)  # type: ignore[attr-defined]
    return path_figure(push)


def column() -> Figure:
    """Five links on springs, past their buckling load."""
    s = _structures()
    path = sm.sweep(s.column(5), (1.0, 0, 0), (-1, 0, 0), limit=2 * s.column_load(5), cross=1)  # type: ignore[attr-defined]
    return path_figure(path)


def swing_table_stress() -> Figure:
    """One bar of the swing table 0.05 mm too long."""
    d = sm.load_machine("swing-table").description

    def longer(e: object) -> object:
        if not isinstance(e, Offset) or not e.name.startswith("length"):
            return e
        step = 0.05e-3 * e.nominal.p / np.linalg.norm(e.nominal.p)
        return replace(e, actual=Pose.of(e.nominal.p + step))

    legs = tuple(
        replace(leg, elements=tuple(map(longer, leg.elements))) if leg.name == "back_right" else leg
        for leg in d.legs
    )
    changed = replace(d, legs=legs)
    assert changed != d, "no offset of the bar's length was found"
    return stress_figure(
        sm.assembly_wrenches(sm.Machine(changed), d.home.p), "swing-table, bar back_right 0.05 mm too long"
    )


def shares_of_a_residual() -> Figure:
    """A delta that is off everywhere, with a wrong pitch of one carriage and a pattern that no model holds."""
    machine = sm.load_machine("linear-delta")
    plan = random_plan(machine, "position", poses=40, seed=5)
    p, rng = Predictor(machine, plan), np.random.default_rng(5)
    wanted = unknowns(machine.description, p.experiment)
    lead = AppliedEffect("lead_error", "carriage", ("a",), (("slope", 5e-3),))
    exact = predicted(p, wanted, 0.15 * rng.standard_normal(len(wanted))) + p([lead]) - p()
    exact[:, 2] += 6e-5 * np.sin(plan.position[:, 0] / 0.04) * np.cos(plan.position[:, 1] / 0.05)
    noise = np.nan_to_num(plan.sigma) * rng.standard_normal(exact.shape)
    found = sm.diagnose(machine, plan.with_readings(exact + noise), seed=1)
    return shared_out(found)


DRAWN: dict[str, Callable[[], Figure]] = {
    "diagnosis/shares.png": shares_of_a_residual,
    "machines/snap-through.png": snap_through,
    "machines/column.png": column,
    "machines/swing-table-stress.png": swing_table_stress,
}


EXAMPLES = {"machines/boxes.png": HERE.parent / "examples/machine_boxes.py"} | {
    f"view/{name}": HERE / "view_movie.py" for name in ("corner.gif", "first.png", "why.png", "worst.png")
}


def pictures() -> list[str]:
    """All pictures, by their path below docs/img."""
    return sorted({*COMMANDS, *DRAWN, *EXAMPLES})


def main(wanted: list[str]) -> None:
    """Write them; a command that makes several pictures runs once."""
    chosen = [n for n in pictures() if not wanted or any(n.startswith(w) for w in wanted)]
    with TemporaryDirectory() as folder:
        done: dict[str, Path] = {}
        for name in chosen:
            target = TARGET / name
            target.parent.mkdir(parents=True, exist_ok=True)
            if name in DRAWN:
                save(DRAWN[name](), target)
            elif name in EXAMPLES:
                subprocess.run([sys.executable, str(EXAMPLES[name]), str(target)], check=True)
            else:
                command, made = COMMANDS[name]
                if command not in done:
                    done[command] = Path(folder, str(len(done)))
                    done[command].mkdir()
                    stiffmap(shlex.split(command.format(out=done[command])))
                shutil.copyfile(done[command] / (made or target.name), target)
            print(f"wrote {target}")


if __name__ == "__main__":
    main(sys.argv[1:])
