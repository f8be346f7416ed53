"""Commands at which a deflected, deviating machine stands where it is wanted: the exact inverse, by Newton.

The controller knows the declared geometry only. With u the commanded coordinates and T(u) the pose that the
real machine then takes (deviations, weight, load, play and friction on the side of the approach), T(u) = wanted
is solved with the declared machine's Jacobian; the deviations change it little, so each step gains digits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from os import PathLike

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from stiffmap.common.broadcasting import Floats, names_of, one_of, refused, trailing, wrench_array
from stiffmap.common.errors import StiffmapError
from stiffmap.common.outputs import number_cells, write_rows
from stiffmap.common.short import short_repr
from stiffmap.common.tables.named import WORD
from stiffmap.common.tables.pose_table import KNOWN, read_pose_table
from stiffmap.common.tables.table_file import table_file
from stiffmap.experiment.experiment import AXES, WRENCH, Experiment
from stiffmap.experiment.files.fields import APPROACH, COUNTED, VECTOR, WORDS
from stiffmap.experiment.poses.configuration import coordinates_of, drive_jacobian
from stiffmap.experiment.prediction.equilibria import motions
from stiffmap.experiment.spreadsheet.joints import commands_in
from stiffmap.model.description import TASK
from stiffmap.solve.closing import commanded, of_drives
from stiffmap.solve.kinematics import Kinematics, forward_kinematics, inverse_kinematics, must_take
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.solve.validity import Validity

STEPS = 25
DONE = 1e-10
"""m, rad: step of the commands below which they stand."""
MM = 1e3
BARE = dict(zip((*"xyz", *WRENCH), np.repeat(["mm", "N", "N*mm"], 3).tolist(), strict=True))
"""Units of columns that name none."""
WANTED = replace(
    KNOWN,
    units={**KNOWN.units, **dict.fromkeys((*APPROACH, *COUNTED), ""), **dict.fromkeys(WORDS, WORD)},
    renamed=lambda name, unit: (name, unit or ("rad" if name in VECTOR else "")),
    assumed=BARE,
)
"""What a table of wanted poses may have besides those of every table of poses."""


@short_repr
@dataclass(frozen=True, eq=False)
class Commands:
    """Compensated commands of n poses, SI, base axes; NaN where the machine has no answer."""

    names: tuple[str, ...]
    """Actuators."""
    declared: Floats
    """(n, actuators) commands of a controller that knows the declared machine only."""
    actuators: Floats
    """(n, actuators) commands at which the real machine stands where it is wanted."""
    position: Floats
    """(n, 3) pose to tell such a controller instead of the wanted one."""
    rotation: Floats
    """(n, 3, 3)."""
    wanted: Floats
    """(n, 3)."""
    before: Floats
    """(n, 6) pose error m, rad at the declared commands, along all six axes."""
    after: Floats
    """(n, 6) the same at the compensated commands."""
    components: tuple[str, ...]
    """What the drives can correct, and was: of x, y, z along base axes, rx, ry, rz about the tool's axes."""
    prismatic: tuple[bool, ...]
    """Whether each actuator slides."""
    beyond: NDArray[np.bool_] | None
    """(n,) rows outside what the readings of a calibrated machine covered: nothing vouches for its numbers there. None: the
    machine was not calibrated."""
    ids: tuple[str, ...] = ()
    """Of the rows, as a file of poses names them; else 1, 2 …"""
    turns: str = ""
    """Columns of a file that are orientations, against what and how they turn, in words."""

    @property
    def ok(self) -> NDArray[np.bool_]:
        """(n,) rows with an answer."""
        return np.asarray(np.isfinite(self.actuators).all(axis=1))

    def rms(self, errors: Floats) -> float:
        """Root mean square distance (m) of the tool from where it is wanted, over the rows of errors (n, 6) with an answer; NaN without."""
        e = trailing(errors, (len(self.ok), 6), "errors", "errors (m, rad)")[self.ok, :3]
        return float(np.sqrt(np.mean(np.sum(e**2, axis=1)))) if len(e) else float("nan")

    def write(self, path: str | PathLike[str]) -> None:
        """CSV in mm and deg: wanted pose, commands (declared and compensated), pose to command, errors.

        Raises `FileError` where it cannot be written.
        """
        scale = np.where(self.prismatic, MM, 180.0 / np.pi)
        units = ["mm" if p else "deg" for p in self.prismatic]
        turn = Rotation.from_matrix(np.where(self.ok[:, None, None], self.rotation, np.eye(3))).as_rotvec()
        turn = np.where(self.ok[:, None], np.degrees(turn), np.nan)
        columns = {f"wanted_{a}_mm": self.wanted[:, i] * MM for i, a in enumerate("xyz")}
        for word, values in (("declared", self.declared), ("command", self.actuators)):
            columns |= {
                f"{word}_{n}_{u}": values[:, i] * scale[i]
                for i, (n, u) in enumerate(zip(self.names, units, strict=True))
            }
        columns |= {f"pose_{a}_mm": self.position[:, i] * MM for i, a in enumerate("xyz")}
        columns |= {f"pose_rot{a}_deg": turn[:, i] for i, a in enumerate("xyz")}
        for word, values in (("before", self.before), ("after", self.after)):
            columns |= {f"{word}_{a}_mm": values[:, i] * MM for i, a in enumerate(AXES[:3])}
        if self.beyond is not None:
            columns["beyond_calibration"] = self.beyond.astype(float)
        write_rows(path, list(columns), map(number_cells, zip(*columns.values(), strict=True)))


