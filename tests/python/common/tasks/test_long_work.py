"""All that takes minutes, on a cluster of two workers of which one is killed: the answer of a local run, to the last bit."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

import stiffmap as sm
import stiffmap.machining.chatter.workspace as workspace_of_chatter
from stiffmap.common.tasks import OnCluster
from stiffmap.machining.milling.placement import placements
from stiffmap.machining.milling.redundancy import redundancy
from stiffmap.machining.milling.setting import Setting, setting
from stiffmap.machining.process import load_process
from stiffmap.machining.toolpath import outline, sampled

Work = Callable[[Any], dict[str, Any]]
"""Some long work, given a scheduler: what came out."""
GLIDE = "orthoglide-revised"


def lobes(scheduler: Any) -> dict[str, Any]:
    speed, depth = np.linspace(200, 900, 6), np.linspace(1e-4, 4e-3, 3)
    ds = sm.stability_lobes(GLIDE, "slot", speeds=speed, depths=depth, scheduler=scheduler)
    return {"multiplier": ds.multiplier.values, "limit": ds.limit.values}


def vibration(scheduler: Any) -> dict[str, Any]:
    p = np.stack(
        np.meshgrid(*[np.linspace(-0.1, 0.2, n) for n in (4, 4, 3)], indexing="ij"), axis=-1
    ).reshape(-1, 3)
    with patch.object(workspace_of_chatter, "BLOCK", 18):  # three tasks
        ds = sm.vibration_map(GLIDE, p, "slot", frequencies=np.geomspace(20, 400, 8), scheduler=scheduler)
    return {name: v.values for name, v in ds.data_vars.items()}


def placing(scheduler: Any) -> dict[str, Any]:
    machine, cut = sm.load_machine(GLIDE), load_process("trimming")
    found = placements(machine, outline("rectangle"), cut, count=500, points=60, scheduler=scheduler)
    return {"largest": found.largest, "best": found.best_error, "at": found.best.at, "turn": found.best.turn}


@lru_cache
def arm_job() -> Setting:
    path = outline("washbasin")
    machine = sm.load_machine("ur10")
    return setting(
        machine, path, load_process("trimming"), sampled(path, 0.1), path.placed((-0.75, -0.1, 0.3))
    )


def turning(scheduler: Any) -> dict[str, Any]:
    found = redundancy(arm_job(), 12, fastest=None, scheduler=scheduler)
    return {"angle": found.angle, "error": found.error}


def box(scheduler: Any) -> dict[str, Any]:
    found = sm.largest_box(GLIDE, tolerance=1e-3, scheduler=scheduler)
    assert found.proven
    return {k: getattr(found, k) for k in ("edge", "edge_upper", "centre", "limited_by", "poses")}


def workspace(scheduler: Any) -> dict[str, Any]:
    found = sm.workspace_volume(GLIDE, transmission=(0.5, 2.0), cells=10, prove=4000, scheduler=scheduler)
    assert found.proven > 0
    return {"volume": found.volume, "proven": found.proven}


def measures(scheduler: Any) -> dict[str, Any]:
    only = ["largest_box", "transmission_min", "condition", "singularity", "accuracy"]
    table = sm.measures(GLIDE, only=only, nodes=33, box_tolerance=1e-3, threads=1, scheduler=scheduler)
    k = table.case.kinematics
    assert table.case.scheduler is None  # the client does not outlive the call
    return {
        "plain": table.as_plain(),
        "jacobian": k.jacobian,
        "coordinates": k.coordinates,
        "status": k.status,
    }


def monte_carlo(scheduler: Any) -> dict[str, Any]:
    from bench.link_monte_carlo import run

    return dict(run(120, 7, scheduler=scheduler))


def oracle(scheduler: Any) -> dict[str, Any]:
    from tests.oracle.nightly import judge, on_cluster

    seeds = list(range(1, 9))
    results = [judge(s) for s in seeds] if scheduler is None else list(on_cluster(seeds, scheduler))
    kept = {r["seed"]: {k: v for k, v in r.items() if k != "cpu"} for r in results}
    return {str(seed): kept[seed] for seed in seeds}


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    distributed = pytest.importorskip("distributed")
    import dask

    with (
        dask.config.set({"distributed.deploy.lost-worker-timeout": "300s"}),  # they come back, however late
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        ) as here,
        distributed.Client(here, set_as_default=False) as client,
    ):
        yield client


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    "work",
    [lobes, vibration, placing, turning, box, workspace, measures, monte_carlo, oracle],
)
def test_a_worker_is_killed(work: Work, cluster: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    here = work(None)
    cluster.wait_for_workers(2, timeout=120)
    killed, whole = [], OnCluster.as_done

    def as_done(self: OnCluster, items: Iterable[Any]) -> Iterator[tuple[int, Any]]:
        for found in whole(self, items):
            if not killed:
                killed.append(next(iter(cluster.run(os.getpid).values())))
                os.kill(killed[0], signal.SIGKILL)
            yield found

    monkeypatch.setattr(OnCluster, "as_done", as_done)
    there = work(cluster)
    assert killed, "nothing went to the cluster"
    assert there.keys() == here.keys()
    for name, value in here.items():
        np.testing.assert_equal(there[name], value, err_msg=name)


@pytest.mark.parametrize("work", [lobes, placing, turning, box, workspace, measures])
def test_a_scheduler_that_is_none_is_said(work: Work) -> None:
    pytest.importorskip("distributed")
    with pytest.raises(sm.StiffmapError, match="expected the address of a running dask scheduler"):
        work("nonsense://1")


@pytest.mark.parametrize(
    "command",
    [
        ["lobes", GLIDE, "--process", "slot", "--points", "4,3"],
        ["measures", GLIDE, "--only", "condition", "--nodes", "3"],
        ["mill", GLIDE, "rectangle", "--process", "trimming", "--place", "4"],
    ],
    ids=lambda c: c[0],
)
def test_commands_take_a_scheduler(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("distributed")
    from stiffmap.ui.cli.app import main

    assert main([*command, "--scheduler", "nonsense://1"]) == 2
    assert "expected the address of a running dask scheduler" in capsys.readouterr().err
