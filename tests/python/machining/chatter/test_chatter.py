"""Chatter against published and exact numbers (docs/theory.md V4 to V6)."""

from __future__ import annotations

import warnings
from functools import cache

import numpy as np
import pytest
import xarray as xr

import stiffmap as sm
from stiffmap.machining.chatter.cut import (
    chips,
    cut_axes,
    milling_process,
    mode_rows,
    modes_of_machine,
    multiplier_map,
)
from stiffmap.machining.chatter.lobes import border, pockets
from stiffmap.machining.chatter.zero_order import at_periods, coupling_depth, limits
from stiffmap.solve.compiled import multipliers
from stiffmap.ui.cli import main
from stiffmap.workspace.vibration.modes import tip_modes

ONE = [(922.0, 0.011, 0.03993, "x")]
ZERO = {"Kac": "0 N/mm2", "Kte": "0 N/mm", "Kre": "0 N/mm", "Kae": "0 N/mm"}
TWO = [*ONE, (922.0, 0.011, 0.03993, "y")]


def process(radial=10.0, side="climb", diameter=10.0, Kt=600.0, Kr=200.0, axial=1.0):
    return {
        "name": "cut", "tool": {"diameter": f"{diameter} mm", "teeth": 2}, "spindle": "5000 rpm",
        "feed": "0.1 mm/tooth", "cut": {"side": side, "radial": f"{radial} mm", "axial": f"{axial} mm"},
        "law": {"end_mill": {"Ktc": f"{Kt} N/mm2", "Krc": f"{Kr} N/mm2", **ZERO}},
    }  # fmt: skip


@pytest.mark.parametrize(("depth", "limit"), [(0.2e-3, 0.81974), (0.5e-3, 1.07398), (1.0e-3, 1.40647)])
def test_one_mode_tends_to_the_published_multiplier_with_order_two(depth, limit):
    k = np.array([80, 160, 320, 640])
    mu = [sm.floquet_multiplier(ONE, process(), "5000 rpm", depth, intervals=int(n)) for n in k]
    off = limit - np.array(mu)
    np.testing.assert_allclose(mu[3] + (mu[3] - mu[2]) / 3, limit, atol=1.2e-5)
    assert off[0] / off[1] == pytest.approx(4, rel=0.05) and off[1] / off[2] == pytest.approx(4, rel=0.1)


@pytest.mark.parametrize(
    ("share", "rpm", "depth", "mu"),
    [(0.05, 15e3, 1e-3, 0.956), (0.1, 10e3, 1e-3, 1.0038), (0.5, 5e3, 0.5e-3, 1.991)],
)
def test_two_modes_at_low_immersion(share, rpm, depth, mu):
    found = sm.floquet_multiplier(TWO, process(10 * share), rpm * np.pi / 30, depth, intervals=80)
    assert found == pytest.approx(mu, abs=6e-4)


def test_borders_of_the_delay_oscillator_are_exact():
    """x'' + d x = b x(t - 2 pi): a constant chip law makes it of one mode; borders b = (-1)^n (d - n²/4).

    The force a H (x - x(t - T)) with H = -1, mass 1: x'' + (w² + a) x = a x(t - T), so d = w² + a, b = a.
    """
    chip = np.zeros((400, 3, 2))
    chip[:, 0, 0] = -1.0

    def size(d, b):
        one = np.ones(1)
        w = np.sqrt(d - b) * one
        return float(
            multipliers(w, 0 * one, one, np.eye(3)[:1], np.zeros((3, 3)), chip, 2 * np.pi * one, b * one, 1)[
                0, 0
            ]
        )

    for n, d in ((0, 0.1), (1, 0.6), (2, 1.15), (3, 2.0), (4, 4.1)):
        b = (-1) ** n * (d - n**2 / 4)
        if not 0 < abs(b) < d:
            continue
        inside, outside = size(d, 0.97 * b), size(d, 1.03 * b)
        near = size(d, b)
        assert near == pytest.approx(1, abs=2e-4), (n, d)
        assert (inside - 1) * (outside - 1) < 1e-8 or max(inside, outside) > 1 + 1e-4