@takes_machine
def compensate(
    machine: Machine,
    position: ArrayLike | str | PathLike[str] | None = None,
    rotation: ArrayLike | None = None,
    *,
    actuators: ArrayLike | None = None,
    wrench: ArrayLike | None = None,
    approach: ArrayLike | None = None,
    gravity: ArrayLike | None = None,
    components: tuple[str, ...] | None = None,
    point: str = "tcp",
    threads: int | None = None,
) -> Commands:
    """Commands at which a machine with known deviations stands where it is wanted.

    Parameters
    ----------
    machine
        The corrected machine: as declared, with the effects that a diagnosis found. Its controller knows the
        declared geometry.
    position, rotation
        (n, 3) m and (n, 3, 3) wanted tool poses; rotation None: as at home. Or a table of poses, its file or a `TableFile` (x, y, z in mm, and
        where wanted loads, approach, orientation as in every table of poses), whose own loads replace `wrench`.
    actuators
        (n, actuators) instead: wanted is the pose that the declared machine takes there, and the commands stay in
        that configuration. Needed for redundant arms and other branches.
    wrench
        (6,) or (n, 6) N, N·m, acting at `point` while the pose is held.
    approach
        (3,) or (n, 3) direction of the last travel: play and friction of the drives are on that side.
    gravity
        (3,) m/s²; None: what the machine says.
    components
        Pose components to correct, of x y z rx ry rz; None: those that the machine commands, positions first
        where it has fewer drives than components.

    Notes
    -----
    Rows out of reach hold NaN.

    Raises
    ------
    StiffmapError
        For bad input.
    """
    ids, turns = (), ""
    one_of(point, machine.points, "point")
    if isinstance(position, (str, PathLike)):
        home, task = machine.description.home, machine.description.task
        read = read_pose_table(
            position, at_home=None if {*"xyz"} <= {*task} else home.p, known=WANTED,
            joints=partial(commands_in, machine, table_file(position).units),
        )  # fmt: skip
        position, rotation, turns = read.position, read.rotation(home.r), read.turns
        if read.actuators is not None and actuators is None:
            position, rotation, actuators = None, None, read.actuators
        ids = tuple(read.values.get("id", ()))
        approach = read.block(APPROACH) if {*APPROACH} & {*read.values} else approach
        wrench = read.wrench if read.loaded else wrench
    if approach is not None:
        approach = trailing(approach, (3,), "approach", "directions")
        lost = approach[~(np.linalg.norm(approach, axis=-1) > 0)]
        if lost.size:
            raise refused("approach", "directions with a length", str(lost[0].tolist()))
    plan = _plan(machine, position, rotation, actuators, wrench, approach, gravity, point, threads)
    assert plan.rotation is not None  # as the kinematics has it
    chosen = _components(machine, components)
    start = coordinates_of(machine, plan)
    declared = of_drives(machine.compiled, start)
    valid = Validity.of_machine(machine)
    lost = np.asarray(~np.isfinite(start).all(axis=1))
    u = np.where(lost[:, None], np.nan, declared)
    inverse = np.linalg.pinv(_rows(np.nan_to_num(drive_jacobian(machine, plan)), plan.rotation, chosen))
    before = after = np.full((len(plan), 6), np.nan)
    for step in range(STEPS):
        at = forward_kinematics(machine, u, start=start)
        after = _error(machine, plan, at, threads)
        before = after if step == 0 else before
        move = -np.einsum("nac,nc->na", inverse, _rows(after[:, :, None], plan.rotation, chosen)[:, :, 0])
        u = u + 0 * move  # where there is no equilibrium, there is no command
        if not np.nanmax(np.abs(move), initial=0.0) > DONE:
            break
        u = u + move
    at = forward_kinematics(machine, u, start=start)
    return Commands(
        machine.actuators,
        declared,
        u,
        at.position,
        at.rotation,
        plan.position,
        before,
        after,
        tuple(TASK[i] for i in chosen),
        tuple(machine.compiled.names.is_prismatic(a) for a in machine.actuators),
        None if valid is None else valid.outside(machine, start, plan.wrench),
        ids or plan.ids,
        turns,
    )


