"""Finite elements against closed forms, CalculiX against scikit-fem, refinement, budget."""

from __future__ import annotations

import re

import numpy as np
import pytest

pytest.importorskip("gmsh", reason="needs the extra [fea]", exc_type=(ImportError, OSError))
pytest.importorskip("skfem", reason="needs the extra [fea]")

from examples.link_bars import cantilever, rectangle, tube

from stiffmap.common.errors import StiffmapError
from stiffmap.model.link.identify import identify_link
from stiffmap.model.link.mesh import face_area_centre, face_loads
from stiffmap.model.link.pipeline import link_from_part, observed_order, richardson
from stiffmap.model.link.shapes import Bar, Foot, ForkBar, HollowBar
from stiffmap.model.link.solve import (
    Material,
    Setup,
    has_ccx,
    mean_motion,
    nodal_loads,
    solve_ccx,
    solve_skfem,
)
from stiffmap.model.link.transport import standard_errors

STEEL = Material(210e9, 0.3)
WRENCHES = np.diag([100.0, 100.0, 100.0, 10.0, 10.0, 10.0])
BAR = Bar(length=0.12, width=0.01, height=0.02)
SETUP = Setup("fixed", "loaded", BAR.reference())


@pytest.fixture(scope="module")
def mesh():
    return BAR.mesh(0.006)


def compliance(mesh, setup, material=STEEL, solve=solve_skfem):
    field = solve(mesh, material, setup, WRENCHES)
    nodes = mesh.face_nodes(setup.loaded)
    return identify_link(mesh.nodes[nodes], field[:, nodes], WRENCHES, reference=setup.reference)


def conjugate(mesh, setup):
    """Compliance from the area-weighted motion: energy theorems hold for it to round-off."""
    motion = mean_motion(mesh, setup.loaded, setup.reference, solve_skfem(mesh, STEEL, setup, WRENCHES))
    C = np.linalg.solve(WRENCHES, motion).T
    return (C + C.T) / 2


def test_mesh_has_the_volume_and_faces_of_the_bar(mesh):
    assert mesh.volume() == pytest.approx(0.12 * 0.01 * 0.02, rel=1e-9)
    area, centre = face_area_centre(mesh.nodes, mesh.face("loaded"))
    assert area == pytest.approx(0.01 * 0.02, rel=1e-9)
    assert centre == pytest.approx([0.12, 0, 0], abs=1e-9)


def test_face_loads_have_the_wrench_as_resultant(mesh):
    """Resultant and moment by summing nodal forces, which knows nothing of the quadrature."""
    W = np.random.default_rng(0).standard_normal((3, 6))
    f = nodal_loads(mesh, "loaded", SETUP.reference, W)
    arm = mesh.nodes - SETUP.reference
    for k, w in enumerate(W):
        assert f[:, :, k].sum(axis=0) == pytest.approx(w[:3], abs=1e-9)
        assert np.cross(arm, f[:, :, k]).sum(axis=0) == pytest.approx(w[3:], abs=1e-9)
    _, gram = face_loads(mesh.nodes, mesh.face("loaded"), SETUP.reference)
    assert gram[3, 3] == pytest.approx(0.01 * 0.02 * (0.01**2 + 0.02**2) / 12, rel=1e-9)


def test_soft_ends_give_saint_venants_bar(mesh):
    """Traction linear over both ends: tension and bending are exact in quadratic elements."""
    C = conjugate(mesh, SETUP._replace(support="soft"))
    beam = cantilever(rectangle(0.01, 0.02), 0.12, STEEL.young, STEEL.young / 2.6)
    for i in (0, 4, 5):
        assert C[i, i] == pytest.approx(beam[i, i], rel=1e-6)
    assert C[1, 5] == pytest.approx(beam[1, 5], rel=1e-6)
    assert C[2, 4] == pytest.approx(beam[2, 4], rel=1e-6)
    for i, height in ((1, 0.01), (2, 0.02)):  # shear adds 0.3 to 1.2 (h/L)^2 (1 + nu) over 4 to bending
        assert 0 < C[i, i] / beam[i, i] - 1 < 1.3 * (height / 0.12) ** 2
    assert C[3, 3] == pytest.approx(beam[3, 3], rel=0.03)


def test_clamped_bar_is_near_euler_bernoulli_and_stiffer_than_soft(mesh):
    clamped = conjugate(mesh, SETUP)
    soft = conjugate(mesh, SETUP._replace(support="soft"))
    rigid = conjugate(mesh, SETUP._replace(head="rigid"))
    bed = conjugate(mesh, SETUP._replace(support="bed"))
    beam = cantilever(rectangle(0.01, 0.02), 0.12, STEEL.young, STEEL.young / 2.6)
    assert np.diag(clamped) / np.diag(beam) == pytest.approx(np.ones(6), abs=0.05)
    # A bed without its mean motion holds only the face's own deformation: between held and free.
    for stiff, loose in ((clamped, bed), (bed, soft), (rigid, clamped)):
        size = np.sqrt(np.outer(np.diag(loose), np.diag(loose)))
        assert np.linalg.eigvalsh((loose - stiff) / size).min() > -1e-9  # in every direction
        assert np.all(np.diag(stiff) < np.diag(loose))