RESIDUES = {
    0: ((452.77, 0.123718, 9.202966e-5 - 1.862195e-4j), (1448.53, 0.01651, -4.181562e-5 - 3.043618e-4j)),
    1: ((516.17, 0.0243, -2.3929e-6 - 1.721539e-4j), (1407.64, 0.0324, 4.055052e-5 - 3.618808e-4j)),
}


@cache
def published_receptance():
    f = np.linspace(100, 3000, 20001)
    s = 2j * np.pi * f
    G = np.zeros((len(f), 6, 6), complex)
    for axis, modes in RESIDUES.items():
        for hertz, ratio, residue in modes:
            w = 2 * np.pi * hertz
            pole = -ratio * w + 1j * w * np.sqrt(1 - ratio**2)
            G[:, axis, axis] += residue / (s - pole) + np.conj(residue) / (s - np.conj(pole))
    return xr.DataArray(G, dims=("frequency", "response", "force"), coords={"frequency": f})


@pytest.mark.parametrize(
    ("side", "radial", "limit"),
    [("climb", 15.875, 1.015), ("conventional", 15.875, 1.564), ("slot", 31.75, 0.504)],
)
def test_zero_order_of_two_modes_per_axis(side, radial, limit):
    cut = process(radial, side, 31.75, 1319.4, 788.8)
    assert 1e3 * sm.limiting_depth(published_receptance(), cut) == pytest.approx(limit, abs=6e-4)


def test_zero_order_is_the_border_of_a_full_slot():
    """In a slot of many teeth the directional factors hardly vary: both methods then agree."""
    cut = process(10.0, "slot")
    cut["tool"]["teeth"] = 8
    speed = np.array([3000.0, 4000.0, 5200.0]) * np.pi / 30
    ds = sm.stability_lobes(TWO, cut, speeds=speed, depths=np.linspace(2e-6, 4e-4, 200), intervals=160)
    np.testing.assert_allclose(ds.limit, ds.limit_zero_order, rtol=0.02)
    assert ds.attrs["least"] <= ds.limit.min()


def test_chips_are_the_means_of_their_integrand():
    p = milling_process(process(3.0, "conventional"))
    k = 7
    found = chips(p, k)
    first, last = 0.0, np.arccos(1 - 2 * 3.0 / 10.0)
    phi = (np.arange(k * 4000) + 0.5) * np.pi / (k * 4000)
    value = np.zeros((len(phi), 3, 2))
    for tooth in range(2):
        at = phi + tooth * np.pi
        on = (at >= first) & (at <= last)
        force = np.stack(
            [-6e8 * np.cos(at) - 2e8 * np.sin(at), 6e8 * np.sin(at) - 2e8 * np.cos(at), 0 * at], -1
        )
        value += on[:, None, None] * force[:, :, None] * np.stack([np.sin(at), np.cos(at)], -1)[:, None, :]
    np.testing.assert_allclose(found, value.reshape(k, 4000, 3, 2).mean(axis=1), atol=2e-4 * 6e8)


def test_a_rest_that_follows_at_once_is_a_stiff_mode():
    """Flexibility without mass against a mode far above all others."""
    p = milling_process(process(5.0))
    high = mode_rows([*ONE, (60e3, 0.3, 1.0, (1.0, 0.0, 0.0))])
    rest = high.below(5e3, 0.0)
    assert len(rest) == 1 and rest.rest[0, 0] == pytest.approx(1 / high.stiffness[1])
    s, d = np.array([5000.0, 9000.0]) * np.pi / 30, np.array([2e-4, 6e-4])
    with_mode, without = (multiplier_map(m, p, s, d, 320, 1) for m in (high, rest))
    np.testing.assert_allclose(without, with_mode, rtol=2e-4)


