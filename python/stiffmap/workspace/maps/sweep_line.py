"""`stiffmap.sweep`."""

from __future__ import annotations

from typing import Unpack

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from stiffmap.common.errors import StiffmapError
from stiffmap.solve.machine import Machine, takes_machine
from stiffmap.solve.options import LoadingKeywords, spelled_out
from stiffmap.workspace.maps.fixed_order_sums import dot
from stiffmap.workspace.maps.inputs import force_list, place, unit
from stiffmap.workspace.maps.load_path import check_control, load_path
from stiffmap.workspace.maps.loading import Loading, without_failed
from stiffmap.workspace.maps.sweep_dataset import Equilibria, Followed, sweep_dataset


@takes_machine
@spelled_out(LoadingKeywords)
def sweep(
    machine: Machine,
    position: ArrayLike,
    direction: ArrayLike,
    forces: ArrayLike | None = None,
    *,
    control: str = "force",
    limit: float | None = None,
    steps: int = 40,
    cross: int = 0,
    **given: Unpack[LoadingKeywords],
) -> xr.Dataset:
    """Deflection against the size of a force of one direction, at one position.

    With `forces` (control ``force``), each force is reached from the unloaded machine. With a `limit`,
    one path of equilibria is followed from the unloaded machine, and what happens on the way is
    reported: control ``force`` to a force `limit` (N), ``displacement`` to a displacement `limit` (m)
    along the direction, which passes limit points (snap-through), ``arc`` by arc length to that
    displacement, which passes turning points of either. `cross` k also follows, by arc length, the branch
    that crosses the path at its k-th bifurcation, towards the side to which its mode points; -k: to the
    other side. That branch ends at the `limit`, or where the force falls to zero.

    position (3,) m; direction (3,), any length; forces (n,) N, negative ones act against it;
    limit of either sign; steps to the limit. Other keywords as in `Machine.solve`.

    Returns a Dataset with dimension ``step`` and the coordinate force: displacement, deflection, deflection_xy,
    deflection_along (component along the force), compliance_along (of a little more force, m/N; NaN on a path),
    unstable_modes (number of directions in which the energy falls; NaN for single forces), status, flags,
    branch (1: the crossing one). Unstable equilibria keep their values (status 3); unreachable and not converged
    ones hold NaN. A path may have entries of the dimension ``critical``: critical_force, critical_kind
    (``limit`` or ``bifurcation``: there the path goes on along the branch it came on, and another one crosses),
    critical_branch, mode over ``coordinate``, mode_leg and mode_joint (what moves most in it); the attributes
    ``end`` and ``crossing_end`` say why its branches ended (empty for single forces).
    Raises StiffmapError for bad input.
    """
    loading = Loading(machine, **given)
    p, u = place(position), unit(direction)
    if forces is None or control != "force":
        if forces is not None:
            raise StiffmapError(f"forces: not with control {control!r}, which finds them; give a limit (m)")
        reach = check_control(control, limit, steps, loading.options.load_type, cross)
        return load_path(loading, p, u, control, reach, steps, cross)
    if limit is not None or cross:
        raise StiffmapError(f"{'cross' if limit is None else 'limit'}: not together with forces")
    f = force_list(forces)
    wrench = np.concatenate([f[:, None] * u, np.zeros((f.size, 3))], axis=1)
    s = loading.solve(p, wrench)
    d = without_failed(s.displacement, s.status, keep_unstable=True)
    c = without_failed(s.compliance, s.status, keep_unstable=True)
    found = Equilibria(
        force=f,
        displacement=d,
        along=dot(d[:, :3], u),
        compliance_along=dot(dot(c[:, :3, :3], u), u),
        unstable_modes=np.full(f.size, np.nan),
        status=s.status,
        flags=s.flags,
        branch=np.zeros(f.size, dtype=np.intp),
    )
    call = {"position": p, "direction": u, "forces": f}
    return sweep_dataset(loading, "force sweep", call, found, Followed())
