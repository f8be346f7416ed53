"""Maps that are killed, spread over a cluster, refused, damaged, or never stored."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import stiffmap as sm
from stiffmap.workspace.maps import plan
from stiffmap.workspace.maps.files import read_dataset
from stiffmap.workspace.maps.statistics import RELATIVE_WIDTH, Histogram
from stiffmap.workspace.maps.store import ZarrMap

zarr = pytest.importorskip("zarr")
AXIS = np.linspace(-0.2, 0.3, 12)
CALL: dict[str, Any] = {
    "x": AXIS,
    "y": AXIS,
    "z": [-0.2, 0.0, 0.3],
    "wrench": [300.0, 0, 0, 0, 0, 0],
    "plane": None,
}
DEEP = "[" * 100_000


@pytest.fixture(autouse=True)
def _small_tiles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plan, "TILE_POSES", 24)


def tree(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.fixture(scope="module")
def whole(machine: sm.Machine, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Bytes of an uninterrupted run."""
    out = tmp_path_factory.mktemp("whole") / "m.zarr"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plan, "TILE_POSES", 24)
        sm.error_map(machine, **CALL, out=out, threads=1).close()
    return tree(out)


def test_it_holds_what_a_map_in_memory_holds(machine: sm.Machine, tmp_path: Path) -> None:
    with sm.error_map(machine, **CALL, out=tmp_path / "m.zarr") as stored:
        assert stored.load().identical(sm.error_map(machine, **CALL))


@pytest.mark.parametrize(("threads", "chunk"), [(2, 1), (1, 7), (2, 100000)])
def test_bytes_do_not_depend_on_threads_or_chunks(
    machine: sm.Machine, whole: dict[str, bytes], tmp_path: Path, threads: int, chunk: int
) -> None:
    sm.error_map(machine, **CALL, out=tmp_path / "m.zarr", threads=threads, chunk=chunk).close()
    assert tree(tmp_path / "m.zarr") == whole


JOB = """
    import sys, time
    import numpy as np
    import stiffmap as sm
    from stiffmap.workspace.maps import plan
    from stiffmap.workspace.maps.store import ZarrMap
    plan.TILE_POSES = 24
    real = ZarrMap.put
    def slow(self, tile, values):
        print(tile, flush=True)
        real(self, tile, values)
        time.sleep(0.02)
    ZarrMap.put = slow
    axis = np.linspace(-0.2, 0.3, 12)
    sm.error_map(sm.load_machine("orthoglide-revised"), x=axis, y=axis, z=[-0.2, 0.0, 0.3],
                 wrench=[300.0, 0, 0, 0, 0, 0], plane=None, out=sys.argv[1], resume=True)
"""


def test_killed_at_random_moments_it_goes_on_to_the_same_bytes(
    whole: dict[str, bytes], tmp_path: Path
) -> None:
    """kill -9 five times, each after a random number of tiles and a random part of the next one."""
    out, rng = tmp_path / "m.zarr", np.random.default_rng(7)
    command = [sys.executable, "-c", textwrap.dedent(JOB), str(out)]
    kills = 0
    for _ in range(5):
        job = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert job.stdout is not None
        for _ in range(int(rng.integers(1, 3))):
            if not job.stdout.readline():
                break
        time.sleep(rng.uniform(0, 0.02))
        if job.poll() is None:
            job.send_signal(signal.SIGKILL)
            kills += 1
        job.communicate()
    assert kills == 5
    assert not out.exists()
    subprocess.run(command, check=True, capture_output=True)
    assert tree(out) == whole
    assert os.listdir(tmp_path) == ["m.zarr"]


class PowerCut(Exception):
    """Stops a map half-way."""


def half_done(machine: sm.Machine, out: Path, monkeypatch: pytest.MonkeyPatch, tiles_kept: int = 4) -> Path:
    real, left = ZarrMap.put, iter(range(tiles_kept))

    def put(self: ZarrMap, tile: slice, values: dict[str, Any]) -> None:
        if next(left, None) is None:
            raise PowerCut
        real(self, tile, values)

    with monkeypatch.context() as patch:
        patch.setattr(ZarrMap, "put", put)
        with pytest.raises(PowerCut):
            sm.error_map(machine, **CALL, out=out)
    return out.with_name(f"{out.name}.partial")


def test_what_a_killed_write_left_of_a_chunk_is_removed(
    whole: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, machine: sm.Machine
) -> None:
    out = tmp_path / "m.zarr"
    half = half_done(machine, out, monkeypatch, tiles_kept=2)
    (half / "status" / "c" / "0" / "0.48409dcac70c4b43.partial").write_bytes(b"")
    sm.error_map(machine, **CALL, out=out, resume=True).close()
    assert tree(out) == whole


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"x": AXIS[:-1]}, "x was 12 numbers from -0.2 to 0.3, is 11 from -0.2 to"),
        ({"wrench": [200.0, 0, 0, 0, 0, 0]}, "wrench"),
        ({"gravity": [0, 0, -9.81]}, "gravity"),
    ],
)
def test_another_map_is_refused_by_what_differs(
    machine: sm.Machine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changed: dict[str, Any], words: str
) -> None:
    half_done(machine, tmp_path / "m.zarr", monkeypatch)
    with pytest.raises(sm.StiffmapError, match="holds part of another map") as error:
        sm.error_map(machine, **CALL | changed, out=tmp_path / "m.zarr", resume=True)
    assert words in str(error.value)


