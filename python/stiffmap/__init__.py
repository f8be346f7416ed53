"""Stiffness of robots and parallel machines under load."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from stiffmap.errors import StiffmapError
from stiffmap.status import Flag, Status
from stiffmap.version import __version__

if TYPE_CHECKING:
    from stiffmap import plot
    from stiffmap.budget import DeflectionBudget, deflection_budget
    from stiffmap.calibration import Calibration
    from stiffmap.calibration.calibrate import calibrate
    from stiffmap.chatter import floquet_multiplier, limiting_depth, stability_lobes, vibration_map
    from stiffmap.compensation import Commands, compensate
    from stiffmap.design.search import optimize
    from stiffmap.diagnosis import Diagnosis, diagnose
    from stiffmap.experiment import Experiment, Residual, load_experiment
    from stiffmap.experiment.calls import residual, simulate
    from stiffmap.files.shipped import machine_names
    from stiffmap.internal_wrenches import assembly_stress, assembly_wrenches
    from stiffmap.kinematics import Kinematics, forward_kinematics, inverse_kinematics
    from stiffmap.link import identify_link
    from stiffmap.machine import Machine, load_machine
    from stiffmap.maps import (
        design_sweep,
        error_map,
        map_estimate,
        map_statistics,
        polar,
        sweep,
        uncertainty_ranking,
    )
    from stiffmap.milling import mill
    from stiffmap.performance import (
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
    from stiffmap.planning.calls import monitor, plan
    from stiffmap.process import (
        CuttingForce,
        IdentifiedLaw,
        Process,
        cutting_force,
        identify_process,
        load_process,
    )
    from stiffmap.solution import Solution
    from stiffmap.unreachable import why_unreachable
    from stiffmap.urdf.to_machine import import_urdf
    from stiffmap.vibration import frequency_response

# Loaded when first used, so that `import stiffmap` and `stiffmap --help` stay quick.
_HOME = {
    "Commands": "stiffmap.compensation",
    "Calibration": "stiffmap.calibration",
    "accuracy_transmission": "stiffmap.performance",
    "drive_efforts": "stiffmap.performance",
    "force_transmission": "stiffmap.performance",
    "largest_box": "stiffmap.performance",
    "load_requirements": "stiffmap.performance",
    "measures": "stiffmap.performance",
    "natural_frequencies": "stiffmap.performance",
    "velocity_section": "stiffmap.performance",
    "velocity_transmission": "stiffmap.performance",
    "workspace_volume": "stiffmap.performance",
    "worst_deflection": "stiffmap.performance",
    "why_unreachable": "stiffmap.unreachable",
    "Diagnosis": "stiffmap.diagnosis",
    "compensate": "stiffmap.compensation",
    "Experiment": "stiffmap.experiment",
    "calibrate": "stiffmap.calibration",
    "diagnose": "stiffmap.diagnosis",
    "Residual": "stiffmap.experiment",
    "load_experiment": "stiffmap.experiment",
    "machine_names": "stiffmap.files.shipped",
    "residual": "stiffmap.experiment",
    "simulate": "stiffmap.experiment",
    "CuttingForce": "stiffmap.process",
    "IdentifiedLaw": "stiffmap.process",
    "Process": "stiffmap.process",
    "cutting_force": "stiffmap.process",
    "identify_process": "stiffmap.process",
    "load_process": "stiffmap.process",
    "mill": "stiffmap.milling",
    "Kinematics": "stiffmap.kinematics",
    "Machine": "stiffmap.machine",
    "Solution": "stiffmap.solution",
    "DeflectionBudget": "stiffmap.budget",
    "deflection_budget": "stiffmap.budget",
    "assembly_stress": "stiffmap.internal_wrenches",
    "assembly_wrenches": "stiffmap.internal_wrenches",
    "design_sweep": "stiffmap.maps",
    "error_map": "stiffmap.maps",
    "import_urdf": "stiffmap.urdf.to_machine",
    "monitor": "stiffmap.planning.calls",
    "optimize": "stiffmap.design.search",
    "plan": "stiffmap.planning.calls",
    "plot": "stiffmap.plot",
    "forward_kinematics": "stiffmap.kinematics",
    "floquet_multiplier": "stiffmap.chatter",
    "frequency_response": "stiffmap.vibration",
    "limiting_depth": "stiffmap.chatter",
    "stability_lobes": "stiffmap.chatter",
    "vibration_map": "stiffmap.chatter",
    "identify_link": "stiffmap.link",
    "inverse_kinematics": "stiffmap.kinematics",
    "load_machine": "stiffmap.machine",
    "map_estimate": "stiffmap.maps",
    "map_statistics": "stiffmap.maps",
    "polar": "stiffmap.maps",
    "sweep": "stiffmap.maps",
    "uncertainty_ranking": "stiffmap.maps",
}

__all__ = [
    "Calibration",
    "Commands",
    "CuttingForce",
    "DeflectionBudget",
    "Diagnosis",
    "Experiment",
    "Flag",
    "IdentifiedLaw",
    "Kinematics",
    "Machine",
    "Process",
    "Residual",
    "Solution",
    "Status",
    "StiffmapError",
    "__version__",
    "accuracy_transmission",
    "assembly_stress",
    "assembly_wrenches",
    "calibrate",
    "compensate",
    "cutting_force",
    "deflection_budget",
    "design_sweep",
    "diagnose",
    "drive_efforts",
    "error_map",
    "floquet_multiplier",
    "force_transmission",
    "forward_kinematics",
    "frequency_response",
    "identify_link",
    "identify_process",
    "import_urdf",
    "inverse_kinematics",
    "largest_box",
    "limiting_depth",
    "load_experiment",
    "load_machine",
    "load_process",
    "load_requirements",
    "machine_names",
    "map_estimate",
    "map_statistics",
    "measures",
    "mill",
    "monitor",
    "natural_frequencies",
    "optimize",
    "plan",
    "plot",
    "polar",
    "residual",
    "simulate",
    "stability_lobes",
    "sweep",
    "uncertainty_ranking",
    "velocity_section",
    "velocity_transmission",
    "vibration_map",
    "why_unreachable",
    "workspace_volume",
    "worst_deflection",
]


if not TYPE_CHECKING:  # type checkers then know which names there are

    def __getattr__(name: str) -> Any:
        if name not in _HOME:
            raise AttributeError(f"module 'stiffmap' has no attribute {name!r}")
        home = import_module(_HOME[name])
        value = home if _HOME[name] == f"{__name__}.{name}" else getattr(home, name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted(__all__)
