"""Poles and flexibilities of responses with noise against the modes of the machine that they are of."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import curve_fit
from threadpoolctl import threadpool_info, threadpool_limits

import stiffmap as sm
from stiffmap.workspace.vibration import extraction, tip_modes
from stiffmap.workspace.vibration.extraction import _noise, extract_modes
from stiffmap.workspace.vibration.files import MeasuredResponse


@pytest.mark.parametrize("coherent", [True, False])
@pytest.mark.parametrize("name", ["ur10", "five-bar", "travelling-column"])
def test_modes_of_a_machine_within_their_uncertainty(name, coherent):
    machine = sm.load_machine(name)
    low, high = machine.workspace
    p = low + 0.4 * (high - low)
    modes = tip_modes(machine, p, damping=0.03)
    flexibility = modes.tip[0, :3] * modes.tip[0, :3].sum(axis=0) / np.sqrt(3)
    f = np.linspace(0.4 * modes.frequency[0, 0], 1.3 * modes.frequency[0, 1], 500)
    H = sm.frequency_response(machine, p, f, damping=0.03).values[:, :3, :3].sum(axis=2) / np.sqrt(3)
    rng = np.random.default_rng(3)
    s = 0.01 * np.abs(H) + 1e-4 * np.abs(H).max()
    noisy = H + s * (rng.normal(size=(*H.shape, 2)) @ [1, 1j]) / np.sqrt(2)
    c = 1 / (1 + 5 * s**2 / np.abs(H) ** 2) if coherent else np.full(H.shape, np.nan)
    found = extract_modes([MeasuredResponse("", f, noisy[:, a], c[:, a]) for a in range(3)])
    size = np.linalg.norm(found.flexibility, axis=1)
    k = int(np.argmax(size))
    j = int(np.argmin(np.abs(modes.frequency[0] - found.frequency[k])))
    assert (
        abs(found.frequency[k] - modes.frequency[0, j]) < 4 * found.u_frequency[k] < 0.01 * found.frequency[k]
    )
    assert abs(found.ratio[k] - 0.03) < 4 * found.u_ratio[k] < 0.006
    assert (
        np.abs(found.flexibility[k] - flexibility[:, j]) < 4 * found.u_flexibility[k] + 0.02 * size[k]
    ).all()


def test_noise_alone_has_no_mode():
    f, rng = np.linspace(5, 50, 400), np.random.default_rng(0)
    H = 1e-6 * (rng.normal(size=(400, 2)) @ [1, 1j])
    assert not len(extract_modes([MeasuredResponse("", f, H, np.full(400, np.nan))]).frequency)


def test_uncertainties_are_the_scatter_of_many_measurements():
    """Two modes whose peaks overlap: flexibilities are uncertain by noise, and by the poles that it moves."""
    f, rng = np.linspace(20, 40, 300), np.random.default_rng(4)
    poles = [(28.0, 0.05, 1e-6), (31.0, 0.05, 2e-6)]
    H = sum(a * o**2 / (o**2 - f**2 + 2j * z * o * f) for o, z, a in poles)
    s = 0.02 * np.abs(H).max()
    found = []
    for _ in range(30):
        noisy = H + s * (rng.normal(size=(len(f), 2)) @ [1, 1j]) / np.sqrt(2)
        found.append(extract_modes([MeasuredResponse("", f, noisy, np.full(len(f), np.nan))]))
    found = [m for m in found if len(m.frequency) == 2]
    assert len(found) > 20
    for name in ("frequency", "ratio", "flexibility"):
        values = np.array([getattr(m, name).reshape(2) for m in found])
        promised = np.array([getattr(m, f"u_{name}").reshape(2) for m in found])
        ratio = values.std(axis=0, ddof=1) / np.sqrt((promised**2).mean(axis=0))
        assert ((ratio > 0.6) & (ratio < 1.5)).all(), (name, ratio)


def test_uncertainties_are_those_of_a_curve_fit():
    """One mode between masses below and stiffnesses above, few readings: scipy's covariance, scaled by the misfit per degree of freedom."""
    f, rng = np.linspace(20, 40, 40), np.random.default_rng(6)
    H = 1e-6 * 28**2 / (28**2 - f**2 + 2j * 0.05 * 28 * f) + 2e-7
    H = H + 2e-7 * (rng.normal(size=(len(f), 2)) @ [1, 1j])
    one = MeasuredResponse("", f, H, np.full(len(f), np.nan))
    found, s = extract_modes([one]), _noise(one, np.full(len(f), True))

    def model(_, frequency, ratio, real, turned, above, below):
        q = (real + 1j * turned * f / frequency) / (1 - (f / frequency) ** 2 + 2j * ratio * f / frequency)
        q = 1e-6 * (q + above + 400 * below / f**2)
        return np.r_[q.real, q.imag]

    best, C = curve_fit(model, None, np.r_[H.real, H.imag], [28, 0.05, 1, 0, 0.2, 0], np.r_[s, s])
    u = np.sqrt(np.diag(C))
    np.testing.assert_allclose([found.frequency[0], found.ratio[0]], best[:2], rtol=1e-4)
    np.testing.assert_allclose(
        [found.u_frequency[0], found.u_ratio[0], found.u_flexibility[0, 0] / 1e-6], u[:3], rtol=5e-3
    )


@pytest.mark.parametrize("coherence", [np.nan, 0.999])
@pytest.mark.parametrize("digits", [17, 6])
@pytest.mark.parametrize(("frequency", "ratio"), [(31.831, 0.03), (31.831, 0.01), (50, 0.1), (80, 0.002)])
def test_rounding_is_no_mode_and_no_certainty(frequency, ratio, digits, coherence):
    f = np.linspace(0, 100, 401)
    H = 1e-6 / (1 - (f / frequency) ** 2 + 2j * ratio * f / frequency)
    H = np.array([complex(*(float(f"{v:.{digits - 1}e}") for v in (h.real, h.imag))) for h in H])
    found = extract_modes([MeasuredResponse("", f, H, np.full(len(f), coherence))])
    assert found.frequency == pytest.approx([frequency], rel=1e-6)
    assert found.ratio == pytest.approx([ratio], rel=1e-4)
    assert found.u_ratio[0] > 1e-7 * ratio


def test_an_extraction_runs_on_one_thread(monkeypatch):
    seen, noise = set(), extraction._noise

    def watched(*given):
        seen.update(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas")
        return noise(*given)

    monkeypatch.setattr(extraction, "_noise", watched)
    f = np.linspace(5, 50, 40)
    with threadpool_limits(limits=2, user_api="blas"):
        extract_modes([MeasuredResponse("", f, 1e-6 / (1 - (f / 20) ** 2 + 0.1j), np.full(40, np.nan))])
    assert seen == {1}
