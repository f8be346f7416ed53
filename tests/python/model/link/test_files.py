"""Fields, part files, case files and link files: read, written, and each bad one with its one error."""

from __future__ import annotations

import re

import numpy as np
import pytest
from tests.python.model.link.link_fields import REFERENCE, WRENCHES, bar_compliance, noisy_field

from stiffmap.common.errors import StiffmapError
from stiffmap.model.link import LinkFile, load_link, save_link
from stiffmap.model.link.identify import identify_link
from stiffmap.model.link.inputs import read_cases, read_material, read_part
from stiffmap.model.link.readers import read_field, read_frd, read_listing

POINTS, U = noisy_field(n=10)


def csv_text(unit="mm", factor=1e3):
    names = ["node", *(f"{a} [{unit}]" for a in "xyz"), *(f"u{a} [{unit}]" for _ in range(6) for a in "xyz")]
    rows = [
        ",".join(
            map(repr, [float(i + 1), *(factor * POINTS[i]).tolist(), *(factor * U[:, i]).ravel().tolist()])
        )
        for i in range(10)
    ]
    return "# a field\n" + ",".join(names) + "\n" + "\n".join(rows) + "\n"


def dat_text():
    blocks = []
    for u in U[:2]:
        rows = "\n".join(f"{i + 1:>10d} " + "".join(f"{v:14.6E}" for v in row) for i, row in enumerate(u))
        blocks.append(f" displacements (vx,vy,vz) for set ALL and time  0.1000000E+01\n\n{rows}\n")
    return "\n".join(blocks)


def frd_text():
    head = "    1C\n    2C" + " " * 18 + "10\n"
    row = lambda i, v: f" -1{i + 1:10d}" + "".join(f"{x:12.5E}" for x in v)  # noqa: E731
    text = head + "\n".join(row(i, p) for i, p in enumerate(POINTS)) + "\n -3\n"
    for u in U[:2]:
        text += " -4  DISP        4    1\n -5  D1          1    2    1    0\n"
        text += "\n".join(row(i, v) for i, v in enumerate(u)) + "\n -3\n"
    return text + " 9999\n"


def ansys_text():
    text = ""
    for step, u in enumerate(U[:2], 1):
        for page in (range(5), range(5, 10)):
            text += f"\n PRINT U NODAL SOLUTION PER NODE\n  LOAD STEP= {step}  SUBSTEP= 1\n"
            text += "    NODE       UX           UY           UZ           USUM\n"
            for i in page:
                text += f"{i + 1:9d}" + "".join(f"{v:13.5E}" for v in [*u[i], np.linalg.norm(u[i])]) + "\n"
        text += "\n MAXIMUM ABSOLUTE VALUES\n NODE          3            1            4            3\n"
    return text


def test_csv_field_comes_back_in_metres(tmp_path):
    for text in (csv_text(), csv_text("m", 1.0), csv_text("m", 1.0).replace(" [m]", "_m")):
        (tmp_path / "f.csv").write_text(text)
        p, u = read_field(tmp_path / "f.csv")
        assert p == pytest.approx(POINTS, rel=1e-12)
        assert u == pytest.approx(U, rel=1e-12)


def test_dat_frd_and_ansys_hold_the_same_field(tmp_path):
    (tmp_path / "a.dat").write_text(dat_text())
    (tmp_path / "a.frd").write_text(frd_text())
    (tmp_path / "a.lis").write_text(ansys_text())
    (tmp_path / "nodes.txt").write_text(
        "\n".join(f"{i + 1} {x} {y} {z}" for i, (x, y, z) in enumerate(POINTS))
    )
    for numbers, fields in (read_listing(tmp_path / "a.dat"), read_listing(tmp_path / "a.lis")):
        assert numbers.tolist() == list(range(1, 11))
        assert fields == pytest.approx(U[:2], rel=1e-5)
    p, fields = read_frd(tmp_path / "a.frd")
    assert p == pytest.approx(POINTS, rel=1e-5)
    assert fields == pytest.approx(U[:2], rel=1e-5)
    p, u = read_field(tmp_path / "a.dat", "mm", tmp_path / "nodes.txt")
    assert p == pytest.approx(1e-3 * POINTS)
    assert u == pytest.approx(1e-3 * U[:2], rel=1e-5)


def abaqus_report(frames=2, part="BAR-1", turns=""):
    text = ""
    for u in U[:frames]:
        text += f"Field Output Report\n\nSource 1\n---------\n   Step: load\n\nField Output reported at nodes for part: {part}\n\n"
        text += (
            "            Node            U.U1            U.U2            U.U3"
            + ("".join(f"          UR.UR{i}" for i in (1, 2, 3)) if turns else "")
            + "\n"
        )
        text += "           Label          @Loc 1          @Loc 1          @Loc 1\n" + "-" * 65 + "\n"
        text += "".join(
            f"{i + 1:16d}" + "".join(f"{1e6 * v:15.6f}E-06" for v in row) + turns + "\n"
            for i, row in enumerate(u)
        )
        text += "\n\n  Minimum           -2.6E-03    -806.3E-06    -49.4E-03\n      At Node                  1               2               1\n"
    return text


