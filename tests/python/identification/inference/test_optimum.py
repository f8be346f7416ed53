"""Least squares of a few numbers: bounds, directions without information, machines that cannot be; slopes by central differences."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares

import stiffmap as sm
from stiffmap.common.errors import StiffmapError
from stiffmap.experiment import Predictor
from stiffmap.experiment.calls import placed
from stiffmap.identification.inference.optimum import covariance, differences, optimum, triangular
from stiffmap.identification.planning import plan as design
from stiffmap.identification.planning.estimate import fitted, slopes, values_of, with_values

WIDE = (np.full(3, -np.inf), np.full(3, np.inf))
A = np.random.default_rng(0).standard_normal((8, 3))


def test_a_direction_without_information_is_left_where_it_begins():
    """The sum of the last two numbers alone is read, to round-off."""
    read = np.column_stack([A[:, 0], A[:, 1], A[:, 1] * (1 + 1e-13)])
    y = read @ [2.0, 3.0, 5.0]
    found = optimum(lambda x: read @ x - y, np.array([0.0, 1.0, 0.0]), WIDE, lambda x: read, 30)
    assert found.chi2 < 1e-16
    np.testing.assert_allclose(
        found.x, [2.0, 4.5, 3.5], atol=1e-8
    )  # the difference of the two is that of the start
    spread, rank = covariance(found.jacobian)
    assert rank == 2 and np.isinf(np.diag(spread)).tolist() == [False, True, True]
    assert spread[0, 0] == pytest.approx(np.linalg.inv(read[:, :2].T @ read[:, :2])[0, 0])


def test_nor_does_the_triangle_of_many_readings_move_along_it():
    """What no reading shows keeps its value, next to numbers that settle; scipy's own step leaves it anywhere."""
    read = np.column_stack([A[:, 0], A[:, 1], A[:, 1] * (1 + 1e-13)])
    y = read @ [2.0, 3.0, 5.0]
    none = np.zeros((len(y), 0))
    begin = np.array([0.0, 100.0, 40.0])
    found = triangular(lambda x: np.column_stack([read, read @ x - y]), none, begin, WIDE)
    np.testing.assert_allclose(found, [2.0, 34.0, -26.0], atol=1e-6)


def test_a_bound_holds_and_the_others_take_their_optimum_there():
    y = A @ [1.0, 2.0, 3.0]
    high = np.array([np.inf, np.inf, 2.5])
    found = optimum(lambda x: A @ x - y, np.zeros(3), (WIDE[0], high), lambda x: A, 50)
    best = np.linalg.lstsq(A[:, :2], y - 2.5 * A[:, 2])[0]
    np.testing.assert_allclose(found.x, [*best, 2.5], atol=1e-4)


def test_columns_that_are_held_leave_the_optimum_where_it_is():
    """Of three numbers one bends and is bounded, two are on straight lines with a prior; the oracle has all columns at once."""
    rng = np.random.default_rng(1)
    line, wave, prior = rng.standard_normal((40, 2)), np.linspace(0.0, 3.0, 40), np.eye(2, 3, 1)
    y = 3.0 * np.sin(0.9 * wave) + rng.standard_normal(40)

    def left(x: np.ndarray) -> np.ndarray:
        return y - 3.0 * np.sin(x[0] * wave) - line @ x[1:]

    def moving(x: np.ndarray) -> np.ndarray:
        if x[0] > 1.6:
            return np.full((42, 2), np.inf)
        bent = np.column_stack([-3.0 * wave * np.cos(x[0] * wave), left(x)])
        return np.vstack([bent, np.column_stack([np.zeros(2), x[1:]])])

    held = np.vstack([-line, np.eye(2)])
    for high in (np.inf, 0.5):
        bounds = np.array([-np.inf] * 3), np.array([high, np.inf, np.inf])
        found = triangular(moving, held, np.array([0.3, 0.0, 0.0]), bounds, ftol=1e-12, xtol=1e-12)
        best = least_squares(lambda x: np.append(left(x), prior @ x), found, bounds=bounds, xtol=1e-14)
        np.testing.assert_allclose(found, best.x, atol=1e-4)
        assert (abs(found[0] - high) < 1e-4) == np.isfinite(high)


def test_no_step_leads_where_the_machine_cannot_be():
    def residual(x: np.ndarray) -> np.ndarray:
        if x[0] > 2.0:
            raise StiffmapError("no equilibrium")
        return np.array([x[0] ** 3 - 1.0, 0.1 * x[0]])

    found = optimum(
        residual,
        np.array([0.05]),
        (np.zeros(1), np.full(1, 9.0)),
        lambda x: differences(residual, x, 1e-6),
        60,
    )
    assert found.x[0] == pytest.approx(1.0, abs=0.01)
    edge = differences(residual, np.array([2.0]), 1e-6)  # backwards
    np.testing.assert_allclose(edge[:, 0], [12.0, 0.1], rtol=1e-5)
    with pytest.raises(StiffmapError, match="no equilibrium"):
        optimum(
            residual,
            np.array([3.0]),
            (np.zeros(1), np.full(1, 9.0)),
            lambda x: differences(residual, x, 1e-6),
            9,
        )


@pytest.mark.parametrize(
    ("name", "texts", "options"),
    [
        (
            "orthoglide-revised",
            ["compliance actuator x scale=1.3", "dead_zone actuator y half_width=10um"],
            {},
        ),
        ("ur10", ["compliance elbow arm scale=1.2", "zero_offset shoulder arm error=1mrad"], {}),
        ("linear-delta", ["zero_offset carriage a error=50um", "compliance carriage b scale=1"], {}),
        ("orthoglide-revised", ["length bar x error=0.1mm"], {"quantity": "position"}),
    ],
)
def test_slopes_of_effects_are_central_differences(name, texts, options):
    machine = sm.load_machine(name)
    terms = tuple(placed(machine, t) for t in texts)
    plan = design(machine, terms, rows=4, poses=5, **options).experiment
    predictor, parameters = Predictor(machine, plan), fitted(machine.description, terms)
    found, x = slopes(predictor, terms, parameters), values_of(terms, parameters)
    for k, (_, p) in enumerate(parameters):
        h = 1e-2 * p.scale * (np.arange(len(x)) == k)
        up, down = (predictor(with_values(terms, parameters, v)) for v in (x + h, x - h))
        central = np.nan_to_num(up - down) / (2 * h[k])
        assert np.abs(found[..., k] - central).max() < 1e-3 * np.abs(central).max()
