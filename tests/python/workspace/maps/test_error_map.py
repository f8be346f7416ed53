"""Error maps against direct solves, brute force over directions, and themselves in other chunks."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr

import stiffmap as sm

BOX = np.array([-0.2, 0.05, 0.3])
CASES = {"Fx": [300.0, 0, 0, 0, 0, 0], "Fy": [0, 300.0, 0, 0, 0, 0]}
DEGREES = np.deg2rad(np.arange(0, 360, 6))


def in_plane(angle: np.ndarray, force: np.ndarray | float) -> np.ndarray:
    """Forces (…, 6) in the xy plane."""
    zero = np.zeros(np.broadcast_shapes(np.shape(angle), np.shape(force)))
    return np.stack([force * np.cos(angle), force * np.sin(angle), zero, zero, zero, zero], axis=-1)


def test_values_are_those_of_solve(machine: sm.Machine, ds: xr.Dataset, positions: np.ndarray) -> None:
    assert ds.displacement.dims == ("z", "y", "x", "case", "component")
    for name, wrench in CASES.items():
        s = machine.solve(positions, wrench)
        one = ds.sel(case=name)
        np.testing.assert_array_equal(one.displacement, s.displacement)
        np.testing.assert_array_equal(one.compliance, s.compliance)
        np.testing.assert_allclose(
            one.deflection, np.linalg.norm(s.displacement[..., :3], axis=-1), rtol=1e-14
        )
        np.testing.assert_allclose(
            one.deflection_xy, np.linalg.norm(s.displacement[..., :2], axis=-1), rtol=1e-14
        )
        np.testing.assert_array_equal(one.wrench, wrench)


@pytest.mark.parametrize(("suffix", "parts"), [("", 3), ("_xy", 2)])
def test_extremes_bracket_every_direction(
    machine: sm.Machine, ds: xr.Dataset, positions: np.ndarray, suffix: str, parts: int
) -> None:
    d = machine.solve(positions[..., None, :], in_plane(DEGREES, 300.0)).displacement
    size = np.linalg.norm(d[..., :parts], axis=-1)
    worst, best = ds[f"worst_deflection{suffix}"], ds[f"best_deflection{suffix}"]
    # The nearest sample lies up to 3 degrees beside the extremum of an ellipse of this ratio.
    ratio = size.max(axis=-1) / size.min(axis=-1)
    beside = np.sqrt(1 + (ratio * np.sin(np.deg2rad(3))) ** 2)
    assert np.all(worst >= size.max(axis=-1) * (1 - 1e-7))
    assert np.all(worst <= size.max(axis=-1) * 1.002)
    assert np.all(best <= size.min(axis=-1) * (1 + 1e-7))
    assert np.all(best >= size.min(axis=-1) / beside * 0.999)
    for word in ("worst", "best"):
        angle = ds[f"{word}_direction{suffix}"].values
        again = machine.solve(positions, in_plane(angle, 300.0)).displacement
        np.testing.assert_allclose(
            np.linalg.norm(again[..., :parts], axis=-1), ds[f"{word}_deflection{suffix}"], rtol=1e-9
        )


@pytest.mark.parametrize(("suffix", "parts"), [("", 3), ("_xy", 2)])
def test_force_limit_reaches_the_tolerance(
    machine: sm.Machine, ds: xr.Dataset, positions: np.ndarray, suffix: str, parts: int
) -> None:
    wrench = in_plane(ds[f"worst_direction{suffix}"].values, ds[f"force_limit{suffix}"].values)
    d = machine.solve(positions, wrench).displacement[..., :parts]
    np.testing.assert_allclose(np.linalg.norm(d, axis=-1), 0.25e-3, rtol=1e-7)


def test_chunks_and_threads_change_no_bit(machine: sm.Machine, ds: xr.Dataset) -> None:
    for chunk, threads in ((1, 2), (7, 1), (10_000, 2)):
        other = sm.error_map(
            machine, x=BOX, y=BOX, z=[-0.2, 0.3], wrench=CASES, compliance=True, chunk=chunk, threads=threads
        )
        assert ds.identical(other)


def test_a_pose_is_the_same_in_any_grid(machine: sm.Machine, ds: xr.Dataset) -> None:
    one = sm.error_map(machine, x=0.05, y=0.3, z=-0.2, wrench=CASES, compliance=True)
    part = ds.sel(x=[0.05], y=[0.3], z=[-0.2])
    for name in ds.data_vars:
        np.testing.assert_array_equal(one[name], part[name])


def test_single_wrench_has_no_case_axis(machine: sm.Machine) -> None:
    ds = sm.error_map(machine, x=0.0, y=0.0, z=0.0, wrench=[0, 0, 100.0, 0, 0, 0], plane=None)
    assert ds.deflection.dims == ("z", "y", "x")
    assert "worst_deflection" not in ds
    assert ds.deflection.item() > 0


def test_planes(machine: sm.Machine) -> None:
    maps = {
        p: sm.error_map(machine, x=0.1, y=-0.1, z=0.2, wrench=[300.0, 0, 0, 0, 0, 0], plane=p)
        for p in ("xy", "xz", "yz")
    }
    for p, ds in maps.items():
        assert ds[f"worst_deflection_{p}"].item() <= ds.worst_deflection.item()
    parts = maps["xz"].displacement.squeeze().values[[0, 2]]
    assert maps["xz"].deflection_xz.item() == pytest.approx(np.linalg.norm(parts), rel=1e-14)


def test_unreachable_poses_are_nan_with_status(machine: sm.Machine) -> None:
    ds = sm.error_map(machine, x=[0.0, 5.0], y=0.0, z=0.0, wrench=[300.0, 0, 0, 0, 0, 0], compliance=True)
    assert ds.status.values.ravel().tolist() == [sm.Status.CONVERGED, sm.Status.UNREACHABLE]
    assert ds.direction_status.values.ravel().tolist() == [sm.Status.CONVERGED, sm.Status.UNREACHABLE]
    for name, values in ds.data_vars.items():
        if values.dtype.kind == "f":
            assert np.isfinite(values.isel(x=0)).all(), name
            assert np.isnan(values.isel(x=1)).all(), name


def test_unstable_poses_are_nan_in_maps_and_kept_in_sweeps(machine: sm.Machine) -> None:
    force = 6.0e3  # beyond the buckling load in the home configuration, 4.2 to 4.9 kN along x
    swp = sm.sweep(machine, np.zeros(3), [1.0, 0.0, 0.0], [0.0, 300.0, force])
    assert swp.status.values.tolist() == [sm.Status.CONVERGED, sm.Status.CONVERGED, sm.Status.UNSTABLE]
    assert np.isfinite(swp.deflection[2])
    ds = sm.error_map(machine, x=0.0, y=0.0, z=0.0, wrench=[force, 0, 0, 0, 0, 0])
    assert ds.status.item() == ds.direction_status.item() == sm.Status.UNSTABLE
    assert np.isnan(ds.displacement).all()
    assert np.isnan([ds.worst_deflection.item(), ds.worst_direction.item(), ds.force_limit.item()]).all()


def test_attributes_say_what_was_done(machine: sm.Machine, ds: xr.Dataset) -> None:
    for name, values in ds.data_vars.items():
        assert values.attrs["units"], name
        assert values.attrs["long_name"], name
    call = json.loads(ds.attrs["call"])
    assert call["function"] == "error_map"
    assert call["x"] == BOX.tolist()
    assert call["wrench"] == list(CASES.values())
    assert not {"threads", "chunk", "out", "progress"} & call.keys()
    assert ds.attrs["machine"] == machine.name
    assert ds.attrs["reference_point"] == "tcp"
    assert ds.attrs["wrench_order"].startswith("fx fy fz mx my mz")
    assert "base axes" in ds.attrs["axes"]
    assert ds.attrs["stiffmap_version"] == sm.__version__
    assert ds.force_limit.attrs["tolerance_m"] == 0.25e-3


def test_the_call_makes_the_map_again(machine: sm.Machine, ds: xr.Dataset) -> None:
    call = json.loads(ds.attrs["call"])
    assert call.pop("function") == "error_map"
    assert sm.error_map(machine, **call).identical(ds)


def test_every_value_that_is_missing_has_a_status(machine: sm.Machine) -> None:
    x = np.linspace(-0.9, 0.9, 9)
    ds = sm.error_map(machine, x=x, y=x, z=0.0, wrench=[2000.0, 0, 0, 0, 0, 0])
    assert set(np.unique(ds.direction_status)) >= {0, 1, 3}
    for suffix in ("", "_xy"):
        np.testing.assert_array_equal(np.isfinite(ds[f"worst_deflection{suffix}"]), ds.direction_status == 0)
        np.testing.assert_array_equal(np.isfinite(ds[f"best_deflection{suffix}"]), ds.direction_status == 0)
    np.testing.assert_array_equal(np.isfinite(ds.deflection), ds.status == 0)