def abaqus_printed():
    text = " THE FOLLOWING TABLE IS PRINTED FOR ALL NODES\n"
    for u in U[:2]:
        text += "\n       NODE FOOT-  U1             U2             U3\n            NOTE\n\n"
        text += "".join(
            f"{i + 1:11d}     " + "".join(f"{v:15.6E}" for v in row) + "\n" for i, row in enumerate(u)
        )
        text += (
            "\n MAXIMUM         5.0E-03   1.0E-03   2.0E-03\n AT NODE               2         3         4\n"
        )
    return text


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.rpt", abaqus_report()),
        ("a.txt", abaqus_report(turns="    1.E-06    -0.    -2.5E-06")),
        ("a.dat", abaqus_printed()),
    ],
)
def test_listings_of_abaqus(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    places = "".join(f"{i + 1}, {x}, {y}, {z}\n" for i, (x, y, z) in enumerate(POINTS))
    (tmp_path / "bar.inp").write_text(f"*NODE\n{places}*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n")
    p, u = read_field(tmp_path / name, "mm", tmp_path / "bar.inp")
    assert p == pytest.approx(1e-3 * POINTS)
    assert u == pytest.approx(1e-3 * U[:2], rel=1e-5, abs=1e-15)


def test_parts_of_abaqus_number_their_own_nodes(tmp_path):
    (tmp_path / "a.rpt").write_text(abaqus_report(1) + abaqus_report(1, "FOOT-1"))
    with pytest.raises(StiffmapError, match=r"nodes of one part.*found part: BAR-1, part: FOOT-1"):
        read_field(tmp_path / "a.rpt", "mm", tmp_path / "bar.inp")


@pytest.mark.parametrize("name", ["a.vtu", "a.vtk"])
def test_vtu_and_vtk_through_meshio(tmp_path, name):
    meshio = pytest.importorskip("meshio", reason="needs the extra [fea]")
    data = {f"case{k}": u for k, u in enumerate(U)}
    meshio.Mesh(POINTS, [("vertex", np.arange(10)[:, None])], point_data=data).write(tmp_path / name)
    p, u = read_field(tmp_path / name, "m")
    assert np.array_equal(p, POINTS)
    assert np.array_equal(u, U)
    assert read_field(tmp_path / name, "mm")[1] == pytest.approx(1e-3 * U, rel=1e-15)


def write(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    return tmp_path / name


@pytest.mark.parametrize(
    ("name", "text", "unit", "words"),
    [
        (
            "a.csv",
            csv_text().replace("ux [mm]", "ux"),
            None,
            "line 2: ux: the unit is missing: write ux .mm.",
        ),
        ("a.csv", csv_text().replace("uz [mm]", "uw [mm]", 1), None, "ux, uy, uz once per load case"),
        (
            "a.csv",
            csv_text().replace("\n2.0,", "\ntwo,"),
            None,
            "line 4: column 'node': expected a number; found 'two'",
        ),
        (
            "a.csv",
            csv_text() + csv_text().splitlines()[-1].rpartition(",")[0] + ",9\n",
            None,
            "node 10 is there twice, with",
        ),
        ("a.csv", csv_text() + "11.0,1\n", None, "line 13: expected 22 values, found 2"),
        ("a.dat", dat_text(), None, "no units; give --unit"),
        ("a.dat", dat_text(), "mm", "give the coordinates with --nodes"),
        ("a.dat", "nothing\n", "mm", "expected nodal displacements, found none"),
        ("a.frd", frd_text().replace("    2C", "    3C"), "mm", "a displacement and no coordinates"),
        ("a.xyz", "", "mm", "expected .csv"),
    ],
)
def test_bad_field_files(tmp_path, name, text, unit, words):
    with pytest.raises(StiffmapError, match=words) as error:
        read_field(write(tmp_path, name, text), unit)
    assert "\n" not in str(error.value)


NODES = "".join(f"{i + 1}, {a:.9g}, {b:.9g}, {c:.9g}\n" for i, (a, b, c) in enumerate(POINTS))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_other_tables_and_sections_of_a_deck_are_none_of_the_field(tmp_path, encoding):
    forces = "\n forces (fx,fy,fz) for set ALL and time  0.1E+01\n\n         1  1.0E+02  2.0E+02  3.0E+02\n\n displ"
    nodes = NODES.replace("\n5,", "\n** more\n*Node\n5,")
    deck = f"** a part\n*NODE, NSET=ALL\n{nodes}*ELEMENT, TYPE=S3\n1, 8, 9, 10\n*NODE PRINT\nU\n"
    (tmp_path / "a.dat").write_text(dat_text().replace("\n displ", forces) + forces[:-6], encoding=encoding)
    (tmp_path / "a.inp").write_text(deck, encoding=encoding)
    points, fields = read_field(tmp_path / "a.dat", "m", tmp_path / "a.inp")
    np.testing.assert_allclose(points, POINTS, rtol=1e-8)
    np.testing.assert_allclose(fields, U[:2], rtol=1e-6)


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("nan nan nan", "expected a node and three numbers, found 5 nan nan nan"),
        ("1.0E-3 2.0E-3", "found 5 1.0E-3 2.0E-3"), ("******** ******** ********", r"found 5 \*\*\*"),
        ("1.0 2.0 3.0\n5 1.0 2.0 4.0", r"node 5 is there twice, with \[1.0, 2.0, 3.0\] and with \[1.0, 2.0, 4.0\]"),
    ],
)  # fmt: skip
def test_no_row_of_a_listing_is_passed_over(tmp_path, row, words):
    (tmp_path / "a.dat").write_text(re.sub(r"(?m)^ +5 .*$", f"5 {row}", dat_text()))
    (tmp_path / "a.inp").write_text(NODES)
    with pytest.raises(StiffmapError, match=rf"a\.dat: .*{words}"):
        read_field(tmp_path / "a.dat", "m", tmp_path / "a.inp")


