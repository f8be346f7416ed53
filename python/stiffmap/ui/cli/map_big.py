"""``stiffmap map --estimate`` and ``--statistics``: what needs no stored map."""

from __future__ import annotations

from typing import Any

import xarray as xr
from rich.table import Table

from stiffmap.solve.machine import Machine
from stiffmap.solve.status import Status
from stiffmap.ui.cli.inputs import finish
from stiffmap.ui.cli.output import failed_in_words, show, table


def print_estimate(machine: Machine, call: dict[str, Any], as_json: bool) -> None:
    """Time, memory and disk of a map."""
    import stiffmap

    found = stiffmap.map_estimate(machine, **call)
    show(as_json, vars(found), [str(found)])


def print_statistics(
    machine: Machine, call: dict[str, Any], plane: str, given: str, scheduler: str | None, as_json: bool
) -> None:
    """Figures of a map that is not stored; exits with 1 where poses failed."""
    import stiffmap

    ds = stiffmap.map_statistics(machine, **call, scheduler=scheduler, progress=False if as_json else None)
    rows = statistics_rows(ds, plane)
    failed = {s.name: int(ds.status_count.sel(status=int(s)).sum()) for s in Status if s}
    failed = {name: count for name, count in failed.items() if count}
    lost = failed_in_words(failed, "solves of the load cases")
    show(as_json, {"machine": machine.name, "rows": rows, "failed": failed}, [given, _table(ds, rows), *lost])
    finish(bool(failed))


def statistics_rows(ds: xr.Dataset, plane: str) -> list[dict[str, Any]]:
    """A row per plane and force: largest value (m), its pose (m), percentiles (m), share of the area within."""
    rows = []
    for z in ds.z.values:
        here = ds.sel(z=z)
        for force in ("worst", "best", *map(str, ds.case.values)):
            name = f"{force}_deflection_{plane}" if force in ("worst", "best") else f"deflection_{plane}"
            one = here if force in ("worst", "best") else here.sel(case=force)
            percentiles = zip(
                ds.percentile.values.tolist(), one[f"{name}_percentile"].values.tolist(), strict=True
            )
            rows.append(
                {"z": float(z), "force": force, "max": float(one[f"{name}_max"]),
                 "at": one[f"{name}_max_position"].values.tolist(), "percentiles": dict(percentiles),
                 "share_within": float(one[f"{name}_within"])}
            )  # fmt: skip
    return rows


def _table(ds: xr.Dataset, rows: list[dict[str, Any]]) -> Table:
    percent = [f"{p:g} %" for p in ds.percentile.values]
    out = table(
        f"{ds.attrs['machine']}: deflection in the plane, mm, under {ds.attrs['turning_force_N']:g} N",
        ("z, mm", "force", *percent, "max", "at x, y", f"within {1e3 * ds.attrs['tolerance_m']:g} mm"),
        left=("force",),
    )
    for r in rows:
        name = f"{r['force']} direction" if r["force"] in ("worst", "best") else r["force"]
        values = (f"{1e3 * v:.3f}" for v in (*r["percentiles"].values(), r["max"]))
        place = f"{1e3 * r['at'][0]:.0f}, {1e3 * r['at'][1]:.0f}"
        out.add_row(f"{1e3 * r['z']:g}", name, *values, place, f"{100 * r['share_within']:.1f} %")
    return out
