"""Options of ``stiffmap map`` that no other command has."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from stiffmap.common.outputs.option import written

OutputOption = Annotated[Path, written(help="Folder for the map and its pictures.")]
ZOption = Annotated[
    list[float] | None,
    typer.Option(help="z-plane in mm; repeatable. [default: lowest, 0, highest of the workspace]"),
]
YOption = Annotated[list[float] | None, typer.Option(help="Planes across y instead, in mm; repeatable.")]
XOption = Annotated[list[float] | None, typer.Option(help="Planes across x instead, in mm; repeatable.")]
PointsOption = Annotated[
    int, typer.Option(help="Positions along each axis of a plane, over the whole workspace.")
]
DirectionsOption = Annotated[
    int,
    typer.Option(
        help="Force directions solved before the extremes are searched; 16 or more for machines with play."
    ),
]
ComplianceOption = Annotated[bool, typer.Option(help="Keep the 6x6 compliance of every pose.")]
UncertaintyOption = Annotated[
    bool, typer.Option("--uncertainty", help="Standard deviation of the map, from links and `u` of the file.")
]
ZarrOption = Annotated[bool, typer.Option("--zarr", help="Write Zarr instead of NetCDF.")]
ResumeOption = Annotated[bool, typer.Option("--resume", help="Take up an interrupted run.")]
PicturesOption = Annotated[bool, typer.Option(help="Draw the maps, and write them as a report (HTML).")]
FormatsOption = Annotated[
    str, typer.Option("--format", help="Formats of the pictures: png, svg, pdf, or several as png,pdf.")
]
TablesOption = Annotated[
    str | None, typer.Option("--table", help="Write the map as a table too: csv, xlsx, or csv,xlsx.")
]
OwnScalesOption = Annotated[
    bool, typer.Option("--own-scales", help="A colour scale for each plane instead of a common one.")
]
EstimateOption = Annotated[
    bool,
    typer.Option("--estimate", help="Only say how long it will take, and the memory and disk it needs."),
]
StatisticsOption = Annotated[
    bool, typer.Option("--statistics", help="Maxima, percentiles and shares only; no map is stored.")
]
SchedulerOption = Annotated[
    str | None, typer.Option(help="Address of a dask scheduler whose workers solve the map.")
]
ToolpathOption = Annotated[
    str | None,
    typer.Option(
        help="Along a path of the tool instead of over planes: CSV or YAML, as for `efforts`; or a shipped one: trim."
    ),
]