def listing(tmp_path, text, nodes=NODES, name="a.lis"):
    (tmp_path / name).write_text(text)
    (tmp_path / "a.inp").write_text(nodes)
    return read_field(tmp_path / name, "m", tmp_path / "a.inp")


@pytest.mark.parametrize(
    "head", ["    NODE       FX           FY           FZ", " PRINT F REACTION", "*** NOTE ***"]
)
def test_what_follows_displacements_is_none(tmp_path, head):
    short = "\n".join(ansys_text().splitlines()[:6])
    rows = [int(m[1]) for m in re.finditer(r"(?m)^ +(\d+) ", short)]
    points, _ = listing(tmp_path, f"{short}\n{head}\n\n       10  70.0  50.0  1.0\n")
    assert len(rows) > 0
    assert points == pytest.approx(POINTS[[r - 1 for r in rows]], rel=1e-8)


@pytest.mark.parametrize("axes", ["COORDINATE SYSTEM   1", "COORDINATE SYSTEM  11", "THE LOCAL SYSTEM"])
def test_results_in_other_axes_are_refused(tmp_path, axes):
    head = "  THE FOLLOWING DEGREE OF FREEDOM RESULTS ARE IN {}\n"
    with pytest.raises(StiffmapError, match=f"global system .RSYS,0., found: RESULTS ARE IN {axes}"):
        listing(tmp_path, head.format(axes) + ansys_text())
    for same in ("THE GLOBAL COORDINATE SYSTEM", "COORDINATE SYSTEM   0"):
        np.testing.assert_allclose(listing(tmp_path, head.format(same) + ansys_text())[1], U[:2], rtol=1e-5)


@pytest.mark.parametrize(
    "lines", ["*NODE, SYSTEM=C\n", "*System\n1, 0, 0\n*NODE\n", "*Instance, part=A\n 1., 0, 0\n*NODE\n"]
)
def test_coordinates_in_other_axes_are_refused(tmp_path, lines):
    with pytest.raises(StiffmapError, match=r"a\.inp: expected coordinates in the global frame, found \*"):
        listing(tmp_path, ansys_text(), lines + NODES)


@pytest.mark.parametrize("head", ["node,z [mm],y [mm],x [mm]", "NODE Z Y X", "x, z, y in mm"])
def test_coordinates_in_another_order_are_refused(tmp_path, head):
    with pytest.raises(StiffmapError, match=rf"order node, x, y, z; found {re.escape(head)}"):
        listing(tmp_path, ansys_text(), f"{head}\n{NODES}")


def test_coordinates_with_decimal_commas(tmp_path):
    nodes = "node;x [m];y [m];z [m]\n" + NODES.replace(",", ";").replace(".", ",")
    points, _ = listing(tmp_path, ansys_text(), nodes)
    np.testing.assert_allclose(points, listing(tmp_path, ansys_text())[0], rtol=0)


def test_sets_of_nodes_make_one_case(tmp_path):
    head, *rows = dat_text().split("\n displ")[1].splitlines()
    rows = [r for r in rows if r.strip()]
    one, other = ("\n".join(part) for part in (rows[:4], rows[4:]))
    _, fields = listing(tmp_path, f" displ{head}\n{one}\n\n displ{head}\n{other}\n", name="a.dat")
    np.testing.assert_allclose(fields, U[1:2], rtol=1e-6)


