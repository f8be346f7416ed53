"""The first page of a diagnosis: the named element lit, planar residuals as arrows in their plane, trends only where there are any."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from matplotlib.colors import same_color
from matplotlib.quiver import Quiver
from numpy.typing import NDArray

import stiffmap as sm
from stiffmap.experiment import random_plan, simulate
from stiffmap.identification.diagnosis import Diagnosis
from stiffmap.model.description import AppliedEffect
from stiffmap.ui.plot.experiment import drivers_of, trending
from stiffmap.ui.report.diagnosis.page import html
from stiffmap.ui.report.diagnosis.pictures import LIT, figures, place_figure, vectors

RECORD = (
    ("operator", "M. Weber"),
    ("instrument", "three dial gauges"),
    ("certificate", "K-2291"),
    ("notes", "table clamped"),
    ("source", "readings.xlsx"),
    ("sha256", "0123456789abcdef" * 4),
)


@cache
def diagnosed(name: str, *term: str) -> Diagnosis:
    machine = sm.load_machine(name)
    terms = [AppliedEffect(term[0], term[1], (term[2],), ((term[3], float(term[4])),))] if term else []
    e = simulate(machine, random_plan(machine, "deflection", poses=8, seed=7), terms, seed=5)
    return sm.diagnose(machine, replace(e, record=RECORD), seed=1, cross_validate=False)


@cache
def words_of(d: Diagnosis) -> str:
    """The page without its style and its list of files."""
    return html(d).split("</style>")[-1].split("<h2>Provenance")[0]


def planar() -> Diagnosis:
    return diagnosed("five-bar", "compliance", "motor", "left", "scale", "2.15")


def lit(d: Diagnosis) -> NDArray[np.float64]:
    """(n, 2) mm: the dots in the colour of a place that is named."""
    (ax,) = place_figure(d).axes
    found = [c for c in ax.collections if same_color(c.get_facecolor()[0], LIT)]
    return np.vstack([np.asarray(c.get_offsets()) for c in found])


def test_the_named_motor_is_lit() -> None:
    d = planar()
    (effect,) = d.effects
    np.testing.assert_allclose(lit(d), [[-150.0, 0.0]], atol=1e-6)
    right = replace(effect, legs=("right",))
    np.testing.assert_allclose(lit(replace(d, effects=[right])), [[150.0, 0.0]], atol=1e-6)


def test_an_instrument_is_no_part_of_the_machine() -> None:
    """Its place is the tool."""
    d = planar()
    instrument = replace(d.effects[0], element="instrument", legs=())
    tool = 1e3 * d.declared.description.home.p[:2]
    np.testing.assert_allclose(lit(replace(d, effects=[instrument])), [tool], atol=1e-6)


def test_arrows_of_planar_readings_stay_in_their_plane_and_on_the_canvas() -> None:
    d = planar()
    figure = vectors(d)
    assert [ax.name for ax in figure.axes] == ["rectilinear"] * 2
    for ax in figure.axes:
        assert (ax.get_xlabel(), ax.get_ylabel()) == ("x, mm", "y, mm")
        (arrows,) = (c for c in ax.collections if isinstance(c, Quiver))
        ends = np.asarray(arrows.XY) + np.stack([arrows.U, arrows.V], axis=1)
        for limits, values in ((ax.get_xlim(), ends[:, 0]), (ax.get_ylim(), ends[:, 1])):
            assert limits[0] < values.min() and values.max() < limits[1]


def test_trends_are_shown_where_residuals_follow_a_driver() -> None:
    d = planar()
    shown, others = trending(d)
    assert {name for name, *_ in shown} == {"fx, N", "fy, N"}
    assert len(shown) + len(others) == len(drivers_of(d.experiment))
    page = words_of(d)
    assert page.index("Residual of every reading against the conditions on which it depends") < page.index(
        "<details><summary>Residuals"
    )


def test_without_a_cause_no_trend_is_shown() -> None:
    d = diagnosed("five-bar")
    assert trending(d)[0] == []
    assert "residual_trends" not in figures(d)


def test_the_first_page_carries_the_record() -> None:
    page = words_of(planar())
    first = page.split('<div class="page">')[0]
    for text in (
        "M. Weber",
        "three dial gauges, K-2291",
        "table clamped",
        "readings.xlsx, sha256 0123456789abcdef",
    ):
        assert text in first
    for text in ("measured by", "checked by", "names are red"):
        assert text in first


def no_private_words(d: Diagnosis) -> None:
    for internal in ("`", " nats", "actuator", "the machine fails with it"):
        assert internal not in words_of(d), internal


def test_no_private_words() -> None:
    no_private_words(planar())


def test_no_private_words_of_a_drive() -> None:
    no_private_words(diagnosed("orthoglide-revised", "compliance", "actuator", "x", "scale", "2.15"))
