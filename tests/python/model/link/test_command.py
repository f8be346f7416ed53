"""stiffmap link, run through its command; and each bad part, mesh and face with its one error."""

from __future__ import annotations

import json
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from tests.python.model.link.link_fields import REFERENCE, WRENCHES, noisy_field

from stiffmap.common.errors import StiffmapError
from stiffmap.model.link import load_link
from stiffmap.model.link.gmshmesh import gmsh_session, mesh_file
from stiffmap.model.link.identify import identify_link
from stiffmap.model.link.mesh import checked_mesh
from stiffmap.model.link.readers import read_field, read_listing
from stiffmap.model.link.solve import Material, Setup, ccx_input, has_ccx, solve_ccx, solve_skfem
from stiffmap.ui.cli import main

PART = """
units: {length: mm, stress: GPa}
part: {shape: bar, length: 60, width: 10, height: 20}
material: {young: 210, poisson: 0.3}
"""
CASES = "fx [N],fy [N],fz [N],mx [N*m],my [N*m],mz [N*m]\n" + "\n".join(
    ",".join(map(repr, w)) for w in WRENCHES.tolist()
)


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        code = main(["link", *arguments])
        said = capsys.readouterr()
        return SimpleNamespace(exit_code=code, output=said.out + said.err)

    return run


@pytest.fixture
def fea():
    pytest.importorskip("gmsh", reason="needs the extra [fea]", exc_type=(ImportError, OSError))
    pytest.importorskip("skfem", reason="needs the extra [fea]")


def write_field(path):
    points, u = noisy_field(n=12)
    names = ["node", *(f"{a} [m]" for a in "xyz"), *(f"u{a} [m]" for _ in range(6) for a in "xyz")]
    rows = [",".join(map(repr, [i + 1, *points[i].tolist(), *u[:, i].ravel().tolist()])) for i in range(12)]
    path.write_text(",".join(names) + "\n" + "\n".join(rows))
    return points, u


def test_part_to_link_file_and_picture(run, tmp_path, fea):
    (tmp_path / "bar.yaml").write_text(PART)
    arguments = ("bar.yaml", "--quick", "--size", "6", "--solver", "skfem")
    done = run(*arguments, "--out", "l.yaml", "--picture", "l.png")
    assert done.exit_code == 0, done.output
    assert "k66" in done.output
    assert "scikit-fem" in done.output
    link = load_link(tmp_path / "l.yaml")
    assert link.compliance[5, 5] == pytest.approx(0.06 / (210e9 * 0.02 * 0.01**3 / 12), rel=0.02)
    assert (tmp_path / "l.png").stat().st_size > 20_000
    data = json.loads(run(*arguments, "--json").output)
    assert data["compliance"] == pytest.approx(link.compliance)
    assert data["order"] is None
    assert data["order_note"] == "one mesh"


def test_field_to_spring(run, tmp_path):
    points, u = write_field(tmp_path / "field.csv")
    (tmp_path / "cases.csv").write_text(CASES)
    done = run("field.csv", "--cases", "cases.csv", "--reference", "310,0,0", "--json", "--picture", "f.png")
    assert done.exit_code == 0, done.output
    expected = identify_link(points, u, WRENCHES, reference=REFERENCE)
    assert np.array(json.loads(done.output)["compliance"]) == pytest.approx(expected.compliance, rel=1e-9)


def reactions(w):
    return -w


def swapped(w):
    return w[[3, 4, 5, 0, 1, 2]]


def turned(w):
    return w[:, [1, 2, 0, 3, 4, 5]]


@pytest.mark.parametrize("mistake", [reactions, swapped, turned])
def test_loads_that_leave_no_spring_are_a_finding_in_text_and_in_json(run, tmp_path, mistake):
    write_field(tmp_path / "field.csv")
    rows = [",".join(map(repr, w)) for w in mistake(WRENCHES).tolist()]
    (tmp_path / "cases.csv").write_text("\n".join([CASES.splitlines()[0], *rows]))
    arguments = ("field.csv", "--cases", "cases.csv", "--reference", "310,0,0")
    done, as_json = run(*arguments), run(*arguments, "--json")
    assert done.exit_code == as_json.exit_code == 1
    problem = json.loads(as_json.output)["problem"]
    assert "compliance: expected" in problem
    assert problem in done.output


