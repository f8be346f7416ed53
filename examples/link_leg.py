"""One whole leg of the Orthoglide (foot, parallelogram) in finite elements against its virtual-joint model.

Foot and both bars are the meshes that the links are identified from; carriage, crossbars and pins are rigid
and the drive has its declared compliance in both models. So the meshes' own error cancels, and what is left
is the step from solids to 6x6 springs. Two joints in the finite elements:

  bush  the hole turns freely with a rigid bush: the interfaces of links identified with rigid heads. The two
        models must then agree to round-off;
  pin   each node of a hole follows its rigid pin along normal and axis and slides round it freely, while the
        links are those that `stiffmap link` gives: one hole clamped, the other under a linear traction.

    python examples/link_leg.py
"""

from __future__ import annotations

import re
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy.sparse import block_diag, csr_matrix, diags, hstack
from scipy.sparse.linalg import splu

import stiffmap as sm
from stiffmap.model.files.shipped import find
from stiffmap.model.link.inputs import MATERIALS, UNIT_WRENCHES
from stiffmap.model.link.linkfile import save_link
from stiffmap.model.link.mesh import SolidMesh
from stiffmap.model.link.pipeline import PartLink, link_from_part
from stiffmap.model.link.rigidfit import design_matrix
from stiffmap.model.link.shapes import Foot, ForkBar
from stiffmap.model.link.solve import Material, Setup, stiffness_matrix
from stiffmap.model.link.transport import twist_transport
from stiffmap.solve.machine import Machine

Joint = Literal["bush", "pin"]
L, D, R, H = 0.310, 0.100, 0.031, 0.100  # m, the original Orthoglide
DRIVE = 1.4e-7  # m/N
# The nearest bar and foot of link_table1.py and link_foot.py.
BAR = ForkBar(length=L, width=0.00732, height=0.01814, wall=0.0027, fork=0.01361, prong=0.00266, gap=0.0082,
              hole=0.4 * 0.01814)  # fmt: skip
FOOT = Foot(height=H, upright=0.0245, depth=0.0077, base=0.0735, plate=0.0077)
AXES = {"x": (0, 1, 2), "y": (1, 2, 0), "z": (2, 0, 1)}  # base axes that are a leg's local x, y, z
POSES = {"isotropic": (0, 0, 0), "near corner": (-0.08, -0.08, -0.08), "far corner": (0.12, 0.12, 0.12),
         "skew": (-0.08, 0.12, 0.0)}  # fmt: skip


class Solid(NamedTuple):
    """A part in finite elements and the links identified from it, by joint."""

    mesh: SolidMesh
    stiffness: Any  # sparse (3 n, 3 n) N/m
    links: dict[str, PartLink]


def solid(shape: Any, material: Material, size: float | None = None, *, study: bool = True) -> Solid:
    """Mesh, stiffness and both identifications of a part; with ``study`` the error of its holes' support too."""
    mesh = shape.mesh(size)
    setup = Setup("fixed", "loaded", shape.reference())
    links = {}
    for joint, how, more in (("bush", setup._replace(head="rigid"), False), ("pin", setup, study)):
        links[joint] = link_from_part(lambda _: mesh, material, how, UNIT_WRENCHES, solver="skfem",
                                      study=more, other_support="soft", refine=False)  # fmt: skip
    return Solid(mesh, stiffness_matrix(mesh, material), links)