@pytest.mark.parametrize("name", ["case{}", "{} u [mm]", "load_{}_step_1"])
def test_cases_of_a_mesh_come_by_their_numbers(tmp_path, name):
    meshio = pytest.importorskip("meshio", reason="needs the extra [fea]")
    data = {name.format(k): k * U[0] for k in range(1, 13)}
    mesh = meshio.Mesh(POINTS, [("vertex", np.arange(10)[:, None])], point_data=data)
    mesh.write(tmp_path / "a.vtu")
    np.testing.assert_allclose(read_field(tmp_path / "a.vtu", "m")[1], [*data.values()])


def test_names_above_the_cases_of_a_table_change_nothing(tmp_path):
    text = csv_text()
    width = text.splitlines()[1].count(",") + 1
    cells = [f"Case {k // 3}" if k % 3 == 1 and k > 3 else "" for k in range(width)]
    _, u = read_field(write(tmp_path, "a.csv", ",".join(cells) + "\n" + text.partition("\n")[2]))
    np.testing.assert_allclose(u, U, rtol=1e-12)


def test_missing_field_file():
    with pytest.raises(StiffmapError, match="no such file"):
        read_field("absent.csv")


def test_cases_come_in_si(tmp_path):
    path = write(tmp_path, "c.csv", "fx [N],fy [kN],fz [N],mx [N*mm],my [N*m],mz [Nmm]\n1,2,3,4,5,6\n")
    assert read_cases(path) == pytest.approx(np.array([[1, 2000, 3, 0.004, 5, 0.006]]))


SPELLINGS = {
    "decimal commas": lambda t: t.replace(",", ";").replace(".", ","),
    "tabs": lambda t: t.replace(",", "\t"),
    "a mark of UTF-8": lambda t: "\ufeff" + t,
    "lines above": lambda t: "Export of the FEA\nModel: bar\n\n" + t,
    "units behind a bar": lambda t: t.replace(" [", "_").replace("]", ""),
    "quoted names": lambda t: "".join(f'"{w}"' if "[" in w else w for w in re.split("([,\n])", t)),
    "a comma at each end": lambda t: t.replace("\n", ",\n"),
}


def blocks(title="Load case {k}", order=range(1, 7)):
    """A block for each load case, below its title."""
    head, *rows = (line.split(",") for line in csv_text().removeprefix("# a field\n").splitlines())
    parts = []
    for k, of in zip(order, range(4, 22, 3), strict=True):
        cut = ["\t".join(row[:4] + row[of : of + 3]) for row in (head, *rows)]
        parts.append("\n".join([title.format(k=k), *cut]))
    return "\n\n".join(parts) + "\n"


NAMES = {
    "Workbench": ("Node Number", "{} Location (mm)", "Directional Deformation {} (mm)"),
    "words": ("Knoten-Nr", "{} [mm]", "Verschiebung {} [mm]"),
    "Abaqus": ("Node Label", "COORD-COOR{} [mm]", "U-U{} [mm]"),
}


@pytest.mark.parametrize("names", NAMES.values(), ids=NAMES)
def test_names_of_other_programs(tmp_path, names):
    node, place, moved = names
    axes = "123" if "COOR" in place else "XYZ"
    head = [node, *map(place.format, axes), *(moved.format(a) for _ in range(6) for a in axes)]
    rows = csv_text().splitlines()[2:]
    for name, separator in (("f.csv", ","), ("f.txt", "\t")):
        text = "\n".join([",".join(head), *rows]).replace(",", separator) + "\n"
        points, u = read_field(write(tmp_path, name, text))
        np.testing.assert_allclose(points, POINTS, rtol=1e-15)
        np.testing.assert_allclose(u, U, rtol=1e-15)