def test_modes_couple_where_eigenvalues_turn_complex():
    """Two equal modes never do (K = k I); two that differ do at a depth that the 2x2 gives by hand."""
    cut = process(10.0, "slot")
    rows = [(20.0, 0.02, 60.0, (1.0, 1.0, 0.0)), (23.0, 0.02, 60.0, (1.0, -1.0, 0.0))]
    m = mode_rows(rows)
    from stiffmap.machining.chatter.cut import mean_chips

    A = m.way @ mean_chips(milling_process(cut)) @ m.way[:, :2].T / 60.0
    w1, w2 = (2 * np.pi * np.array([20.0, 23.0])) ** 2

    def gap(a):
        return (w1 - w2 - a * (A[0, 0] - A[1, 1])) ** 2 + 4 * a**2 * A[0, 1] * A[1, 0]

    depths = np.linspace(1e-6, 5e-3, 200001)
    found = np.flatnonzero(gap(depths) < 0)
    assert found.size
    a = depths[found[0]]
    free = [(f, 1e-6, mass, way) for f, _, mass, way in rows]
    assert coupling_depth(free, cut) == pytest.approx(a, rel=5e-3)
    assert coupling_depth(rows, cut) > a  # damping holds a little longer
    depth = coupling_depth(rows, cut)
    for softer in (1e-2, 1e-5):  # masses and springs: below the first depth that is tried, too
        soft = [(f, z, softer * m, way) for f, z, m, way in rows]
        assert coupling_depth(soft, cut) == pytest.approx(softer * depth, rel=1e-5)


def time_domain(modes, p, speed, depth, steps, periods=60):
    """(cells,) growth of one tooth period: the equation with delay, integrated by Runge and Kutta's method of order four."""
    law, n, cells = p.law, p.tool.teeth, len(speed)
    T = (2 * np.pi / (n * speed))[:, None]
    own = 2 * np.pi * modes.frequency
    h, still = T / steps, modes.rest[:2]

    @cache
    def gain(part):
        """Force over the displacement without the part that follows at once, less that of the last pass; of a tooth period."""
        A = np.zeros((3, 2))
        for at in 2 * np.pi / n * (part + np.arange(n)):
            if p.cut.side == "slot" and at <= np.pi:
                s, c = np.sin(at), np.cos(at)
                t, r, a = law.Ktc, law.Krc, law.Kac
                A += np.outer([-t * c - r * s, t * s - r * c, a], [s, c])
        A = depth[:, None, None] * A
        return np.linalg.solve(np.eye(3) - A @ still, A)

    def force(part, bare, before):
        F = (gain(part % 1) @ (bare - before)[..., None])[..., 0]
        return F, bare + F @ still.T

    def rate(q, v, F):
        return v, F @ modes.way.T / modes.mass - own**2 * q - 2 * modes.ratio * own * v

    past = np.zeros((2 * steps + 1, cells, 2))
    q, v = np.ones((cells, len(modes))), np.zeros((cells, len(modes)))
    way, size = modes.way[:, :2], []
    for _ in range(periods):
        now = np.zeros_like(past)
        for i in range(steps):
            F, now[2 * i] = force(i / steps, q @ way, past[2 * i])
            a0, b0 = rate(q, v, F)
            a1, b1 = rate(
                q + h / 2 * a0,
                v + h / 2 * b0,
                force((i + 0.5) / steps, (q + h / 2 * a0) @ way, past[2 * i + 1])[0],
            )
            a2, b2 = rate(
                q + h / 2 * a1,
                v + h / 2 * b1,
                force((i + 0.5) / steps, (q + h / 2 * a1) @ way, past[2 * i + 1])[0],
            )
            last = past[2 * i + 2] if i + 1 < steps else now[0]
            a3, b3 = rate(q + h * a2, v + h * b2, force((i + 1) / steps, (q + h * a2) @ way, last)[0])
            new, fast = q + h / 6 * (a0 + 2 * a1 + 2 * a2 + a3), v + h / 6 * (b0 + 2 * b1 + 2 * b2 + b3)
            middle = (q + new) / 2 + h / 8 * (v - fast)
            now[2 * i + 1] = force((i + 0.5) / steps, middle @ way, past[2 * i + 1])[1]
            q, v = new, fast
        past = now
        past[-1] = force(0.0, q @ way, now[0])[1]
        size.append(np.log((past**2).sum(axis=(0, 2))) / 2)
    third = periods // 3
    return np.exp((np.mean(size[2 * third :], axis=0) - np.mean(size[third : 2 * third], axis=0)) / third)