def test_rigid_head_gives_an_exactly_rigid_field(mesh):
    field = solve_skfem(mesh, STEEL, SETUP._replace(head="rigid"), WRENCHES)
    nodes = mesh.face_nodes("loaded")
    link = identify_link(mesh.nodes[nodes], field[:, nodes], WRENCHES, reference=SETUP.reference)
    assert np.all(link.sigma < 1e-9 * np.abs(field).max(axis=(1, 2)))
    assert link.asymmetry < 1e-6


def test_work_conjugate_motion_makes_a_symmetric_matrix(mesh):
    """Maxwell-Betti holds for the area-weighted motion; for the node mean it does not."""
    field = solve_skfem(mesh, STEEL, SETUP, WRENCHES)
    C = np.linalg.solve(WRENCHES, mean_motion(mesh, "loaded", SETUP.reference, field)).T
    size = np.sqrt(np.outer(np.diag(C), np.diag(C)))
    assert np.abs((C - C.T) / size).max() < 1e-8


@pytest.mark.parametrize("head", ["distributed", "rigid"])
def test_calculix_and_scikit_fem_agree(mesh, head):
    if not has_ccx():
        pytest.skip("CalculiX (ccx) is not installed")
    setup = SETUP._replace(head=head)
    ours, theirs = solve_skfem(mesh, STEEL, setup, WRENCHES), solve_ccx(mesh, STEEL, setup, WRENCHES)
    size = np.abs(ours).max(axis=(1, 2), keepdims=True)
    assert np.abs((ours - theirs) / size).max() < 2e-6  # ccx prints seven digits
    a, b = compliance(mesh, setup), compliance(mesh, setup, solve=solve_ccx)
    assert np.diag(a.compliance) == pytest.approx(np.diag(b.compliance), rel=2e-6)


def test_refinement_recovers_order_and_limit():
    sizes = np.array([4.0, 2.0, 1.0, 0.5])
    C0 = np.diag([1.0, 2, 3, 4, 5, 6])
    D = np.random.default_rng(0).uniform(0.5, 1, (6, 6))
    found = richardson(sizes, np.array([C0 - 0.01 * D * h**1.7 for h in sizes]))
    assert found.order == pytest.approx(1.7, abs=1e-6)
    assert found.estimate == pytest.approx(C0, abs=1e-9)
    assert found.error == pytest.approx(0.01 * D * 0.5**1.7, rel=1e-6)
    assert np.isnan(observed_order(sizes, np.array([1.0, 0.9, 1.1, 1.0])))
    two = richardson(sizes[-2:], np.array([C0 - 0.01 * D * h for h in sizes[-2:]]))
    assert two.error == pytest.approx(0.01 * D * 0.5)  # order one assumed: right when it is one
    assert np.array_equal(two.estimate, C0 - 0.01 * D * 0.5)
    with pytest.raises(StiffmapError, match="at least two falling mesh sizes"):
        richardson(sizes[:1], np.zeros((1, 6, 6)))


@pytest.mark.parametrize(
    ("sizes", "trace", "words"),
    [
        ([4, 2, 1], [1.0, 0.9, 0.95], r"none \(the meshes' trace changes by -1.1e-01, \+5.3e-02 of itself"),
        ([4, 2, 1], [1.0, 1.0, 1.1], r"none \(the meshes' trace changes by \+0.0e\+00"),
        ([2, 1], [0.9, 0.95], r"none \(only two meshes differ in size\)"),
        ([4, 2, 1], [0.0, 0.99, 1.0], r"none \(6.63 is outside 0.5 to 5\)"),
        ([4, 2, 1], [0.2, 0.8, 0.95], r"2.00"),
    ],
)
def test_a_missing_order_says_why(sizes, trace, words):
    found = richardson(np.array(sizes, dtype=float), np.array([t * np.eye(6) for t in trace]))
    assert re.match(words, found.words)
    assert words == "2.00" or "order one is assumed" in found.words


