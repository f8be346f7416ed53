"""Sheets as workshops write them, made by hand, each with its truth: what the readings are, in SI."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

Rows = list[tuple[float, float, float, float, float]]
"""x, y in mm; fx in N; dx, dy in µm."""
TRUTH: Rows = [(0, 400, 100, 12.5, -3.0), (50, 400, 100, 14.0, -2.5), (0, 450, -100, -13.0, 3.5)]


@dataclass(frozen=True)
class Ugly:
    """A sheet: its text, or what fills a workbook, further options, and the rows that it holds."""

    text: str | Callable[[Any], None]
    truth: Rows = field(default_factory=lambda: list(TRUTH))
    more: tuple[str, ...] = ("--set", "z=0")
    encoding: str = "utf-8"
    name: str = "sheet.csv"

    def write(self, folder: Path) -> Path:
        """The file."""
        if self.name.endswith(".ods"):
            assert isinstance(self.text, str)
            return open_document(folder / self.name, [r.split(";") for r in self.text.splitlines()])
        if isinstance(self.text, str):
            path = folder / self.name
            path.write_bytes(self.text.encode(self.encoding))
            return path
        import openpyxl

        book = openpyxl.Workbook()
        self.text(book)
        path = folder / "sheet.xlsx"
        book.save(path)
        return path


def open_document(path: Path, rows: list[list[str]], around: str = "{}") -> Path:
    """An OpenDocument sheet as LibreOffice writes it: numbers rounded for show, blanks behind the table repeated; `around`: what
    stands around its rows."""

    def cell(text: str) -> str:
        try:
            value = float(text)
        except ValueError:
            kind = 'office:value-type="string"' if text else ""
            return f"<table:table-cell {kind}><text:p>{escape(text)}</text:p></table:table-cell>"
        return f'<table:table-cell office:value-type="float" office:value="{value!r}"><text:p>{value:.0f}</text:p></table:table-cell>'

    blank = '<table:table-cell table:number-columns-repeated="16378"/>'
    body = "".join(f"<table:table-row>{''.join(map(cell, row))}{blank}</table:table-row>" for row in rows)
    body = (
        around.format(body)
        + f'<table:table-row table:number-rows-repeated="1048000">{blank}</table:table-row>'
    )
    spaces = " ".join(
        f'xmlns:{n}="urn:oasis:names:tc:opendocument:xmlns:{n}:1.0"' for n in ("office", "table", "text")
    )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        packed.writestr(
            "content.xml",
            f'<?xml version="1.0" encoding="UTF-8"?><office:document-content {spaces}><office:body><office:spreadsheet>'
            f'<table:table table:name="Data">{body}</table:table></office:spreadsheet></office:body></office:document-content>',
        )
        manifest = "urn:oasis:names:tc:opendocument:xmlns:manifest:1.0"
        packed.writestr("META-INF/manifest.xml", f'<m:manifest xmlns:m="{manifest}"/>')
    return path


def merged(book: Any) -> None:
    page = book.active
    page["A1"] = "Measurement of 12 March, Miller"
    for cell, text in (
        ("A3", "Point"),
        ("B3", "Position [mm]"),
        ("D3", "Force [N]"),
        ("E3", "Deflection [µm]"),
    ):
        page[cell] = text
    page.merge_cells("A3:A4")
    page.merge_cells("B3:C3")
    page.merge_cells("E3:F3")
    for cell, text in zip(("B4", "C4", "D4", "E4", "F4"), "xyxxy", strict=True):
        page[cell] = text
    for i, (x, y, f, dx, dy) in enumerate(TRUTH):
        for column, v in zip("ABCDEF", (f"P{i + 1}", x, y, f, dx, dy), strict=True):
            page[f"{column}{5 + i}"] = v


def several(book: Any) -> None:
    book.active.title = "Cover"
    book.active["A1"] = "Machine no. 7"
    page = book.create_sheet("Notes")
    page.append(["what", "who"])
    page.append(["warmed up", "Miller"])
    page = book.create_sheet("Readings")
    page.append(["Nr", "X [mm]", "Y [mm]", "Fx [N]", "dx [µm]", "dy [µm]"])
    for i, row in enumerate(TRUTH, 1):
        page.append([i, *row])


def means(book: Any) -> None:
    page = book.active
    page.append(["Nr", "X [mm]", "Y [mm]", "Fx [N]", "dx [µm]", "dy [µm]"])
    for i, row in enumerate(TRUTH, 1):
        page.append([i, *row])
    page.append([])
    page.append(["Mean", None, None, None, 4.5, -0.67])
    page.append(["Std. dev.", None, None, None, 12.4, 2.9])
    page.append(["Signed: Miller"])


UGLY: dict[str, Ugly] = {
    "unit row": Ugly("Nr;X;Y;Fx;dx;dy\n;mm;mm;N;µm;µm\n1;0;400;100;12,5;-3,0\n2;50;400;100;14,0;-2,5\n3;0;450;-100;-13,0;3,5\n"),
    "unit row in brackets": Ugly("x,y,fx,dx,dy\n[mm],[mm],[N],[um],[um]\n0,400,100,12.5,-3.0\n50,400,100,14.0,-2.5\n0,450,-100,-13.0,3.5\n"),
    "two rows": Ugly("Position [mm];;Force [N];Deflection [µm];\nx;y;x;x;y\n0;400;100;12.5;-3.0\n50;400;100;14.0;-2.5\n0;450;-100;-13.0;3.5\n"),
    "three rows": Ugly("Lage;;Kraft;Abweichung;\nx;y;x;x;y\nmm;mm;N;µm;µm\n0;400;100;12,5;-3,0\n50;400;100;14,0;-2,5\n0;450;-100;-13,0;3,5\n"),
    "merged workbook": Ugly(merged),
    "dashes": Ugly("x [mm];y [mm];fx [N];dx [µm];dy [µm]\n0;400;100;12.5;---\n50;400;100;n.m.;-2.5\n0;450;-100;-13.0;3.5\n",
                   [(0, 400, 100, 12.5, float("nan")), (50, 400, 100, float("nan"), -2.5), (0, 450, -100, -13.0, 3.5)]),
    "errors of formulas": Ugly("x [mm];y [mm];fx [N];dx [µm];dy [µm]\n0;400;100;12.5;#DIV/0!\n50;400;100;14.0;-2.5\n0;450;-100;#NV;3.5\n",
                               [(0, 400, 100, 12.5, float("nan")), (50, 400, 100, 14.0, -2.5), (0, 450, -100, float("nan"), 3.5)]),
    "means at the end": Ugly(means),
    "means in German": Ugly("Nr;x [mm];y [mm];Fx [N];dx [µm];dy [µm]\n1;0;400;100;12,5;-3,0\n2;50;400;100;14,0;-2,5\n3;0;450;-100;-13,0;3,5\nMittelwert;;;;4,5;-0,67\nStabw;;;;12,4;2,9\n"),
    "header with #": Ugly("#;x [mm];y [mm];fx [N];dx [µm];dy [µm]\n1;0;400;100;12.5;-3.0\n2;50;400;100;14.0;-2.5\n3;0;450;-100;-13.0;3.5\n"),
    "header behind #": Ugly("# taken by Miller\n# x [mm]\ty [mm]\tfx [N]\tdx [µm]\tdy [µm]\n0\t400\t100\t12.5\t-3.0\n50\t400\t100\t14.0\t-2.5\n0\t450\t-100\t-13.0\t3.5\n"),
    "repeated points": Ugly("Point;x [mm];y [mm];fx [N];dx [µm];dy [µm]\nA;0;400;100;12.5;-3.0\nA;0;400;100;14.0;-2.5\nB;0;450;-100;-13.0;3.5\n",
                            [(0, 400, 100, 12.5, -3.0), (0, 400, 100, 14.0, -2.5), (0, 450, -100, -13.0, 3.5)]),
    "several sheets": Ugly(several),
    "mil and lbf": Ugly("x [in],y [in],Fx [lbf],dx [mil],dy [thou]\n0,10,20,0.5,-0.1\n2,10,20,0.6,-0.1\n",
                        [(0, 254, 88.96443230521, 12.7, -2.54), (50.8, 254, 88.96443230521, 15.24, -2.54)]),
    "thousandths of an inch": Ugly("x (mm),y (mm),Fx (lbf),dx (in/1000),dy (in/1000)\n0,400,20,0.5,-0.1\n50,400,20,0.6,-0.1\n",
                                   [(0, 400, 88.96443230521, 12.7, -2.54), (50, 400, 88.96443230521, 15.24, -2.54)]),
    "kgf and hundredths": Ugly("x [mm];y [mm];Fx [kgf];dx [1/100 mm];dy [1/100 mm]\n0;400;10;1,25;-0,30\n50;400;10;1,40;-0,25\n",
                               [(0, 400, 98.0665, 12.5, -3.0), (50, 400, 98.0665, 14.0, -2.5)]),
    "kp": Ugly("X/mm;Y/mm;Kraft x in kp;Uhr x in 1/100 mm;Uhr y in 1/100 mm\n0;400;10;1,25;-0,30\n50;400;10;1,40;-0,25\n",
               [(0, 400, 98.0665, 12.5, -3.0), (50, 400, 98.0665, 14.0, -2.5)]),
    "units in cells of their own": Ugly("x [mm],y [mm],Fx,unit,dx,unit of dx,dy,unit of dy\n0,400,0.1,kN,12.5,µm,-0.003,mm\n50,400,0.1,kN,14.0,µm,-0.0025,mm\n0,450,-0.1,kN,-13.0,µm,0.0035,mm\n"),
    "pages repeat the header": Ugly("x [mm];y [mm];fx [N];dx [µm];dy [µm]\n0;400;100;12.5;-3.0\n50;400;100;14.0;-2.5\n\nx [mm];y [mm];fx [N];dx [µm];dy [µm]\n0;450;-100;-13.0;3.5\nPage 2 of 2\n"),
    "Latin-1 with a preamble": Ugly("Protokoll;4711\nBediener;Müller\nDatum;12.03.2024\n\nNr.;Pos. x (mm);y (mm);Last x (N);Verschiebung x (µm);Verschiebung y (µm);Bemerkung\n1;0;400;100;12,5;-3,0;\n2;50;400;100;14,0;-2,5;warm\n3;0;450;-100;-13,0;3,5;\n",
                                    encoding="latin-1", more=("--set", "z=0", "--map", "x=Pos. x")),
}  # fmt: skip
"""Twenty, on which the reader was made."""


def wide(book: Any) -> None:
    p = book.active
    p.title = "Tab"
    p["B2"] = "Compliance test"
    p["B3"] = "Operator: Smith"
    for c, t in zip("BCDEFG", ("No.", "X", "Y", "Load", "Dial gauge", None), strict=False):
        p[c + "5"] = t
    for c, t in zip("BCDEFG", ("", "mm", "mm", "N", "x", "y"), strict=False):
        p[c + "6"] = t
    for c, t in zip("BCDEFG", ("", "", "", "x", "µm", "µm"), strict=False):
        p[c + "7"] = t
    for i, r in enumerate(
        [(0, 400, 100, 12.5, -3.0), (50, 400, 100, 14.0, -2.5), (0, 450, -100, -13.0, 3.5)]
    ):
        for c, v in zip("BCDEFG", (i + 1, *r), strict=False):
            p[f"{c}{8 + i}"] = v


def offset(book: Any) -> None:
    p = book.active
    p["C4"] = "Pos X (mm)"
    p["D4"] = "Pos Y (mm)"
    p["E4"] = "Force X (daN)"
    p["F4"] = "Displ. X (µm)"
    p["G4"] = "Displ. Y (µm)"
    for i, r in enumerate([(0, 400, 10, 12.5, -3.0), (50, 400, 10, 14.0, -2.5), (0, 450, -10, -13.0, 3.5)]):
        for c, v in zip("CDEFG", r, strict=False):
            p[f"{c}{5 + i}"] = v
    p["C9"] = "average"
    p["F9"] = 4.5


LATER: dict[str, Ugly] = {
"1 tab, percent comments":Ugly("% log\n% x mm\ty mm\tFx N\tdx um\tdy um\n0\t400\t100\t12.5\t-3\n50\t400\t100\t14\t-2.5\n0\t450\t-100\t-13\t3.5\n"),
"2 offset columns":Ugly(offset),
"3 three header rows in workbook":Ugly(wide),
"4 units in a line 'Einheit'":Ugly("Größe;X;Y;Fx;dx;dy\nEinheit;mm;mm;N;µm;µm\nP1;0;400;100;12,5;-3,0\nP2;50;400;100;14,0;-2,5\nP3;0;450;-100;-13,0;3,5\n"),
"5 quotes and thousands":Ugly('"Nr","x, mm","y, mm","Fx, N","dx, µm","dy, µm"\n"1","0","400","100","12.5","-3.0"\n"2","50","400","100","14.0","-2.5"\n"3","0","450","-100","-13.0","3.5"\n'),
"6 blank lines and totals":Ugly("X (mm);Y (mm);F_x (N);delta x (µm);delta y (µm)\n\n0;400;100;12.5;-3.0\n\n50;400;100;14.0;-2.5\n0;450;-100;-13.0;3.5\n\nSumme;;;13.5;-2.0\nMax;;;14.0;3.5\n"),
"7 repeats side by side":Ugly("x [mm];y [mm];Fx [N];dx 1 [µm];dx 2 [µm];dy 1 [µm];dy 2 [µm]\n0;400;100;12.5;12.7;-3.0;-3.1\n50;400;100;14.0;---;-2.5;-2.4\n",[(0,400,100,12.5,-3.0),(0,400,100,12.7,-3.1),(50,400,100,14.0,-2.5),(50,400,100,float('nan'),-2.4)]),
"8 units glued to values":Ugly("x;y;fx;dx;dy\n0 mm;400 mm;100 N;12.5 µm;-3.0 µm\n50 mm;400 mm;100 N;14.0 µm;-2.5 µm\n0 mm;450 mm;-100 N;-13.0 µm;3.5 µm\n"),
"9 transposed remark column, kp":Ugly("lfd. Nr;X-Pos [mm];Y-Pos [mm];Last in x [kp];Messuhr X [1/100mm];Messuhr Y [1/100mm];Bem.\n1;0;400;10;1,25;-0,3;-\n2;50;400;10;1,4;-0,25;warm\n3;0;450;-10;-1,3;0,35;\n",[(0,400,98.0665,12.5,-3.0),(50,400,98.0665,14.0,-2.5),(0,450,-98.0665,-13.0,3.5)]),
"10 pipe table with rules":Ugly("| Nr | x [mm] | y [mm] | Fx [N] | dx [µm] | dy [µm] |\n|----|--------|--------|--------|---------|---------|\n| 1 | 0 | 400 | 100 | 12.5 | -3.0 |\n| 2 | 50 | 400 | 100 | 14.0 | -2.5 |\n| 3 | 0 | 450 | -100 | -13.0 | 3.5 |\n"),
"11 units behind an underscore":Ugly("x_m,y_m,fx_N,dx_um,dy_um\n0,0.4,100,12.5,-3\n0.05,0.4,100,14,-2.5\n0,0.45,-100,-13,3.5\n"),
"12 touched points are the places":Ugly("px [m];py [m];Fx [N];dx [µm];dy [µm]\n0;0,4;100;12,5;-3,0\n0,05;0,4;100;14,0;-2,5\n0;0,45;-100;-13,0;3,5\n"),
"13 French":Ugly("X (mm);Y (mm);Effort X (daN);Flèche X (µm);Flèche Y (µm)\n0;400;10;12,5;-3,0\n50;400;10;14,0;-2,5\n0;450;-10;-13,0;3,5\n",encoding="latin-1"),
"13 Chinese":Ugly("点号,X坐标（毫米）,Y坐标（毫米）,X方向力（牛）,X向位移（微米）,Y向位移（微米）\n1,0,400,100,12.5,-3.0\n2,50,400,100,14.0,-2.5\n3,0,450,-100,-13.0,3.5\n",encoding="gb2312"),
"13 Chinese, units behind a sign, UTF-8":Ugly("序号,位置X/mm,位置Y/mm,载荷X/N,变形X/μm,变形Y/μm\n1,0,400,100,12.5,-3.0\n2,50,400,100,14.0,-2.5\n3,0,450,-100,-13.0,3.5\n"),
"14 before and after, and the commanded place":Ugly("x [mm];y [mm];Fx [N];X before [mm];Y before [mm];X after [mm];Y after [mm]\n0;400;100;1;401;1.0125;400.997\n50;400;100;51;401;51.014;400.9975\n0;450;-100;1;451;0.987;451.0035\n"),
"15 OpenDocument":Ugly("Test of 12 March\n\nx [mm];y [mm];Fx [N];dx [µm];dy [µm]\n0;400;100;12.5;-3.0\n50;400;100;14.0;-2.5\n0;450;-100;-13.0;3.5\n",name="sheet.ods"),
"16 units in cells with decimal commas":Ugly("X;Y;Last Fx;dX;dY\n0 mm;400 mm;100 N;12,5 µm;-3,0µm\n50 mm;400 mm;100 N;14 µm;-2,5 µm\n0 mm;450 mm;-100 N;-13,0 µm;3,5 µm\n"),
"17 numpy.savetxt":Ugly("# x[mm] y[mm] fx[N] dx[um] dy[um]\n0.0e+00 4.0e+02 1.0e+02 1.25e+01 -3.0e+00\n5.0e+01 4.0e+02 1.0e+02 1.4e+01 -2.5e+00\n0.0e+00 4.5e+02 -1.0e+02 -1.3e+01 3.5e+00\n"),
"18 Fortran":Ugly("x [mm],y [mm],fx [N],dx [um],dy [um]\n0.0D+00,4.0D+02,1.0D+02,1.25D+01,-3.0D+00\n5.0D+01,4.0D+02,1.0D+02,1.4D+01,-2.5D+00\n0.0D+00,4.5D+02,-1.0D+02,-1.3D+01,3.5D+00\n"),
"19 Italian, thousands apart":Ugly("Punto;X [µm];Y [µm];Forza X [N];Spostamento X [µm];Spostamento Y [µm]\nP1;0;400 000;100;12,5;-3,0\nP2;50'000;400 000;100;14,0;-2,5\nP3;0;450’000;-100;-13,0;3,5\n"),
"20 units in cells of two columns":Ugly("x [mm];y [mm];Load;Direction;dx;dy [um]\n0;400;100 N;+x;12.5 um;-3.0\n50;400;100 N;+x;14.0 um;-2.5\n0;450;100 N;-x;-13.0 um;3.5\n"),
"21 units over names":Ugly("Nr;Position [mm];;Force [N];Dial gauges [µm];;Remark\n;x;y;fx;dx;dy;\n1;0;400;100;12,5;-3,0;a\n2;50;400;100;14,0;-2,5;\n3;0;450;-100;-13,0;3,5;b\n"),
"22 a draft":Ugly("Compliance test [draft 2]\nx [mm];y [mm];fx [N];dx [µm];dy [µm]\n0;400;100;12,5;-3,0\n50;400;100;14,0;-2,5\n0;450;-100;-13,0;3,5\n"),
"23 names that end as units do":Ugly("Load case;X [mm];Y [mm];Fx [N];dX [µm];dY [µm]\nP1 m;0;400;100;12,5;-3,0\nP2 t;50;400;100;14,0;-2,5\nP3 m;0;450;-100;-13,0;3,5\n"),
}  # fmt: skip
"""Ten that were made when the reader was done: at the first try it read four (4 to 7); `STILL` are not read yet. Thirteen from later days (from 11),
of which none but the last two was read right at once."""
STILL = {"3 three header rows in workbook"}
