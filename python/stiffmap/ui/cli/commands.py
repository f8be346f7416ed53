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


SUMMARIES = {
    "machines": "List the machines that come with stiffmap.",
    "new": "Start a machine file from a template that explains itself.",
    "check": "Validate a machine file.",
    "show": "Draw a machine and print what it is made of.",
    "view": "A machine and its map, live in a browser.",
    "effects": "List the effects that a machine can have.",
    "solve": "Deflection and stiffness at one pose under one wrench.",
    "map": "Error maps of z-planes under a force.",
    "polar": "Deflection against the direction of a force.",
    "wrench": "Wrench that holds a machine at a displacement.",
    "stress": "Internal wrenches without load: errors, preload.",
    "import": "Machine file from a URDF.",
    "sweep": "Deflection against the size of a force.",
    "measures": "Performance measures against requirements.",
    "efforts": "Efforts of the drives along a motion.",
    "optimize": "Best designs under several measures.",
    "paper": "Reproduce the figures and statements of the paper.",
    "link": "Spring of a link from a part or a field.",
    "experiment": "Experiment folder from a spreadsheet.",
    "residual": "Readings of an experiment against a machine.",
    "diagnose": "Which physical effect a machine lacks.",
    "calibrate": "All uncertain numbers of a machine.",
    "simulate": "Write a virtual experiment.",
    "plan": "Which poses, loads and readings are most informative.",
    "monitor": "What changed between two experiments.",
    "compensate": "Commands that cancel what a machine lacks.",
    "mill": "The part as it is cut, and a program that makes it right.",
    "process": "Force coefficients from a dynamometer's table.",
    "lobes": "Which depth of cut chatters at which speed.",
    "taps": "Which effect explains frequencies of tap tests.",
    "bench": "Speed of this installation on this computer.",
}
COMMANDS = tuple(
    Command(name, f"stiffmap.ui.cli.{'importing' if name == 'import' else name}", "command", summary)
    for name, summary in SUMMARIES.items()
)  # `import` is a word of Python's own