def test_load_cases_below_their_titles(tmp_path):
    points, u = read_field(write(tmp_path, "f.txt", blocks()))
    np.testing.assert_allclose(points, POINTS, rtol=1e-15)
    np.testing.assert_allclose(u, U, rtol=1e-15)
    with pytest.raises(StiffmapError, match="line 14: expected load cases in rising order"):
        read_field(write(tmp_path, "g.txt", blocks(order=(2, 1, 3, 4, 5, 6))))
    with pytest.raises(StiffmapError, match="row 14 is a remark: Twice as fine"):
        read_field(write(tmp_path, "h.txt", blocks(title="Twice as fine")))


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_tables_as_programs_write_them(tmp_path, spelling):
    """Fields and load cases are tables like all others."""
    write_as = SPELLINGS[spelling]
    points, u = read_field(write(tmp_path, "f.csv", write_as(csv_text().removeprefix("# a field\n"))))
    np.testing.assert_allclose(points, POINTS, rtol=1e-15)
    np.testing.assert_allclose(u, U, rtol=1e-15)
    cases = "fx [N],fy [kN],fz [N],mx [N*mm],my [N*m],mz [Nmm]\n1.5,2,3,4,5,6\n0,0,0,1,2,3.5\n"
    found = read_cases(write(tmp_path, "c.csv", write_as(cases)))
    np.testing.assert_allclose(found, [[1.5, 2000, 3, 0.004, 5, 0.006], [0, 0, 0, 0.001, 2, 0.0035]])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("fx [N],fy [N],fz [N],mx [N*mm],my [N*mm],mz\n1,2,3,4,5,6\n", "line 1: mz: the unit is missing"),
        (
            "fx [N],fy [N],fz [N],mx [N],my [N*mm],mz [N*m]\n1,2,3,4,5,6\n",
            "line 1: mx .N.: expected a unit such as in mx .N.mm., found N",
        ),
        (
            "fx [N],fy [N],fz [N],mx [N*mm],my [N*mm],mz [Nm]\n1,2,3,4,5\n",
            "line 2: expected 6 values, found 5",
        ),
        ("", "the file is empty"),
        ("fx [N],fy [N],fz [N],mx [N*mm],my [N*mm]\n1,2,3,4,5\n", "'mz .N.mm.' with units, missing mz"),
        ("fx [N],fy [N],fz [N],mx [Nm],my [Nm],mz [Nm],fx [N]\n1,2,3,4,5,6,7\n", "found fx more than once"),
    ],
)
def test_bad_case_files(tmp_path, text, words):
    with pytest.raises(StiffmapError, match=words):
        read_cases(write(tmp_path, "c.csv", text))


def test_materials():
    assert read_material("steel").young == 210e9
    assert read_material("70GPa,0.33")[:2] == (70e9, 0.33)
    for bad, words in (
        ("unobtainium", "expected one of"),
        ("70,0.3", "needs its unit"),
        ("70GPa,0.5", "in \\(-1"),
    ):
        with pytest.raises(StiffmapError, match=words):
            read_material(bad)


PART = """
units: {length: mm, stress: MPa}
part: {shape: hollow-bar, length: 310, width: 12, height: 24, wall: 1.5}
material: {young: 70000, poisson: 0.33}
"""


def test_part_file_comes_in_si(tmp_path):
    shape, material, name = read_part(write(tmp_path, "bar.yaml", PART))
    assert shape.length == pytest.approx(0.31)
    assert material.young == pytest.approx(70e9)
    assert name == "bar"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("units: {length: mm, stress: MPa}", ""), "missing key .units."),
        (("length: mm", "length: furlong"), "line 2: units.length: .*found text .'furlong'"),
        (("shape: hollow-bar", "shape: banana"), "part.shape: expected one of bar, hollow-bar"),
        (("wall: 1.5", "wall: 7"), "part: wall: expected less than half of the smaller side, got 7"),
        (("wall: 1.5", "wall: thick"), "line 3: part.wall: expected a number; found text .'thick'"),
        (("length: 310", "length: -310"), "part.length: .*greater than 0; found a number .-310."),
        (("length: 310", "length: '310'"), "part.length: expected a number; found text .'310'"),
        (("length: 310", "length: true"), "part.length: expected a number; found true/false"),
        (("length: 310", "length: .inf"), "part.length: expected a finite number"),
        (("length: 310", "length: 310,5"), "part: unknown key '5' .decimals stand behind a point"),
        (("shape: hollow-bar", "shape: [bar]"), "part.shape: expected one of bar, hollow-bar"),
        (("young: 70000", "young: 70e9"), "between gel and diamond .* got 7e\\+16 Pa"),
        (("young: 70000, poisson: 0.33", "young: 70000"), "material: missing key .poisson."),
        (("material", "mterial"), "unknown key .mterial. .did you mean .material."),
        ((", stress: MPa", ""), "units.stress: young needs its unit, one of Pa, MPa"),
        (("poisson: 0.33", "poisson: '0,33'"), "material.poisson: expected a number; found text .'0,33'"),
        (("part:", "part: ["), "not valid YAML"),
    ],
)
def test_bad_part_files(tmp_path, change, words):
    with pytest.raises(StiffmapError, match=words) as error:
        read_part(write(tmp_path, "bar.yaml", PART.replace(*change)))
    assert "\n" not in str(error.value)


def test_link_file_loads_back_equal(tmp_path):
    points, u = noisy_field()
    link = identify_link(points, u, WRENCHES, reference=REFERENCE)
    C = (link.compliance + link.compliance.T) / 2
    file = LinkFile(
        C, link.covariance, link.reference, {"solver": "none", "noise_m": link.sigma.tolist()}, "bar"
    )
    save_link(file, tmp_path / "link.yaml")
    back = load_link(tmp_path / "link.yaml")
    assert np.array_equal(back.compliance, C)
    assert np.array_equal(back.covariance, link.covariance)
    assert np.array_equal(back.reference, link.reference)
    assert back.provenance == file.provenance
    assert back.name == "bar"
    assert back.standard_error == pytest.approx(link.standard_error)