@pytest.mark.parametrize(
    ("name", "given", "rpm"),
    [
        ("ur10", "slot", (700, 2000)), ("linear-delta", "slot", (6000, 9000)),
        ("orthoglide-revised", "slot", (2500, 4000)), ("hexapod", "slot", (6000, 9000)),
        ("examples/taps/kr210.yaml", "examples/taps/cut.yaml", (700, 1000)),
    ],
)  # fmt: skip
def test_lobes_of_machines_in_the_time_domain(name, given, rpm):
    """Half, nine tenths, six fifths and twice the limit, and how fast the deepest grows."""
    speeds = np.array(rpm) * np.pi / 30
    ds = sm.stability_lobes(name, given, speeds=speeds, depths=1e-4 * np.linspace(0, 50, 31)[1:])
    shares = np.array([0.5, 0.9, 1.2, 2])
    speed, depth = np.repeat(speeds, 4), (ds.limit.values[:, None] * shares).ravel()
    machine = sm.load_machine(name)
    axes = cut_axes(np.array(ds.attrs["feed"]), np.array(ds.attrs["tool"]))
    modes = modes_of_machine(tip_modes(machine, machine.description.home.p)).turned(axes).below(np.inf)
    found = time_domain(modes, milling_process(given), speed, depth, 120 if "kr210" in name else 240).reshape(
        2, 4
    )
    assert ((found < 1) == (shares < 1)).all()
    mu = [
        sm.floquet_multiplier(modes, given, s, 2 * d, 320)
        for s, d in zip(speeds, ds.limit.values, strict=True)
    ]
    np.testing.assert_allclose(found[:, 3], mu, rtol=4e-3)


def test_lobes_of_a_machine_and_their_pockets():
    ds = sm.stability_lobes("ur10", "slot", speeds=np.linspace(300, 900, 12), method="zero order")
    assert ds.limit.shape == (12,) and (ds.limit >= ds.attrs["least"] * (1 - 1e-9)).all()
    assert "assumed" in ds.attrs["damping"] and ds.attrs["modes"] >= 5
    assert pockets(np.arange(5.0), np.array([1.0, 3.0, 2.0, 4.0, 1.0]), 10.0) == [[3.0, 4.0], [1.0, 3.0]]
    np.testing.assert_allclose(
        border(np.array([1.0, 2.0, 3.0]), np.array([[0.5, 0.9, 1.1], [0.1, 0.2, 0.3]])), [2.0, np.inf]
    )


def test_limiting_depth_of_poses_and_at_one_speed():
    machine = sm.load_machine("orthoglide-revised")
    p = np.array([[0.0, 0.0, 0.0], [0.05, -0.05, 0.02], [9.0, 9.0, 9.0]])
    H = sm.frequency_response(machine, p, np.linspace(5, 400, 800))
    least = sm.limiting_depth(H, "slot")
    assert least.shape == (3,) and np.isnan(least[2]) and (least[:2] > 0).all()
    at = sm.limiting_depth(H[:2], "slot", speed="6000 rpm")
    assert (at >= least[:2] * (1 - 1e-9)).all()


@pytest.mark.parametrize(
    ("modes", "given", "message"),
    [
        ([], {}, "got none"),
        ([(922, 0.011)], {}, "frequency Hz, damping ratio, mass kg, direction"),
        ([(922, 1.1, 1.0, "x")], {}, "below 1"),
        ([(922, 0.0, 1.0, "x")], {}, "damping ratio above zero"),
        ([(922, 0.1, 0.0, "x")], {}, "a mass .kg. above zero"),
        ([(922, 0.1, 1.0, "w")], {}, "direction x, y, z"),
        (ONE, {"speed": "5000 turns"}, "5000 rpm"),
        (ONE, {"speed": -3.0}, "above zero in rad/s"),
        (ONE, {"depth": 5.0}, "depth of cut in m"),
        (ONE, {"intervals": 1}, "intervals"),
    ],
)
def test_bad_input_is_one_message(modes, given, message):
    with pytest.raises(sm.StiffmapError, match=message):
        sm.floquet_multiplier(modes, process(), **given)


