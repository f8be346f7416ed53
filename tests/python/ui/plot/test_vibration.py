"""Pictures of vibration."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from tests.python.ui.plot.test_pictures import cut

from stiffmap.ui.plot.modes import RPM, lobes_figure


@pytest.mark.parametrize(
    ("depth", "shown", "words"),
    [(1e-3, (6000.0, 1.0), "1 mm"), (3e-3, (6000.0, 2.0), "3 mm, beyond these axes")],
)
def test_the_process_is_seen_in_the_lobes_wherever_it_lies(
    depth: float, shown: tuple[float, float], words: str
) -> None:
    speed, depths = np.linspace(3000, 9000, 5) / RPM, np.linspace(5e-4, 2e-3, 4)
    lobes = xr.Dataset(
        {"multiplier": (("speed", "depth"), np.full((5, 4), 0.9)), "limit_zero_order": ("speed", np.full(5, 1e-3))},
        coords={"speed": speed, "depth": depths}, attrs={"damping": "of 2 %"},
    )  # fmt: skip
    figure = lobes_figure(lobes, "a machine", 6000 / RPM, depth)
    ax = figure.axes[0]
    lines = {line.get_label(): line for line in ax.lines}
    (label,) = (name for name in lines if name.startswith("the process"))
    assert label == f"the process: 6000 rpm, {words}"
    np.testing.assert_allclose(np.ravel(lines[label].get_data()), shown)
    assert "border, semi-discretization" not in lines  # all is stable
    assert cut(figure) == []