def test_help_has_examples(run):
    assert "stiffmap link bar.yaml" in run("--help").output


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("absent.yaml",), "absent.yaml: no such file"),
        (("part.doc",), "part.doc: expected one of"),
        (("part.step",), "the part has no material; give --material"),
        (("part.step", "--material", "steel", "--reference", "0,0,0"), "part.step: no such file"),
        (("part.step", "--material", "wood"), "material: expected one of"),
        (("field.csv",), "needs --cases FILE and --reference"),
        (
            ("bar.yaml", "--reference", "1,2"),
            "--reference: expected 3 numbers separated by commas, got '1,2'",
        ),
        (("bar.yaml", "--solver", "magic"), "solver: expected auto, ccx or skfem"),
        (("bar.yaml", "--support", "air"), "support: expected bed or soft, got 'air'"),
        (("bar.yaml", "--cases", "absent.csv"), "absent.csv: no such file"),
    ],
)
def test_bad_arguments_exit_with_two_and_one_line(run, tmp_path, arguments, words):
    (tmp_path / "bar.yaml").write_text(PART)
    done = run(*arguments)
    assert done.exit_code == 2
    assert words in done.output
    assert len(done.output.strip().splitlines()) == 1


def test_a_connection_that_is_closed_after_meshing_ends_no_process(fea):
    code = """
import socket, threading
from stiffmap.model.link.gmshmesh import gmsh_session
def mesh():
    with gmsh_session() as gmsh:
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
for call in (mesh, lambda: [t.start() or t.join() for t in [threading.Thread(target=mesh)]]):
    call()
    here, there = socket.socketpair()
    there.close()
    try:
        here.send(b"x")
    except BrokenPipeError:
        print("an error")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "an error\nan error\n"), done.stderr[-500:]


def test_unknown_face_lists_those_that_exist(run, tmp_path, fea):
    (tmp_path / "bar.yaml").write_text(PART)
    done = run("bar.yaml", "--fixed", "left", "--quick", "--size", "8", "--solver", "skfem")
    assert done.exit_code == 2
    assert "no face 'left' on this part; it has fixed (200 mm² at" in done.output


@pytest.mark.parametrize("size", ["0", "-4", "nan"])
def test_elements_have_a_size(run, tmp_path, size):
    (tmp_path / "bar.yaml").write_text(PART)
    done = run("bar.yaml", "--size", size)
    assert done.exit_code == 2
    assert f"--size: expected an edge length above 0, got {size}" in done.output


def test_number_of_cases_must_match(run, tmp_path):
    write_field(tmp_path / "field.csv")
    (tmp_path / "cases.csv").write_text("\n".join(CASES.splitlines()[:5]))
    done = run("field.csv", "--cases", "cases.csv", "--reference", "310,0,0")
    assert done.exit_code == 2
    assert "has 6 load cases, --cases has 4" in done.output


def test_step_and_msh_of_one_bar_agree(tmp_path, fea):
    with gmsh_session() as gmsh:
        gmsh.model.occ.addBox(0, 0, 0, 60, 10, 20)
        gmsh.model.occ.synchronize()
        gmsh.write(str(tmp_path / "bar.step"))
        gmsh.model.addPhysicalGroup(3, [1], name="solid")
        gmsh.model.addPhysicalGroup(2, [1], name="held")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 6)
        gmsh.option.setNumber("Mesh.SaveAll", 1)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(tmp_path / "bar.msh"))
    step, msh = mesh_file(tmp_path / "bar.step", 0.006), mesh_file(tmp_path / "bar.msh", unit="mm")
    assert step.volume() == pytest.approx(1.2e-5, rel=1e-9)
    assert msh.volume() == pytest.approx(1.2e-5, rel=1e-9)
    assert set(step.faces) == {f"face{i}" for i in range(1, 7)}
    assert "held" in msh.faces
    with pytest.raises(StiffmapError, match="a mesh file has no units; give --unit"):
        mesh_file(tmp_path / "bar.msh")
    (tmp_path / "broken.step").write_text("not a step file")
    with pytest.raises(StiffmapError, match=r"gmsh: |expected a part with a volume"):
        mesh_file(tmp_path / "broken.step")


CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
EDGES = [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]


def one_tet(corners):
    nodes = np.vstack([corners, [(corners[a] + corners[b]) / 2 for a, b in EDGES]])
    return nodes, np.arange(10)[None]


def test_mesh_with_zero_volume_elements_is_refused():
    nodes, tets = one_tet(CORNERS * [1, 1, 0])
    with pytest.raises(StiffmapError, match="1 of 1 elements have zero volume, first element 1"):
        checked_mesh(nodes, tets, {})
    nodes, tets = one_tet(CORNERS)
    nodes[2, 1] = np.nan
    with pytest.raises(StiffmapError, match="finite node coordinates"):
        checked_mesh(nodes, tets, {})
    with pytest.raises(StiffmapError, match="ten-node tetrahedra, found none"):
        checked_mesh(nodes, tets[:0], {})


def test_inverted_element_is_turned_and_unused_nodes_are_dropped():
    nodes, tets = one_tet(CORNERS[[0, 2, 1, 3]])
    mesh = checked_mesh(np.vstack([nodes, [[9, 9, 9]]]), tets, {"a": np.array([[0, 1, 2, 4, 5, 6]])})
    assert mesh.volume() == pytest.approx(1 / 6)
    assert len(mesh.nodes) == 10
    middle = [(mesh.nodes[mesh.tets[0, a]] + mesh.nodes[mesh.tets[0, b]]) / 2 for a, b in EDGES]
    assert mesh.nodes[mesh.tets[0, 4:]] == pytest.approx(np.array(middle))


def test_part_that_is_not_held_is_refused(fea):
    """Two separate tetrahedra, one of them free: the solver must not return a number."""
    a, b = one_tet(CORNERS)[0], one_tet(CORNERS + 3)[0]
    face = {"fixed": np.array([[0, 1, 2, 4, 5, 6]]), "loaded": np.array([[10, 11, 12, 14, 15, 16]])}
    mesh = checked_mesh(np.vstack([a, b]), np.arange(20).reshape(2, 10), face)
    with pytest.raises(StiffmapError, match=r"solver: (not converged|the stiffness matrix is singular)"):
        solve_skfem(mesh, Material(1e9, 0.3), Setup("fixed", "loaded", np.zeros(3)), np.eye(6))


def test_unsolved_calculix_run_is_refused():
    if not has_ccx():
        pytest.skip("CalculiX (ccx) is not installed")
    nodes, tets = one_tet(CORNERS)
    mesh = checked_mesh(nodes, tets, {k: np.array([[0, 1, 2, 4, 5, 6]]) for k in ("fixed", "loaded")})
    with pytest.raises(StiffmapError, match="ccx stopped") as error:
        solve_ccx(mesh, Material(0.0, 0.3), Setup("fixed", "loaded", np.zeros(3)), np.eye(6))
    assert "\n" not in str(error.value)


def test_frd_of_a_calculix_run_is_read(tmp_path):
    """The file that ccx itself writes, against its .dat of the same run."""
    if not has_ccx():
        pytest.skip("CalculiX (ccx) is not installed")
    nodes, tets = one_tet(CORNERS)
    face = {"fixed": np.array([[0, 2, 1, 6, 5, 4]]), "loaded": np.array([[0, 1, 3, 4, 8, 7]])}
    mesh = checked_mesh(nodes, tets, face)
    setup = Setup("fixed", "loaded", np.zeros(3))
    deck = ccx_input(mesh, Material(1e9, 0.3), setup, np.eye(6))
    deck = deck.replace("*NODE PRINT, NSET=ALL", "*NODE FILE\nU\n*NODE PRINT, NSET=ALL")
    (tmp_path / "t.inp").write_text(deck)
    subprocess.run(["ccx", "t"], cwd=tmp_path, capture_output=True, check=True)
    points, u = read_field(tmp_path / "t.frd", "m")
    _, printed = read_listing(tmp_path / "t.dat")
    assert points == pytest.approx(mesh.nodes, abs=1e-6)
    assert u.shape == (6, 10, 3)
    assert u == pytest.approx(printed, abs=2e-5 * np.abs(printed).max())


def test_bad_mesh_through_the_command(run, tmp_path, fea):
    """A volume mesh whose one element is flat, and one without material: one line each, exit code 2."""
    rows = "\n".join(f"{i + 1} {x} {y} 0" for i, (x, y) in enumerate([(0, 0), (1, 0), (0, 1), (1, 1)]))
    (tmp_path / "flat.msh").write_text(
        f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n{rows}\n$EndNodes\n"
        "$Elements\n1\n1 4 2 1 1 1 2 3 4\n$EndElements\n"
    )
    done = run("flat.msh", "--unit", "mm", "--material", "steel", "--reference", "0,0,0")
    assert done.exit_code == 2
    assert "1 of 1 elements have zero volume" in done.output
    done = run("flat.msh", "--unit", "mm", "--reference", "0,0,0")
    assert done.exit_code == 2
    assert "the part has no material" in done.output


def test_nan_in_a_field_file_through_the_command(run, tmp_path):
    write_field(tmp_path / "field.csv")
    rows = (tmp_path / "field.csv").read_text().splitlines()
    cells = rows[4].split(",")
    (tmp_path / "field.csv").write_text(
        "\n".join([*rows[:4], ",".join([*cells[:7], "nan", *cells[8:]]), *rows[5:]])
    )
    (tmp_path / "cases.csv").write_text(CASES)
    done = run("field.csv", "--cases", "cases.csv", "--reference", "310,0,0")
    assert done.exit_code == 2
    assert "field.csv, line 5: column 'ux [m]': expected a finite number; found 'nan'" in done.output


def test_missing_extra_names_the_command(monkeypatch):
    monkeypatch.setitem(sys.modules, "gmsh", None)
    with pytest.raises(StiffmapError, match=r"needs gmsh, .* pip install 'stiffmap\[fea\]'"), gmsh_session():
        pass
    monkeypatch.setattr("shutil.which", lambda _: None)
    with pytest.raises(StiffmapError, match=r"CalculiX .* is not installed"):
        solve_ccx(None, Material(1.0, 0.3), Setup("a", "b", np.zeros(3)), np.eye(6))