def _plan(
    machine: Machine,
    position: ArrayLike | None,
    rotation: ArrayLike | None,
    actuators: ArrayLike | None,
    wrench: ArrayLike | None,
    approach: Floats | None,
    gravity: ArrayLike | None,
    point: str,
    threads: int | None,
) -> Experiment:
    """What is wanted, as a plan of positions."""
    if (position is None) == (actuators is None):
        raise StiffmapError("compensate: give either position or actuators")
    if actuators is not None:
        count = len(machine.actuators)
        at = forward_kinematics(
            machine, np.atleast_2d(trailing(actuators, (count,), "actuators", "actuator coordinates"))
        )
    else:
        p, turned = commanded(machine.compiled, position, rotation)  # type: ignore[arg-type]
        p, r = np.atleast_2d(p), None if rotation is None else turned
        must_take(machine, p, r)
        at = inverse_kinematics(machine, p, r, threads=threads)
    names, n = machine.compiled.names, len(at.position)
    return Experiment(
        name="commands",
        machine=machine.name,
        quantity="position",
        ids=tuple(str(i + 1) for i in range(n)),
        position=at.position,
        rotation=at.rotation,
        wrench=_each(wrench_array(wrench), n, "wrench"),
        reading=np.zeros((n, len(AXES))),
        sigma=np.ones((n, len(AXES))),
        joints=at.coordinates[:, list(names.joints.values())],
        joint_names=tuple(names.joints),
        load_point=point,
        approach=None if approach is None else _each(approach, n, "approach"),
        gravity=None if gravity is None else tuple(machine.compiled.gravity(gravity).tolist()),
    )


def _each(values: Floats, n: int, name: str) -> Floats:
    """(n, k) of one row for all poses, or of one for each."""
    if values.shape[:-1] not in ((), (1,), (n,)):
        raise StiffmapError(f"{name}: expected one row or {n}, one for each pose, got shape {values.shape}")
    return np.broadcast_to(values, (n, values.shape[-1])).copy()


def _components(machine: Machine, given: tuple[str, ...] | None) -> list[int]:
    given = None if given is None else names_of(given, "components")
    for c in given or ():
        one_of(c, TASK, "components")
    if given == ():
        raise refused("components", f"one or more of {', '.join(TASK)}", "none")
    task = [i for i, c in enumerate(TASK) if c in (given or machine.description.task)]
    return task if given else task[: len(machine.actuators)]


def _rows(columns: Floats, turns: Floats, chosen: list[int]) -> Floats:
    """(n, chosen, k) of twists (n, 6, k): translations along base axes, rotations about the tool's."""
    local = np.einsum("nji,njk->nik", np.nan_to_num(turns), columns[:, 3:])
    return np.concatenate([columns[:, :3], local], axis=1)[:, chosen]


def _error(machine: Machine, plan: Experiment, at: Kinematics, threads: int | None) -> Floats:
    """(n, 6) real pose less the wanted one; NaN where the machine has no equilibrium."""
    assert plan.rotation is not None
    good = np.flatnonzero(np.isfinite(at.position).all(axis=1))
    out = np.full((len(plan), 6), np.nan)
    if not good.size:
        return out
    joints = at.coordinates[:, list(machine.compiled.names.joints.values())]
    now = replace(plan, position=at.position, rotation=at.rotation, joints=joints, command=at.actuators)
    moved, _ = motions(machine, now.rows(good), threads)
    shift = moved[:, :3] + at.position[good] - plan.position[good]
    turned = Rotation.from_rotvec(np.nan_to_num(moved[:, 3:])).as_matrix() @ at.rotation[good]
    turn = Rotation.from_matrix(turned @ np.swapaxes(plan.rotation[good], 1, 2)).as_rotvec()
    out[good] = np.where(np.isfinite(moved), np.hstack([shift, turn]), np.nan)
    return out
