"""NetCDF and Zarr round trips, streaming, interrupted runs."""

from __future__ import annotations

import inspect
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import stiffmap as sm
from stiffmap.workspace.maps import block, error_map as map_module_function
from stiffmap.workspace.maps.files import read_dataset, write_dataset

BOX = np.array([-0.2, 0.05, 0.3])
CASES = {"Fx": [300.0, 0, 0, 0, 0, 0], "Fy": [0, 300.0, 0, 0, 0, 0]}
SAME = {"x": BOX, "y": BOX, "z": [-0.2, 0.3], "wrench": CASES, "compliance": True}


def loaded(path: Path) -> xr.Dataset:
    with read_dataset(path) as ds:
        return ds.load()


def test_exported_function_is_the_public_one() -> None:
    assert map_module_function is inspect.unwrap(sm.error_map)


def test_netcdf_round_trip(ds: xr.Dataset, tmp_path: Path) -> None:
    ds.to_netcdf(tmp_path / "m.nc")
    with xr.open_dataset(tmp_path / "m.nc") as back:
        assert back.load().identical(ds)


def test_zarr_round_trip(ds: xr.Dataset, tmp_path: Path) -> None:
    pytest.importorskip("zarr")
    ds.to_zarr(tmp_path / "m.zarr", zarr_format=2)
    assert xr.open_zarr(tmp_path / "m.zarr").load().identical(ds)


def test_polar_and_sweep_round_trip(machine: sm.Machine, tmp_path: Path) -> None:
    pytest.importorskip("zarr")
    polar = sm.polar(machine, np.zeros(3), directions=8)
    swp = sm.sweep(machine, np.zeros(3), [1.0, 1.0, 0], [0.0, 300.0])
    for name, ds in (("polar", polar), ("sweep", swp)):
        for ending in ("nc", "zarr"):
            path = write_dataset(ds, tmp_path / f"{name}.{ending}")
            assert loaded(path).identical(ds)


@pytest.mark.parametrize("name", ["m.nc", "m.zarr"])
def test_streamed_map_is_the_same(name: str, machine: sm.Machine, ds: xr.Dataset, tmp_path: Path) -> None:
    if name.endswith("zarr"):
        pytest.importorskip("zarr")
    for chunk in (1, 1000):  # the second replaces what the first wrote
        with sm.error_map(machine, **SAME, out=tmp_path / name, chunk=chunk) as streamed:
            assert streamed.load().identical(ds)
    assert [p.name for p in tmp_path.iterdir()] == [name]


class Interrupted(Exception):
    """Stands for a power cut."""


def interrupted_map(machine: sm.Machine, out: Path, monkeypatch: pytest.MonkeyPatch, blocks: int) -> None:
    import stiffmap.workspace.maps.block as block

    count = iter(range(blocks))
    real = block.solve_block

    def failing(*given: object) -> object:
        if next(count, None) is None:
            raise Interrupted
        return real(*given)  # type: ignore[arg-type]

    with monkeypatch.context() as patch:
        patch.setattr(block, "PART", 3)
        patch.setattr(block, "solve_block", failing)
        with pytest.raises(Interrupted):
            sm.error_map(machine, **SAME, out=out, chunk=3)


def test_resume_takes_up_an_interrupted_run(
    machine: sm.Machine, ds: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "m.nc"
    interrupted_map(machine, out, monkeypatch, blocks=4)
    assert not out.exists()
    done = np.load(tmp_path / "m.nc.partial" / "done.npy")
    assert done.tolist() == [True] * 4 + [False] * 2
    solved: list[slice] = []
    real = block.solve_block
    with monkeypatch.context() as patch:
        patch.setattr(block, "PART", 3)
        patch.setattr(block, "solve_block", lambda p, rows: (solved.append(rows), real(p, rows))[1])
        with sm.error_map(machine, **SAME, out=out, resume=True, chunk=3) as resumed:
            assert resumed.load().identical(ds)
    assert [(r.start, r.stop) for r in solved] == [(4, 5), (5, 6)]
    assert not (tmp_path / "m.nc.partial").exists()


def test_resume_refuses_another_map(
    machine: sm.Machine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "m.nc"
    interrupted_map(machine, out, monkeypatch, blocks=1)
    with pytest.raises(sm.StiffmapError, match="part of another map"):
        sm.error_map(machine, **{**SAME, "x": BOX + 0.001}, out=out, resume=True)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("key.json", b"{"),
        ("key.json", b"[" * 100_000),
        ("key.json", b'{"call": 3}'),
        ("done.npy", b""),
        ("deflection.npy", b"\x93NUMPY"),
        ("deflection.npy", b"\x93NUMPY\x01\x00\x0b\x00{'descr': \n\n"),
        ("deflection.npy", b"\x93NUMPY\x01\x00\x0b\x00[] + {1, 2}\n"),
        ("deflection.npy", None),
    ],
)
def test_a_damaged_part_of_an_interrupted_run_is_named(
    machine: sm.Machine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, content: bytes | None
) -> None:
    out = tmp_path / "m.nc"
    interrupted_map(machine, out, monkeypatch, blocks=1)
    path = tmp_path / "m.nc.partial" / name
    if content is None:
        np.save(path, np.zeros(3))
    else:
        path.write_bytes(content)
    with pytest.raises(sm.StiffmapError, match=rf"{name}: is damaged.*without resume"):
        sm.error_map(machine, **SAME, out=out, resume=True)


def test_without_resume_it_starts_afresh(
    machine: sm.Machine, ds: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "m.nc"
    interrupted_map(machine, out, monkeypatch, blocks=4)
    np.load(tmp_path / "m.nc.partial" / "deflection.npy", mmap_mode="r+")[:] = 7.0
    with sm.error_map(machine, **SAME, out=out) as fresh:
        assert fresh.load().identical(ds)


def test_streaming_keeps_memory_small(
    machine: sm.Machine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(block, "PART", 15)

    def peak(rows: int) -> int:
        tracemalloc.start()
        y = np.linspace(-0.2, 0.3, rows)
        sm.error_map(
            machine,
            x=BOX,
            y=y,
            z=0.0,
            wrench=CASES,
            plane=None,
            compliance=True,
            out=tmp_path / "m.nc",
            chunk=15,
        ).close()
        _, top = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return top

    def least(rows: int) -> int:
        return min(peak(rows) for _ in range(3))  # threads that other tests leave allocate as well

    peak(10)  # imports
    result = 180 * 3 * 2 * (6 + 36 + 2) * 8
    assert least(200) - least(20) < 0.2 * result