def test_a_coated_tool_has_no_lobes():
    with pytest.raises(sm.StiffmapError, match="no teeth"):
        sm.floquet_multiplier(ONE, "trimming")


@pytest.mark.parametrize("name", ["ur10", "linear-delta", "orthoglide-revised", "hexapod"])
def test_limiting_depth_is_no_deeper_than_any_sample(name):
    """A coarse receptance answers as a dense one: the least limit is found between the samples."""
    machine = sm.load_machine(name)
    own = sm.natural_frequencies(machine, machine.description.home.p, modes=6).frequency
    own = own[np.isfinite(own)]
    f = np.linspace(0.3 * own.min(), 2 * own.max(), 200_001)
    at = machine.description.home.p
    axes = cut_axes(np.array([1.0, 0, 0]), np.array([0, 0, 1.0]))
    dense = axes @ sm.frequency_response(machine, at, f).values[:, :3, :3] @ axes.T
    least = limits(dense, milling_process("slot"))[0].min()
    for count in (60, 200, 400):
        coarse = sm.frequency_response(machine, at, np.linspace(f[0], f[-1], count))
        found = sm.limiting_depth(coarse, "slot")
        assert 0.997 * least < found <= least * (1 + 1e-5), count
    modes = modes_of_machine(tip_modes(machine, at)).turned(axes)
    assert sm.limiting_depth(modes, "slot") <= least * (1 + 1e-5)
    ds = sm.vibration_map(machine, np.array([at]), "slot")
    assert float(ds.limiting_depth[0]) <= least * (1 + 1e-5)


@cache
def dense_limits(name):
    """Samples so dense that no limit lies between them: machine, frequencies, depths, angles."""
    machine = sm.load_machine(name)
    at = machine.description.home.p
    own = sm.natural_frequencies(machine, at, modes=6).frequency
    axes = cut_axes(np.array([1.0, 0, 0]), np.array([0, 0, 1.0]))
    many = np.linspace(0.3 * np.nanmin(own), 2 * np.nanmax(own), 20_001)
    H = sm.frequency_response(machine, at, many).values[:, :3, :3]
    return machine, many, *limits(axes @ H @ axes.T, milling_process("slot"))


@pytest.mark.parametrize("name", ["ur10", "linear-delta", "orthoglide-revised", "hexapod"])
@pytest.mark.parametrize(("count", "noise"), [(5, 0.0), (10, 0.0), (20, 0.0), (60, 0.0), (60, 1e-3)])
@pytest.mark.parametrize("speed", [None, "6000 rpm"])
def test_few_or_noisy_samples_are_safe_or_an_estimate(name, count, noise, speed):
    machine, many, depth, angle = dense_limits(name)
    f, p = np.linspace(many[0], many[-1], count), milling_process("slot")
    dense = depth.min() if speed is None else at_periods(many, depth, angle, np.array([np.pi / p.spindle]))[0]
    H = sm.frequency_response(machine, machine.description.home.p, f)
    rng = np.random.default_rng(1)
    H = H + noise * np.abs(H) * (rng.normal(size=H.shape) + 1j * rng.normal(size=H.shape))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        found = sm.limiting_depth(H, "slot", speed=speed)
    assert any("is an estimate" in str(w.message) for w in said) or 0 < found <= dense * 1.001