def test_another_machine_is_refused(
    machine: sm.Machine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    half_done(machine, tmp_path / "m.zarr", monkeypatch)
    worn = machine.with_effect("dead_zone", element="actuator", legs=["y"], half_width=12e-6)
    with pytest.raises(sm.StiffmapError, match="the machine's description was"):
        sm.error_map(worn, **CALL, out=tmp_path / "m.zarr", resume=True)


def test_a_damaged_chunk_is_named_and_can_be_computed_again(
    machine: sm.Machine, whole: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "m.zarr"
    chunk = half_done(machine, out, monkeypatch) / "deflection/c/0/1/0"
    data = bytearray(chunk.read_bytes())
    data[len(data) // 2] ^= 1
    chunk.write_bytes(data)
    with pytest.raises(sm.StiffmapError, match=r"deflection.c.0.1.0: is damaged") as error:
        sm.error_map(machine, **CALL, out=out, resume=True)
    assert "delete this chunk" in str(error.value)
    chunk.unlink()
    sm.error_map(machine, **CALL, out=out, resume=True).close()
    assert tree(out) == whole


@pytest.mark.parametrize("name", ["deflection/zarr.json", "x/zarr.json", "y/c/0"])
def test_damaged_metadata_are_written_again(
    machine: sm.Machine, whole: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    out = tmp_path / "m.zarr"
    path = half_done(machine, out, monkeypatch) / name
    path.write_bytes(path.read_bytes()[:-9].replace(b"12", b"13"))
    sm.error_map(machine, **CALL, out=out, resume=True).close()
    assert tree(out) == whole


@pytest.mark.parametrize("text", ["", "{", '{"attributes": 3}', '{"attributes": {"call": "{"}}', DEEP])
def test_a_map_whose_call_is_lost_is_not_taken_up(
    machine: sm.Machine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    half = half_done(machine, tmp_path / "m.zarr", monkeypatch)
    (half / "zarr.json").write_text(text)
    with pytest.raises(sm.StiffmapError, match=r"zarr.json: is damaged.*without resume"):
        sm.error_map(machine, **CALL, out=tmp_path / "m.zarr", resume=True)


def test_a_full_disk_loses_nothing(
    machine: sm.Machine, whole: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It refuses in the middle of the fourth tile of five variables."""
    out, real, left = tmp_path / "m.zarr", zarr.Array.__setitem__, iter(range(17))

    def full(self: Any, *given: Any) -> None:
        if self.ndim > 2 and next(left, None) is None:
            raise OSError(errno.ENOSPC, "No space left on device")
        real(self, *given)

    with monkeypatch.context() as patch:
        patch.setattr(zarr.Array, "__setitem__", full)
        with pytest.raises(sm.StiffmapError, match="No space left on device; 3 of 18 tiles are kept"):
            sm.error_map(machine, **CALL, out=out)
    sm.error_map(machine, **CALL, out=out, resume=True).close()
    assert tree(out) == whole


def test_two_jobs_on_one_output_are_told_apart(
    machine: sm.Machine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = ZarrMap.put

    def put(self: ZarrMap, tile: slice, values: dict[str, Any]) -> None:
        if self.done.any():
            with pytest.raises(sm.StiffmapError, match="is being written by another job"):
                sm.error_map(machine, **CALL, out=tmp_path / "m.zarr", resume=True)
        real(self, tile, values)

    monkeypatch.setattr(ZarrMap, "put", put)
    sm.error_map(machine, **CALL, out=tmp_path / "m.zarr").close()
    assert (tmp_path / "m.zarr").is_dir()


def test_an_earlier_map_stays_until_the_new_one_is_whole(
    machine: sm.Machine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "m.zarr"
    sm.error_map(machine, **CALL | {"z": 0.1}, out=out).close()
    before = tree(out)
    half_done(machine, out, monkeypatch)
    assert tree(out) == before


# --- on a cluster


@pytest.fixture
def cluster() -> Iterator[Any]:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        ) as here,
        distributed.Client(here, set_as_default=False) as client,
    ):
        yield client


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("lost", [1, 2], ids=["one", "all, and the packed machine with them"])
def test_a_cluster_that_loses_workers_gives_the_same_bytes(
    lost: int,
    machine: sm.Machine,
    whole: dict[str, bytes],
    tmp_path: Path,
    cluster: Any,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    real, killed = ZarrMap.put, []

    def put(self: ZarrMap, tile: slice, values: dict[str, Any]) -> None:
        if not killed:
            killed.extend(list(cluster.run(os.getpid).values())[:lost])
            for process in killed:
                os.kill(process, signal.SIGKILL)
        real(self, tile, values)

    monkeypatch.setattr(ZarrMap, "put", put)
    sm.error_map(machine, **CALL, out=tmp_path / "m.zarr", scheduler=cluster.scheduler.address).close()
    assert killed
    assert tree(tmp_path / "m.zarr") == whole


def test_a_scheduler_that_does_not_answer_is_said(machine: sm.Machine) -> None:
    pytest.importorskip("distributed")
    with pytest.raises(sm.StiffmapError, match="expected the address of a running dask scheduler"):
        sm.error_map(machine, **CALL, scheduler="nonsense://1")


# --- without storage


def test_statistics_are_those_of_the_map(machine: sm.Machine) -> None:
    call = {
        **CALL,
        "x": np.linspace(-0.2, 1.2, 12),
        "plane": "xy",
        "wrench": {"a": [300.0, 0, 0, 0, 0, 0], "b": [0.0, 0, -50, 0, 0, 0]},
    }
    ds = sm.error_map(machine, **call)
    stats = sm.map_statistics(machine, **call, percentiles=(10, 50, 99), chunk=5)
    assert (ds.status.values > 0).any()  # some poses are out of reach
    for name in ("deflection", "deflection_xy", "worst_deflection", "best_deflection_xy"):
        values = ds[name]
        over = ("y", "x")
        xr.testing.assert_equal(stats[f"{name}_max"].drop_attrs(), values.max(over).drop_attrs())
        xr.testing.assert_equal(stats[f"{name}_column_max"].drop_attrs(), values.max("z").drop_attrs())
        dims = ("percentile", *values.max(over).dims)
        for q in (10, 50, 99):
            exact = values.quantile(q / 100, over, method="inverted_cdf").transpose(*dims[1:])
            found = stats[f"{name}_percentile"].sel(percentile=q) / exact
            assert float(found.min()) >= 1
            assert float(found.max()) <= 1 + RELATIVE_WIDTH
    for z in ds.z.values:
        node = stats.worst_deflection_max_position.sel(z=z).values
        x, y, height = node
        assert height == z
        assert float(ds.worst_deflection.sel(x=x, y=y, z=z)) == float(stats.worst_deflection_max.sel(z=z))
    counts = [(ds.status == s).sum(("y", "x")) for s in range(5)]
    np.testing.assert_array_equal(stats.status_count, np.stack(counts, axis=-1))


def test_share_of_the_area_weighs_the_cells(machine: sm.Machine) -> None:
    """On an uneven axis: the integral of the indicator by the trapezoidal rule."""
    x = np.array([-0.2, -0.19, -0.1, 0.2, 0.3])
    call = CALL | {"x": x, "y": [0.0, 0.1], "z": 0.0, "tolerance": 1.4e-4}
    inside = sm.error_map(machine, **call).deflection.isel(z=0) <= 1.4e-4
    assert inside.any()
    assert not inside.all()
    area = np.trapezoid(np.trapezoid(inside.astype(float), x, axis=1), [0.0, 0.1])
    share = float(sm.map_statistics(machine, **call).deflection_within.item())
    assert share == pytest.approx(area / (0.5 * 0.1), rel=1e-12)


def test_histogram_bounds_every_percentile() -> None:
    rng = np.random.default_rng(0)
    values = np.concatenate([rng.lognormal(-9, 2, 999), [0.0], [np.nan]])
    h = Histogram()
    for part in np.array_split(values, 7):
        h.add(part)
    percent = np.array([0.0, 0.05, 1, 50, 99.9, 100])
    exact = np.nanpercentile(values, percent, method="inverted_cdf")
    found = h.percentiles(percent)
    assert (found >= exact).all()
    assert (found <= exact * (1 + RELATIVE_WIDTH)).all()


def test_an_estimate_counts_bytes_exactly(machine: sm.Machine, tmp_path: Path) -> None:
    e = sm.map_estimate(machine, **CALL)
    ds = sm.error_map(machine, **CALL)
    assert e.poses == 3 * 12 * 12
    assert e.result_bytes == sum(v.nbytes for v in ds.data_vars.values())
    assert 0 < e.seconds <= e.slowest
    assert "432 poses" in str(e)


def test_percentiles_outside_a_hundred_are_refused(machine: sm.Machine) -> None:
    with pytest.raises(sm.StiffmapError, match="percentiles: expected numbers from 0 to 100"):
        sm.map_statistics(machine, **CALL, percentiles=(50, 101))


def test_reading_a_damaged_map_is_refused(machine: sm.Machine, tmp_path: Path) -> None:
    out = tmp_path / "m.zarr"
    sm.error_map(machine, **CALL, out=out).close()
    chunk = out / "deflection/c/0/1/0"
    data = bytearray(chunk.read_bytes())
    data[10] ^= 1
    chunk.write_bytes(data)
    with pytest.raises(Exception, match=r"(?i)checksum"):
        read_dataset(out).deflection.load()