def rotation(pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Axes of the bars (3, 3) in leg axes, and the distal joint (3,) from the proximal one, m."""
    x = np.array([np.sqrt(L**2 - pose[1] ** 2 - pose[2] ** 2), pose[1], pose[2]])
    a, b = np.arctan2(x[1], x[0]), -np.arcsin(x[2] / L)
    Rz = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    Ry = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    return Rz @ Ry, x


# The leg's rigid bodies: the carriage along x, the foot's head (twist at the proximal joint), the turn about z
# there, and the distal crossbar (twist at the distal joint).
CARRIAGE, HEAD, TURN, DISTAL, BODIES = 0, slice(1, 7), 7, slice(8, 14), 14


def hole(mesh: SolidMesh, face: str, centre: np.ndarray, joint: Joint) -> tuple[np.ndarray, np.ndarray, Any]:
    """Degrees of freedom (m,) of a pin hole, their motion (m, 6) with the pin's twist at ``centre``, and the
    motions (m, k) that the joint leaves to them."""
    nodes = mesh.face_nodes(face)
    A = design_matrix(mesh.nodes[nodes], centre)
    if joint == "bush":
        return dofs(nodes), A.reshape(-1, 6), csr_matrix(A[:, :, 4].reshape(-1, 1))
    radial = (mesh.nodes[nodes] - centre) * [1, 0, 1]
    round_it = np.cross([0.0, 1.0, 0.0], radial / np.linalg.norm(radial, axis=1)[:, None])
    follow = np.eye(3) - round_it[:, :, None] * round_it[:, None, :]
    return dofs(nodes), (follow @ A).reshape(-1, 6), block_diag([t[:, None] for t in round_it])


def dofs(nodes: np.ndarray) -> np.ndarray:
    """Degrees of freedom of nodes."""
    return np.asarray((3 * nodes[:, None] + np.arange(3)).ravel())


def bar_motion(bar: Solid, joint: Joint, axes: np.ndarray, side: float) -> tuple[Any, np.ndarray]:
    """A bar's displacements, in bar axes, from its own coordinates (3 n, k) and from the bodies (3 n, 14)."""
    proximal, distal = np.zeros((6, BODIES)), np.zeros((6, BODIES))
    proximal[:, HEAD] = distal[:, DISTAL] = np.eye(6)
    proximal[5, TURN] = 1.0
    to_pin = np.kron(np.eye(2), axes.T) @ twist_transport(np.array([0, 0, side * D / 2]))
    size = 3 * len(bar.mesh.nodes)
    bodies, own, taken = np.zeros((size, BODIES)), [], []
    for face, x, crossbar in (("fixed", 0.0, proximal), ("loaded", L, distal)):
        at, follow, left = hole(bar.mesh, face, np.array([x, 0.0, 0.0]), joint)
        bodies[at] = follow @ to_pin @ crossbar
        own.append(placed(left, at, size))
        taken.append(at)
    return hstack([free_columns(size, np.concatenate(taken)), *own]), bodies


def foot_motion(foot: Solid) -> tuple[Any, np.ndarray]:
    """The foot's displacements from its own coordinates and from the bodies; as :func:`bar_motion`."""
    size = 3 * len(foot.mesh.nodes)
    bodies = np.zeros((size, BODIES))
    fixed, head = foot.mesh.face_nodes("fixed"), foot.mesh.face_nodes("loaded")
    bodies[3 * fixed, CARRIAGE] = 1.0
    bodies[dofs(head), HEAD] = design_matrix(foot.mesh.nodes[head], FOOT.reference()).reshape(-1, 6)
    return free_columns(size, dofs(np.concatenate([fixed, head]))), bodies


def placed(block: Any, rows: np.ndarray, size: int) -> Any:
    """A block's rows at these rows of a sparse matrix."""
    return csr_matrix((np.ones(len(rows)), (rows, np.arange(len(rows)))), shape=(size, len(rows))) @ block


def free_columns(size: int, taken: np.ndarray) -> Any:
    """Columns of the unit matrix of all degrees of freedom that are not taken."""
    free = np.setdiff1d(np.arange(size), taken)
    return csr_matrix((np.ones(len(free)), (free, np.arange(len(free)))), shape=(size, len(free)))


def leg_elements(foot: Solid, bar: Solid, pose: np.ndarray, joint: Joint) -> np.ndarray:
    """(6, 6) stiffness of one leg at the TCP, leg axes: all solids in one sparse matrix."""
    axes, _ = rotation(pose)
    solids = [foot, bar, bar]
    maps = [foot_motion(foot), *(bar_motion(bar, joint, axes, side) for side in (-1.0, 1.0))]
    T = hstack([block_diag([own for own, _ in maps]), csr_matrix(np.vstack([b for _, b in maps]))]).tocsr()
    K = (T.T @ block_diag([s.stiffness for s in solids]).tocsr() @ T).tolil()
    first = K.shape[0] - BODIES
    K[first + CARRIAGE, first + CARRIAGE] += 1 / DRIVE
    K = K.tocsc()
    inner, tip = slice(0, first + DISTAL.start), slice(first + DISTAL.start, None)
    right = -K[inner, tip].toarray()
    A = K[inner, inner]
    # Rotations and metres, pins and solids: unit diagonal keeps the factorisation exact.
    scale = diags(1 / np.sqrt(A.diagonal()))
    lu = splu((scale @ A @ scale).tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
              options={"SymmetricMode": True})  # fmt: skip
    X = scale @ lu.solve(scale @ right)
    X += scale @ lu.solve(scale @ (right - A @ X))
    return at_tcp(K[tip, tip].toarray() + K[tip, inner] @ X)


def at_tcp(distal: np.ndarray) -> np.ndarray:
    """Stiffness of the distal crossbar to that of the TCP: a free turn about z, then the flange."""
    turned = distal[:, 5:]
    free = distal - turned @ turned.T / distal[5, 5]
    T = twist_transport(np.array([-R, 0.0, 0.0]))
    return np.asarray(T.T @ free @ T)


def joint_machine(foot: Solid, bar: Solid, joint: Joint, folder: Path) -> Machine:
    """The shipped Orthoglide with both links from link files."""
    save_link(foot.links[joint].file("foot"), folder / "foot.yaml")
    save_link(bar.links[joint].file("bar"), folder / "bar.yaml")
    text = find("orthoglide-original").read_text(encoding="utf-8")
    text = re.sub(r"compliance: &bar\n(\s+k\d\d: .*\n)+", "link: bar.yaml\n", text)
    text = re.sub(r"beam: .*EIz.*", "link: foot.yaml", text.replace("compliance: *bar", "link: bar.yaml"))
    (folder / "machine.yaml").write_text(text, encoding="utf-8")
    return sm.load_machine(folder / "machine.yaml")


def leg_joints(machine: Machine, pose: np.ndarray) -> np.ndarray:
    """(6, 6) stiffness of leg x at the TCP by the virtual-joint model; its axes are the base's."""
    alone = Machine(replace(machine.description, legs=machine.description.legs[:1]))
    return np.asarray(alone.solve(pose).stiffness)


def machine_elements(foot: Solid, bar: Solid, pose: np.ndarray, joint: Joint) -> np.ndarray:
    """(6, 6) stiffness of the three legs at the TCP, base axes."""
    total, known = np.zeros((6, 6)), {}
    for order in AXES.values():
        local = tuple(pose[list(order)])
        if local not in known:
            known[local] = leg_elements(foot, bar, np.array(local), joint)
        Q = np.kron(np.eye(2), np.eye(3)[:, list(order)])
        total += Q @ known[local] @ Q.T
    return total


def spread(ours: np.ndarray, theirs: np.ndarray, rank: int) -> tuple[float, float]:
    """Smallest and largest ratio of two stiffnesses over all twists that the leg resists."""
    size = np.array([1.0] * 3 + [L] * 3)
    values, vectors = np.linalg.eigh(theirs / np.outer(size, size))
    B = vectors[:, -rank:] / np.sqrt(values[-rank:])
    ratio = np.linalg.eigvalsh(B.T @ (ours / np.outer(size, size)) @ B)
    return float(ratio[0]), float(ratio[-1])


def worst(compliance: np.ndarray, force: float = 100.0) -> float:
    """Largest deflection (m) of the TCP over all directions of a force in N."""
    return float(force * np.linalg.norm(compliance[:3, :3], 2))


def predicted(machine: Machine, pose: np.ndarray, force: float = 100.0) -> float:
    """Relative standard uncertainty of :func:`worst`, from the link files."""
    C = np.asarray(machine.solve(pose).compliance)
    along = np.linalg.svd(C[:3, :3])[2][0]
    x, y, z = pose
    ds = sm.error_map(
        machine, x=x, y=y, z=z, wrench=[*(force * along), 0, 0, 0], plane=None, uncertainty=True
    )
    return float(ds.deflection_std.squeeze() / ds.deflection.squeeze())


def main() -> None:
    """Identify both links, then print the table of errors."""
    # The foot's base is clamped in both models: no error of its support.
    foot = solid(FOOT, Material(*MATERIALS["steel"]), study=False)
    bar = solid(BAR, Material(*MATERIALS["aluminium"]))
    print(f"foot {len(foot.mesh.nodes)}, bar {len(bar.mesh.nodes)} nodes; force 100 N")
    print(
        "joint pose          leg: VJM/FE stiffness   worst deflection, mm: FE       VJM  difference  std. unc."
    )
    for joint in ("bush", "pin"):
        with tempfile.TemporaryDirectory() as folder:
            machine = joint_machine(foot, bar, joint, Path(folder))
        for name, mm in POSES.items():
            pose = np.array(mm, dtype=float)
            low, high = spread(leg_joints(machine, pose), leg_elements(foot, bar, pose, joint), 3)
            fe = worst(np.linalg.inv(machine_elements(foot, bar, pose, joint)))
            vjm = worst(np.asarray(machine.solve(pose).compliance))
            u = predicted(machine, pose)
            print(f"{joint:<6}{name:<14}{low:>10.6f} to {high:.6f}{1e3 * fe:>22.5f}{1e3 * vjm:>10.5f}"
                  f"{100 * (vjm / fe - 1):>10.4f} %{100 * u:>9.2f} %", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