def test_richardson_error_covers_the_finer_mesh():
    """Three meshes predict a fourth, finer one within twice their stated mesh error."""
    bar = Bar(length=0.06, width=0.01, height=0.02)
    setup = SETUP._replace(reference=bar.reference())
    meshes = [bar.mesh(s) for s in (0.01, 0.006, 0.004, 0.0025)]
    C = np.array([compliance(m, setup).compliance for m in meshes])
    found = richardson(np.array([m.size() for m in meshes[:3]]), C[:3])
    off = np.abs(np.diag(C[3] - C[2]))
    assert np.all(off <= 2 * np.diag(found.error) + 1e-4 * np.diag(C[3]))
    assert np.all(np.diag(C[3]) >= np.diag(C[0]) * (1 - 1e-3))  # refinement makes the bar softer


def test_budget_lists_its_sources_and_the_file_carries_their_sum():
    bar = Bar(length=0.06, width=0.01, height=0.02)
    part = link_from_part(
        bar.mesh, STEEL, SETUP._replace(reference=bar.reference()), WRENCHES, size=0.003, solver="skfem"
    )
    assert set(part.covariances) == {"fit", "region", "mesh", "boundary"}
    V = sum(part.covariances.values())
    file = part.file("test")
    assert np.array_equal(file.covariance, V)
    assert np.linalg.eigvalsh(V).min() > -1e-12 * np.linalg.eigvalsh(V).max()
    assert file.provenance["solver"] == "scikit-fem"
    assert "boundary" in part.table()
    beam = cantilever(rectangle(0.01, 0.02), 0.06, STEEL.young, STEEL.young / 2.6)
    off = np.abs(np.diag(part.link.compliance - beam))
    shear = np.array([0, 0.012, 0.05, 0, 0, 0]) * np.diag(beam)  # not in Euler-Bernoulli
    assert np.all(off < 3 * np.diag(standard_errors(part.covariance)) + shear)


@pytest.mark.parametrize(
    ("shape", "volume"),
    [
        (HollowBar(length=0.1, width=0.02, height=0.03, wall=0.003), 0.1 * (0.02 * 0.03 - 0.014 * 0.024)),
        (
            Foot(height=0.1, upright=0.03, depth=0.04, base=0.06, plate=0.02),
            0.04 * (0.06 * 0.02 + 0.08 * 0.03),
        ),
        (
            ForkBar(length=0.1, width=0.02, height=0.02, wall=0, fork=0.02, prong=0.005, gap=0.01, hole=0.01),
            None,
        ),
    ],
)
def test_parametric_shapes_mesh_and_solve(shape, volume):
    mesh = shape.mesh(0.012)
    if volume is not None:
        assert mesh.volume() == pytest.approx(volume, rel=1e-6)
    C = compliance(mesh, Setup("fixed", "loaded", shape.reference())).compliance
    size = np.sqrt(np.outer(np.diag(C), np.diag(C)))
    assert np.linalg.eigvalsh(C / size).min() > 0.01


def test_fork_loads_enter_through_the_pin_holes():
    fork = ForkBar(length=0.1, width=0.02, height=0.02, wall=0, fork=0.02, prong=0.005, gap=0.01, hole=0.01)
    mesh = fork.mesh(0.008)
    at = mesh.nodes[mesh.face_nodes("loaded")]
    radius = np.hypot(at[:, 0] - 0.1, at[:, 2])
    assert radius == pytest.approx(np.full(len(at), 0.005), abs=2e-5)
    assert {tuple(np.round(np.unique(np.sign(at[:, 1])), 0))} == {(-1.0, 1.0)}


def test_tube_formula_is_the_outer_less_the_inner_rectangle():
    assert tube(0.02, 0.03, 0.002).about_height == pytest.approx((0.03 * 0.02**3 - 0.026 * 0.016**3) / 12)


def test_torsion_series_has_the_textbook_value():
    assert rectangle(1.0, 1.0).torsion == pytest.approx(0.140577, abs=1e-6)
    assert rectangle(1.0, 2.0).torsion == pytest.approx(2 * 0.228682, abs=2e-6)


def test_the_fits_share_is_that_of_the_nodes():
    """A pin hole that deforms as a whole: its rigid motion hardly depends on which nodes sample it, as another
    mesh shows, while the correlation model takes the deformation for noise."""
    bar = ForkBar(
        length=0.12, width=0.01, height=0.02, wall=0.003, fork=0.016, prong=0.004, gap=0.008, hole=0.008
    )
    setup = Setup("fixed", "loaded", bar.reference())
    parts = [
        link_from_part(bar.mesh, STEEL, setup, WRENCHES, size=s, solver="skfem", study=False, refine=False)
        for s in (0.009, 0.008)
    ]
    a, b = (p.link.compliance[0, 0] for p in parts)
    share = standard_errors(parts[0].covariances["fit"])[0, 0]
    assert parts[0].link.evidence.correlation.correlated
    assert share < 0.3 * parts[0].link.standard_error[0, 0]
    assert abs(a - b) < 2 * share