def link_text(**changes):
    C = bar_compliance()
    data = {"kind": "stiffmap-link", "units": "{length: m, force: N, angle: rad}", "reference": "[0, 0, 0]",
            "compliance": C.tolist(), "standard_error": (0.01 * np.abs(C)).tolist()} | changes  # fmt: skip
    return "\n".join(f"{k}: {v}" for k, v in data.items() if v is not None)


def test_link_file_with_standard_errors_only(tmp_path):
    link = load_link(write(tmp_path, "l.yaml", link_text()))
    assert link.standard_error == pytest.approx(0.01 * np.abs(bar_compliance()))


def test_digits_that_a_file_rounds_make_no_asymmetry(tmp_path):
    C = bar_compliance()
    C[1, 5] *= 1 + 1e-8
    C[2, 4] *= 1 - 1e-8
    link = load_link(write(tmp_path, "l.yaml", link_text(compliance=C.tolist())))
    assert np.array_equal(link.compliance, link.compliance.T)
    np.testing.assert_allclose(link.compliance, bar_compliance(), rtol=1e-8)


SKEWED = bar_compliance()
SKEWED[1, 5] *= 1.01
LARGE = np.full((6, 6), 1e59)
np.fill_diagonal(LARGE, 1e-6)
LARGE_FREE = np.full((6, 6), 1e59)
np.fill_diagonal(LARGE_FREE, 0.0)
INDEFINITE = bar_compliance()
INDEFINITE[1, 5] = INDEFINITE[5, 1] = 1.2 * np.sqrt(INDEFINITE[1, 1] * INDEFINITE[5, 5])

NEGATIVE, CORRELATED = np.eye(36), np.eye(36)
NEGATIVE[3, 3] = -1e-20
CORRELATED[0, 7] = CORRELATED[7, 0] = 2.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"kind": "machine"}, "expected a link file"),
        ({"units": None}, "units: expected"),
        ({"units": "{length: mm, force: N, angle: rad}"}, "units: expected"),
        ({"compliance": None}, "missing key 'compliance'"),
        ({"reference": "[0, 0]"}, r"reference: expected finite numbers of shape \(3,\)"),
        ({"compliance": "[[1, a]]"}, "compliance: expected numbers"),
        ({"compliance": SKEWED.tolist()}, r"symmetric matrix, got .* = 8.7e-03"),
        ({"compliance": np.tril(LARGE).tolist()}, r"symmetric matrix, got .* = 1.0e\+65"),
        ({"compliance": LARGE.tolist()}, "expected no negative eigenvalue, got -1e"),
        (
            {"compliance": np.full((6, 6), 1e308).tolist()},
            r"too large: expected at most 1e\+60, found 1e\+308",
        ),
        ({"compliance": LARGE_FREE.tolist()}, "expected no negative eigenvalue, got -1e"),
        ({"compliance": INDEFINITE.tolist()}, "expected no negative eigenvalue, got -0.2"),
        (
            {"standard_error": np.full((6, 6), -1e308).tolist()},
            r"too large: expected at most 1e\+60, found -1e\+308",
        ),
        ({"compliance": (-bar_compliance()).tolist()}, "diagonal that is not negative"),
        (
            {"covariance": NEGATIVE.tolist(), "standard_error": None},
            "covariance: expected a diagonal that is not negative",
        ),
        (
            {"covariance": np.triu(CORRELATED).tolist(), "standard_error": None},
            "covariance: expected a symmetric matrix",
        ),
        (
            {"covariance": CORRELATED.tolist(), "standard_error": None},
            "covariance: expected no negative eigenvalue",
        ),
        ({"standard_error": (-bar_compliance()).tolist()}, "standard_error: expected numbers from 0 on"),
        ({"covariance": np.eye(36).tolist()}, "expected covariance or standard_error, found both"),
        ({"standard_errors": 0}, "no key 'standard_errors' .did you mean 'standard_error'"),
        ({"covarianse": 0}, "no key 'covarianse' .did you mean 'covariance'"),
        ({"Reference": "[0, 0, 1]"}, "no key 'Reference' .did you mean 'reference'"),
        ({"compliance": "[[.nan]]"}, "expected finite numbers of shape"),
    ],
)
def test_bad_link_files(tmp_path, changes, words):
    with pytest.raises(StiffmapError, match=words):
        load_link(write(tmp_path, "l.yaml", link_text(**changes)))


