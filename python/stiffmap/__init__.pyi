"""Public names, each loaded when it is first used, so that `import stiffmap` and `stiffmap --help` stay quick."""

from .common.errors import StiffmapError as StiffmapError
from .common.tables.table_file import TableFile as TableFile
from .common.version import __version__ as __version__
from .experiment import Experiment as Experiment, Residual as Residual, load_experiment as load_experiment
from .experiment.calls import residual as residual, simulate as simulate
from .experiment.spreadsheet.from_table import experiment_from_table as experiment_from_table
from .identification.calibration import Calibration as Calibration
from .identification.calibration.calibrate import calibrate as calibrate
from .identification.diagnosis import Diagnosis as Diagnosis, diagnose as diagnose
from .identification.planning.changes import monitor as monitor
from .identification.planning.design import plan as plan
from .machining.chatter import (
    floquet_multiplier as floquet_multiplier,
    limiting_depth as limiting_depth,
    stability_lobes as stability_lobes,
    vibration_map as vibration_map,
)
from .machining.compensation import Commands as Commands, compensate as compensate
from .machining.milling import mill as mill
from .machining.process import (
    CuttingForce as CuttingForce,
    IdentifiedLaw as IdentifiedLaw,
    Process as Process,
    cutting_force as cutting_force,
    identify_process as identify_process,
    load_process as load_process,
)
from .model.files.shipped import machine_names as machine_names
from .model.link.identify import identify_link as identify_link
from .solve.budget import DeflectionBudget as DeflectionBudget, deflection_budget as deflection_budget
from .solve.internal_wrenches import assembly_wrenches as assembly_wrenches
from .solve.kinematics import (
    Kinematics as Kinematics,
    forward_kinematics as forward_kinematics,
    inverse_kinematics as inverse_kinematics,
)
from .solve.machine import Machine as Machine, load_machine as load_machine
from .solve.solution import Solution as Solution
from .solve.status import Flag as Flag, Status as Status
from .solve.unreachable import why_unreachable as why_unreachable
from .solve.urdf_machine import import_urdf as import_urdf
from .ui import plot as plot
from .workspace.design.search import optimize as optimize
from .workspace.maps import (
    design_sweep as design_sweep,
    error_map as error_map,
    map_estimate as map_estimate,
    map_statistics as map_statistics,
    polar as polar,
    sweep as sweep,
    uncertainty_ranking as uncertainty_ranking,
)
from .workspace.performance import (
    accuracy_transmission as accuracy_transmission,
    drive_efforts as drive_efforts,
    force_transmission as force_transmission,
    largest_box as largest_box,
    load_requirements as load_requirements,
    measures as measures,
    natural_frequencies as natural_frequencies,
    velocity_section as velocity_section,
    velocity_transmission as velocity_transmission,
    workspace_volume as workspace_volume,
    worst_deflection as worst_deflection,
)
from .workspace.vibration import frequency_response as frequency_response
