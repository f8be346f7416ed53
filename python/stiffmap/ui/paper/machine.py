"""§5.2 and the beginning of §5.3: the machine."""

from __future__ import annotations

import numpy as np

from stiffmap.solve.kinematics import inverse_kinematics
from stiffmap.solve.machine import Machine
from stiffmap.ui.paper.bars import bar_statements
from stiffmap.ui.paper.results import Results
from stiffmap.ui.paper.statement import Statement, Verdict, judge, rounds_to
from stiffmap.ui.paper.transmission import box_factors, diagonal_limits, factors

LOW, HIGH = 0.5, 2.0


def machine_statements(results: Results) -> list[Statement]:
    """Workspace, speed, transmission factors, geometry, revised bar."""
    original, revised = (
        cube_edge(m, reach) for m, reach in ((results.original, 0.13), (results.revised, 0.33))
    )
    return [
        workspace_size(original),
        wanted_size(revised),
        speed(results.original),
        _unchecked(
            "acceleration in the isotropic point of … 14 m/s²",
            "14 m/s²",
            "the paper gives neither masses nor drive forces; those of our machine files are declared by us",
        ),
        _unchecked(
            "payload of 4 kg",
            "4 kg",
            "the paper gives no criterion (drive force, deflection or stress) for it",
        ),
        transmission(results.original),
        geometry(results.original),
        too_small(original),
        *bar_statements(results),
    ]


def _unchecked(words: str, printed: str, because: str) -> Statement:
    return Statement("5.2", words, "no number", Verdict.NOT_CHECKED, because, printed=printed)


def cube_edge(machine: Machine, reach: float) -> float:
    """Edge (mm) of the cube on the diagonal whose corners bound the factors 0.5 … 2."""
    low, high = diagonal_limits(machine, LOW, HIGH, reach)
    return 1e3 * (high - low)


def workspace_size(edge: float) -> Statement:
    """The original's cube."""
    return Statement(
        "5.2",
        "cubic Cartesian workspace of size 200×200×200 mm³",
        f"{edge:.2f} mm",
        judge(edge >= 200),
        f"the largest cube with transmission factors within 0.5–2 has this edge (0.64395 L); it misses "
        f"200 mm by "
        f"{200 - edge:.2f} mm",
        {"edge_mm": edge},
        printed="200 mm",
    )


def wanted_size(edge: float) -> Statement:
    """The cube that the application asks for."""
    return Statement(
        "5.2",
        "for selection treatment required workspace 200×200×200 mm³",
        f"{edge:.2f} mm (revised)",
        Verdict.DIFFERS,
        "§5.1 requires 0.5 m × 0.5 m × 0.5 m, and §5.3 says that the original's 200 mm are too small; 200 "
        "is a "
        "misprint. The revised machine reaches the factors 0.5–2 in a cube of this edge, "
        f"{500 - edge:.2f} mm short of 500 (L = 776.5 mm would do)",
        {"edge_mm": edge},
        printed="200 mm",
    )


def speed(original: Machine) -> Statement:
    """Speed at the isotropic point: the Jacobian there is the identity."""
    f = factors(original, np.zeros(3))
    return Statement(
        "5.2",
        "Cartesian velocity … in the isotropic point of 1.2 m/s",
        f"{f[0]:.6f} … {f[-1]:.6f} times the drive's speed",
        judge(bool(np.allclose(f, 1, atol=1e-6))),
        "there every drive moves the tool at its own speed; the drives' 1.2 m/s are our declaration, "
        "taken from "
        "this sentence",
        {"largest_factor": float(f[0]), "smallest_factor": float(f[-1])},
        printed="1.2 m/s",
        own_input=True,
    )


def transmission(original: Machine) -> Statement:
    """Factors over the declared workspace box."""
    low, high = box_factors(original, original.workspace)
    corner = 1e3 * original.workspace[0, 0]
    return Statement(
        "5.2",
        "transmission factor range 0.5–2.0",
        f"{low:.3f} … {high:.3f}",
        judge(low >= LOW and high <= HIGH),
        f"singular values of the Jacobian over the workspace box; the largest is at x = y = z = "
        f"{corner:g} mm. "
        "Within 0.5–2 the box must end at -L/√18 and L/√6",
        {"smallest_factor": low, "largest_factor": high},
        printed="0.5 … 2.0",
    )


def geometry(original: Machine) -> Statement:
    """The lengths are ours as well: what the model's kinematics return."""
    rho = inverse_kinematics(original, np.array([[0, 0, 0], [0, 0.1, 0]])).actuators[:, 0]
    # rho = x - r - sqrt(L² - y² - z²): two positions give r and L.
    d, y = rho[1] - rho[0], 0.1
    length = (y**2 + d**2) / (2 * d)
    r = -rho[0] - length
    ok = rounds_to(1e3 * length, "310.0") and rounds_to(1e3 * r, "31.0")
    return Statement(
        "5.2",
        "L = 310 mm, d = 100 mm, r = 31 mm",
        f"L = {1e3 * length:.6g} mm, r = {1e3 * r:.6g} mm",
        judge(ok),
        "found again from the inverse kinematics of our model; d does not enter them",
        {"L_mm": 1e3 * length, "r_mm": 1e3 * r},
        printed="L = 310 mm, r = 31 mm",
        own_input=True,
    )


def too_small(edge: float) -> Statement:
    """Why the machine is revised."""
    return Statement(
        "5.3",
        "the workspace of the Orthoglide manipulator is lower than required for milling",
        f"{edge:.2f} mm < 500 mm",
        judge(edge < 500),
        "§5.1 requires cubes of 0.5 m",
        {"edge_mm": edge},
        printed="200 mm < 500 mm",
    )