@pytest.mark.parametrize(
    ("spindle", "top", "count"), [(5000, 3.0, 5), (6500, 2.0, 7), (9000, 2.5, 20), (4000, 1.5, 2)]
)
def test_depths_that_are_said_to_be_stable_are(spindle, top, count):
    cut = {**process(), "spindle": f"{spindle} rpm"}
    speeds = np.linspace(0.5, 1.3, 9) * spindle * 2 * np.pi / 60
    ds = sm.stability_lobes(
        TWO, cut, speeds=speeds, depths=1e-3 * np.linspace(0, top, count + 1)[1:], intervals=80
    )
    said = [(milling_process(cut).spindle, ds.attrs["limit_at_process"]), *ds.attrs["stable_speeds"]]
    said += zip(speeds, ds.limit.values, strict=True)
    for speed, limit in said:
        if 0 < limit < np.inf:
            assert sm.floquet_multiplier(TWO, cut, speed=float(speed), depth=float(limit), intervals=80) < 1
    limit = ds.attrs["limit_at_process"]
    if np.isfinite(limit):
        assert sm.floquet_multiplier(TWO, cut, depth=1.01 * limit, intervals=80) >= 1


def test_a_tool_stands_along_the_flange_by_default(capsys):
    for name, tool in (("ur10", [0, 0, 1]), ("examples/taps/kr210.yaml", [-1, 0, 0]), ("hexapod", [0, 0, 1])):
        ds = sm.stability_lobes(name, "slot", speeds=[300.0, 400.0], method="zero order")
        np.testing.assert_allclose(ds.attrs["tool"], tool, atol=1e-3)
        assert abs(np.dot(ds.attrs["tool"], ds.attrs["feed"])) < 0.71
    turned = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0.0]]) @ sm.load_machine("ur10").description.home.r
    ds = sm.stability_lobes("ur10", "slot", rotation=turned, speeds=[300.0], method="zero order")
    np.testing.assert_allclose(ds.attrs["tool"], [0, -1, 0], atol=1e-9)
    main(["lobes", "ur10", "--process", "slot", "--speeds", "2000,3000", "--points", "3,3"])
    said = capsys.readouterr().out
    assert "damping assumed: 2 % of every mode" in said.splitlines()[0]
    assert "tool from tip to holder along (0, 0, 1), feed along (1, 0, 0)" in said


@pytest.mark.parametrize(
    ("option", "given", "good"),
    [
        ("--damping", "0.02", "2%"), ("--damping", "3,0.015", "3,1.5"), ("--damping", "0", "0.02%"), ("--damping", "300", "3"),
        ("--mode", "1243,0.062,0.048,x", "1243,6.2%,0.048,x"),
    ],
)  # fmt: skip
def test_a_ratio_is_not_taken_for_a_percentage(option, given, good, capsys):
    start = ["lobes", "five-bar", "--process", "slot", "--method", "zero order", "--points", "3,2", option]
    assert main([*start, given]) == 2
    said = capsys.readouterr().err
    assert f"{option}: expected % above 0 and below 100" in said and "0.02 may be a ratio" in said
    assert main([*start, good]) < 2


def test_what_nothing_damps_couples_at_no_depth():
    modes = [
        (20.0, 1e-300, 60.0, (1.0, 1.0, 0.0)),
        (20.0, 1e-300, 60.0, (1.0, -1.0, 0.0)),
        (60.0, 1e-300, 9.0, "y"),
    ]
    assert 0 <= coupling_depth(modes, process(10.0, "slot")) < 1e-9


def test_a_diagram_has_the_points_that_are_asked_for_whatever_its_ends(tmp_path):
    for i, ends in enumerate(([], ["--speeds", "2000,3000"], ["--depth", "1"])):
        to = tmp_path / str(i)
        main(["lobes", "five-bar", "--process", "slot", "--points", "4,3", *ends, "-o", str(to)])
        with xr.open_dataset(to / "lobes.nc") as ds:
            assert dict(ds.multiplier.sizes) == {"speed": 4, "depth": 3}
    for bad in (5, (1, 3), (4, 3.5), "ab"):
        with pytest.raises(sm.StiffmapError, match="diagram: expected numbers of speeds and of depths"):
            sm.stability_lobes("five-bar", "slot", diagram=bad)
