"""Stiffness of robots and parallel machines under load."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from stiffmap.common.errors import StiffmapError
from stiffmap.common.from_above import PLACES
from stiffmap.common.version import __version__

if TYPE_CHECKING:
    from stiffmap.common.tables.table_file import TableFile
    from stiffmap.experiment import Experiment, Residual, load_experiment
    from stiffmap.experiment.calls import residual, simulate
    from stiffmap.experiment.spreadsheet.from_table import experiment_from_table
    from stiffmap.identification.calibration import Calibration
    from stiffmap.identification.calibration.calibrate import calibrate
    from stiffmap.identification.diagnosis import Diagnosis, diagnose
    from stiffmap.identification.planning.changes import monitor
    from stiffmap.identification.planning.design import plan
    from stiffmap.machining.chatter import floquet_multiplier, limiting_depth, stability_lobes, vibration_map
    from stiffmap.machining.compensation import Commands, compensate
    from stiffmap.machining.milling import mill
    from stiffmap.machining.process import (
        CuttingForce,
        IdentifiedLaw,
        Process,
        cutting_force,
        identify_process,
        load_process,
    )
    from stiffmap.model.files.shipped import machine_names
    from stiffmap.model.link.identify import identify_link
    from stiffmap.solve.budget import DeflectionBudget, deflection_budget
    from stiffmap.solve.internal_wrenches import assembly_wrenches
    from stiffmap.solve.kinematics import Kinematics, forward_kinematics, inverse_kinematics
    from stiffmap.solve.machine import Machine, load_machine
    from stiffmap.solve.solution import Solution
    from stiffmap.solve.status import Flag, Status
    from stiffmap.solve.unreachable import why_unreachable
    from stiffmap.solve.urdf_machine import import_urdf
    from stiffmap.ui import plot
    from stiffmap.workspace.design.search import optimize
    from stiffmap.workspace.maps import (
        design_sweep,
        error_map,
        map_estimate,
        map_statistics,
        polar,
        sweep,
        uncertainty_ranking,
    )
    from stiffmap.workspace.performance import (
        accuracy_transmission,
        drive_efforts,
        force_transmission,
        largest_box,
        load_requirements,
        measures,
        natural_frequencies,
        velocity_section,
        velocity_transmission,
        workspace_volume,
        worst_deflection,
    )
    from stiffmap.workspace.vibration import frequency_response

PLACES |= {
    "Machine.view": ("stiffmap.ui.view", "open_view"),
    "Diagnosis.report": ("stiffmap.ui.report.diagnosis.page", "write_report"),
}

# Loaded when first used, so that `import stiffmap` and `stiffmap --help` stay quick.
_HOME = {
    name: module
    for module, names in {
        "stiffmap.common.tables.table_file": "TableFile",
        "stiffmap.experiment": "Experiment Residual load_experiment residual simulate",
        "stiffmap.experiment.spreadsheet.from_table": "experiment_from_table",
        "stiffmap.identification.calibration": "Calibration calibrate",
        "stiffmap.identification.diagnosis": "Diagnosis diagnose",
        "stiffmap.identification.planning.design": "plan",
        "stiffmap.identification.planning.changes": "monitor",
        "stiffmap.machining.chatter": "floquet_multiplier limiting_depth stability_lobes vibration_map",
        "stiffmap.machining.compensation": "Commands compensate",
        "stiffmap.machining.milling": "mill",
        "stiffmap.machining.process": "CuttingForce IdentifiedLaw Process cutting_force identify_process load_process",
        "stiffmap.model.files.shipped": "machine_names",
        "stiffmap.model.link.identify": "identify_link",
        "stiffmap.solve.budget": "DeflectionBudget deflection_budget",
        "stiffmap.solve.internal_wrenches": "assembly_wrenches",
        "stiffmap.solve.kinematics": "Kinematics forward_kinematics inverse_kinematics",
        "stiffmap.solve.machine": "Machine load_machine",
        "stiffmap.solve.solution": "Solution",
        "stiffmap.solve.status": "Flag Status",
        "stiffmap.solve.unreachable": "why_unreachable",
        "stiffmap.solve.urdf_machine": "import_urdf",
        "stiffmap.ui.plot": "plot",
        "stiffmap.workspace.design.search": "optimize",
        "stiffmap.workspace.maps": "design_sweep error_map map_estimate map_statistics polar sweep "
        "uncertainty_ranking",
        "stiffmap.workspace.performance": "accuracy_transmission drive_efforts force_transmission largest_box "
        "load_requirements measures natural_frequencies velocity_section "
        "velocity_transmission workspace_volume worst_deflection",
        "stiffmap.workspace.vibration": "frequency_response",
    }.items()
    for name in names.split()
}

__all__ = [
    "Calibration", "Commands", "CuttingForce", "DeflectionBudget", "Diagnosis", "Experiment", "Flag",
    "IdentifiedLaw", "Kinematics", "Machine", "Process", "Residual", "Solution", "Status", "StiffmapError", "TableFile",
    "__version__", "accuracy_transmission", "assembly_wrenches", "calibrate", "compensate", "cutting_force",
    "deflection_budget", "design_sweep", "diagnose", "drive_efforts", "error_map", "experiment_from_table", "floquet_multiplier",
    "force_transmission", "forward_kinematics", "frequency_response", "identify_link", "identify_process",
    "import_urdf", "inverse_kinematics", "largest_box", "limiting_depth", "load_experiment", "load_machine",
    "load_process", "load_requirements", "machine_names", "map_estimate", "map_statistics", "measures",
    "mill", "monitor", "natural_frequencies", "optimize", "plan", "plot", "polar", "residual", "simulate",
    "stability_lobes", "sweep", "uncertainty_ranking", "velocity_section", "velocity_transmission",
    "vibration_map", "why_unreachable", "workspace_volume", "worst_deflection",
]  # fmt: skip


if not TYPE_CHECKING:  # type checkers then know which names there are

    def __getattr__(name: str) -> Any:
        if name not in _HOME:
            raise AttributeError(f"module 'stiffmap' has no attribute {name!r}")
        home = import_module(_HOME[name])
        value = home if _HOME[name].endswith(f".{name}") else getattr(home, name)
        if callable(value) and not isinstance(value, type):
            from stiffmap.common.arguments import checked

            value = checked(value)
            value.__module__ = __name__  # where it is found again when it is pickled
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted(__all__)