def test_missing_and_unwritable_link_file(tmp_path):
    with pytest.raises(StiffmapError, match="no such link file"):
        load_link(tmp_path / "absent.yaml")
    file = LinkFile(bar_compliance(), np.zeros((36, 36)), np.zeros(3), {})
    with pytest.raises(StiffmapError, match="cannot be written"):
        save_link(file, tmp_path / "no" / "link.yaml")


COORDINATES = {
    "node,x [m],y [m],z [m]": 1.0, "node;x_mm;y_mm;z_mm": 1e3, "Node Number\tX Location (mm)\tY Location (mm)\tZ Location (mm)": 1e3,
    "node x y z\n-, cm, cm, cm": 1e2, "# coordinates in mm": 1e3, "No.,X (in),Y (in),Z (in)": 1 / 0.0254,
    "plate of 20 mm\nnode, x, y, z in the global frame": 1.0,
}  # fmt: skip


@pytest.mark.parametrize("head", COORDINATES)
def test_coordinates_have_the_unit_of_their_header(tmp_path, head):
    separator = next(c for c in ";\t," if c in head or c == ",")
    rows = [
        separator.join(map(repr, [i + 1, *(COORDINATES[head] * p).tolist()])) for i, p in enumerate(POINTS)
    ]
    points, u = listing(tmp_path, ansys_text(), "\n".join([head, *rows]))
    np.testing.assert_allclose(points, POINTS, rtol=1e-12)
    np.testing.assert_allclose(u, U[:2], rtol=1e-5)


def test_coordinates_in_two_units_are_refused(tmp_path):
    with pytest.raises(StiffmapError, match=r"a\.inp: expected coordinates in one unit, found m and mm"):
        listing(tmp_path, ansys_text(), "node,x [mm],y [mm],z [m]\n" + NODES)


def nlist(system=0):
    rows = "".join(
        f"{i + 1:9d}" + "".join(f" {v:.15f}" for v in p) + "  0.00  0.00 45.00\n"
        for i, p in enumerate(POINTS)
    )
    head = "\n   NODE        X             Y             Z           THXY     THYZ     THZX\n"
    return f" LIST ALL SELECTED NODES.   DSYS= {system:6d}\n{head}" + rows.replace(
        "\n        6 ", f"\n{head}        6 "
    )


def test_a_listing_of_nodes_with_their_axes(tmp_path):
    np.testing.assert_allclose(listing(tmp_path, ansys_text(), nlist())[0], POINTS, rtol=1e-9)
    with pytest.raises(StiffmapError, match=r"in the global frame, found .*DSYS=      1"):
        listing(tmp_path, ansys_text(), nlist(1))


@pytest.mark.parametrize(
    "spelled",
    [
        lambda row: re.sub(r"^( +\d+) +-", r"\1-", row),
        lambda row: re.sub(r"(?<=\d)E(?=[-+]\d)", "", row),
        lambda row: re.sub(r"E([-+])(\d\d)", r"\g<1>0\2", row),
        lambda row: row.replace("E", "D"),
        lambda row: row + "  0.1 -0.2",
    ],
    ids=["touching its number", "no E", "no E, three digits", "D", "with rotations"],
)
def test_rows_as_fortran_writes_them(tmp_path, spelled):
    lines = [spelled(line) if re.match(r" +\d+ .*E", line) else line for line in ansys_text().splitlines()]
    points, u = listing(tmp_path, "\n".join(lines))
    np.testing.assert_allclose(points, POINTS, rtol=1e-8)
    np.testing.assert_allclose(u, U[:2], rtol=1e-5)


def test_short_rows_of_an_frd(tmp_path):
    short = re.sub(r"(?m)^ -1 {5}", " -1", frd_text()).replace("DISP ", "DISPI", 1)
    p, fields = read_frd(write(tmp_path, "a.frd", short))
    assert p == pytest.approx(POINTS, rel=1e-5)
    assert fields == pytest.approx(U[1:2], rel=1e-5)  # DISPI is the imaginary part
    binary = re.sub(r"(2C +10)\n", rf"\1{' ' * 37}2\n", frd_text())
    with pytest.raises(StiffmapError, match=r"a\.frd: expected ASCII, found a binary \.frd"):
        read_frd(write(tmp_path, "a.frd", binary))


@pytest.mark.parametrize("word", ["", "LC", "case_", "Load case "])
@pytest.mark.parametrize("name", ["case", "Load case", "No."])
def test_cases_stand_in_the_order_of_the_field(tmp_path, name, word):
    head = f"{name},fx [N],fy [N],fz [N],mx [N*m],my [N*m],mz [N*m]\n"
    rows = [f"{word}{k}," + ",".join("1" if i == k else "0" for i in range(1, 7)) for k in range(1, 7)]
    assert read_cases(write(tmp_path, "c.csv", head + "\n".join(rows) + "\n")) == pytest.approx(np.eye(6))
    rows[2:4] = rows[3], rows[2]
    with pytest.raises(StiffmapError, match=r"line 5.*in the order of the field"):
        read_cases(write(tmp_path, "c.csv", head + "\n".join(rows) + "\n"))


