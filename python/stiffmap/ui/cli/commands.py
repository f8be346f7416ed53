"""The table of commands; each lives in a file of its own, which is imported only when it is run."""

from __future__ import annotations

from importlib.util import find_spec
from typing import NamedTuple


class Command(NamedTuple):
    """Name on the command line, module and function behind it, and the line in ``stiffmap --help``."""

    name: str
    module: str
    function: str
    summary: str

    def exists(self) -> bool:
        """Whether this installation has the module (it is not imported)."""
        try:
            return find_spec(self.module) is not None
        except ModuleNotFoundError:
            return False


COMMANDS = (
    Command("machines", "stiffmap.ui.cli.machines", "machines", "List the machines that come with stiffmap."),
    Command(
        "new", "stiffmap.ui.cli.new", "new", "Start a machine file from a template that explains itself."
    ),
    Command("check", "stiffmap.ui.cli.check", "check", "Validate a machine file."),
    Command("show", "stiffmap.ui.cli.show", "show", "Draw a machine and print what it is made of."),
    Command("view", "stiffmap.ui.cli.view", "view", "A machine and its map, live in a browser."),
    Command("effects", "stiffmap.ui.cli.effects", "effects", "List the effects that a machine can have."),
    Command(
        "solve", "stiffmap.ui.cli.solve", "solve", "Deflection and stiffness at one pose under one wrench."
    ),
    Command("map", "stiffmap.ui.cli.map", "map_command", "Error maps of z-planes under a force."),
    Command("polar", "stiffmap.ui.cli.polar", "polar", "Deflection against the direction of a force."),
    Command("wrench", "stiffmap.ui.cli.wrench", "wrench", "Wrench that holds a machine at a displacement."),
    Command("stress", "stiffmap.ui.cli.stress", "stress", "Internal wrenches without load: errors, preload."),
    Command("import", "stiffmap.ui.cli.importing", "import_urdf", "Machine file from a URDF."),
    Command("sweep", "stiffmap.ui.cli.sweep", "sweep", "Deflection against the size of a force."),
    Command("measures", "stiffmap.ui.cli.measures", "measures", "Performance measures against requirements."),
    Command("efforts", "stiffmap.ui.cli.efforts", "efforts", "Efforts of the drives along a motion."),
    Command("optimize", "stiffmap.ui.cli.optimize", "optimize", "Best designs under several measures."),
    Command("paper", "stiffmap.ui.cli.paper", "paper", "Reproduce the figures and statements of the paper."),
    Command("link", "stiffmap.ui.cli.link", "link_command", "Spring of a link from a part or a field."),
    Command(
        "experiment", "stiffmap.ui.cli.experiment", "experiment", "Experiment folder from a spreadsheet."
    ),
    Command(
        "residual", "stiffmap.ui.cli.residual", "residual", "Readings of an experiment against a machine."
    ),
    Command(
        "diagnose", "stiffmap.ui.cli.diagnose", "diagnose_command", "Which physical effect a machine lacks."
    ),
    Command(
        "calibrate", "stiffmap.ui.cli.calibrate", "calibrate_command", "All uncertain numbers of a machine."
    ),
    Command("simulate", "stiffmap.ui.cli.simulate", "simulate", "Write a virtual experiment."),
    Command("plan", "stiffmap.ui.cli.plan", "plan", "Which poses, loads and readings are most informative."),
    Command("monitor", "stiffmap.ui.cli.monitor", "monitor", "What changed between two experiments."),
    Command(
        "compensate", "stiffmap.ui.cli.compensate", "compensate", "Commands that cancel what a machine lacks."
    ),
    Command(
        "mill", "stiffmap.ui.cli.mill", "mill", "The part as it is cut, and a program that makes it right."
    ),
    Command(
        "process", "stiffmap.ui.cli.process", "process", "Force coefficients from a dynamometer's table."
    ),
    Command("lobes", "stiffmap.ui.cli.lobes", "lobes", "Which depth of cut chatters at which speed."),
    Command("taps", "stiffmap.ui.cli.taps", "taps", "Which effect explains frequencies of tap tests."),
    Command("bench", "stiffmap.ui.cli.bench", "bench", "Speed of this installation on this computer."),
)