@pytest.mark.parametrize("between", ["", "_", " "])
def test_displacements_may_be_numbered_by_their_case(tmp_path, between):
    text = csv_text()
    for a in "xyz":
        for k in range(1, 7):
            text = text.replace(f",u{a} [", f",u{a}{between}{k} [", 1)
    points, fields = read_field(write(tmp_path, "f.csv", text))
    assert points == pytest.approx(POINTS) and fields == pytest.approx(U)
    names, *rows = [line.split(",") for line in text.splitlines()[1:]]
    turned = [*range(4), *range(7, 10), *range(4, 7), *range(10, 22)]  # the second case before the first
    again = "\n".join(",".join(row[i] for i in turned) for row in (names, *rows))
    assert read_field(write(tmp_path, "g.csv", again))[1] == pytest.approx(U)
    assert read_field(write(tmp_path, "h.csv", again.replace(" [mm]", "_mm")))[1] == pytest.approx(U)


def test_no_link_file_is_written_that_cannot_be_read(tmp_path):
    C = bar_compliance()
    C[1, 1] *= -1
    with pytest.raises(
        StiffmapError, match=r"link\.yaml: compliance: expected a diagonal that is not negative"
    ):
        save_link(LinkFile(C, np.zeros((36, 36)), np.zeros(3), {}), tmp_path / "link.yaml")
    assert not (tmp_path / "link.yaml").exists()


def nastran(head, row):
    return "".join(head(k) + "".join(map(row, range(1, len(u) + 1), u)) for k, u in enumerate(U[:2], 1))


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.rpt", nastran(lambda k: "\n  Node  U.Magnitude  U.U1  U.U2  U.U3\n  Label  @Loc 1  @Loc 1  @Loc 1  @Loc 1\n-----\n",
                          lambda n, u: f"{n:6d}  9.E+00 {u[0]:.6E} {u[1]:.6E} {u[2]:.6E}\n")),
        ("a.pch", nastran(lambda k: f"$DISPLACEMENTS   4\n$REAL OUTPUT   5\n$SUBCASE ID = {k}   6\n",
                          lambda n, u: f"{n:10d}       G  {u[0]:18.6E}{u[1]:18.6E}{u[2]:18.6E}{7:8d}\n-CONT-   0.0  0.0  0.0   8\n")),
        ("a.f06", nastran(lambda k: "1    BAR\n0      SUBCASE\n     D I S P L A C E M E N T   V E C T O R\n \n  POINT ID.   TYPE   T1  T2  T3  R1  R2  R3\n",
                          lambda n, u: f"{n:10d}      G   {u[0]:.6E} {u[1]:.6E} {u[2]:.6E} 0.0 0.0 0.0\n")),
    ],
)  # fmt: skip
def test_listings_by_the_names_of_their_columns(tmp_path, name, text):
    _, fields = read_listing(write(tmp_path, name, text + "1    NEXT\n"))
    np.testing.assert_allclose(fields, U[:2], rtol=1e-5)


def test_forces_of_constraint_are_no_displacements(tmp_path):
    head = (
        "  F O R C E S   O F   C O N S T R A I N T\n\n  POINT ID.   TYPE   T1  T2  T3\n  7  G  1.0 2.0 3.0\n"
    )
    with pytest.raises(StiffmapError, match="expected nodal displacements, found none"):
        read_listing(write(tmp_path, "a.f06", head))


@pytest.mark.parametrize(
    "names", ["U1 {0},U2 {0},U3 {0}", "DX {0},DY {0},DZ {0}", "Ux LC1 {0},Uy LC1 {0},Uz LC1 {0}"]
)
@pytest.mark.parametrize("unit", ["[mm]", ""])
def test_cases_below_each_other_by_any_names(tmp_path, names, unit):
    head = f"Load case,Node Label,X {unit},Y {unit},Z {unit},{names.format(unit)}\n"
    rows = [f"{k},{n},{n},0,1,{10 * k + n},0,0\n" for k in (1, 2) for n in (1, 2, 3)]
    points, fields = read_field(write(tmp_path, "f.csv", head + "".join(rows)), "mm")
    np.testing.assert_allclose(points[:, 0], [1e-3, 2e-3, 3e-3])
    np.testing.assert_allclose(fields[:, :, 0], [[11e-3, 12e-3, 13e-3], [21e-3, 22e-3, 23e-3]])
    with pytest.raises(StiffmapError, match="expected cases in the order of the field"):
        read_field(write(tmp_path, "g.csv", head + "".join(rows[3:] + rows[:3])), "mm")
