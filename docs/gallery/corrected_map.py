# %% [markdown]
# # A corrected machine, its map, its table for the controller
#
# A boring mill whose ram's drive has a lead error of 30 µm per metre and another of 3 µm that comes back every 400 mm, and whose
# spindle yields twice as much as declared.

# %%
# %matplotlib inline
import numpy as np

import stiffmap as sm
from stiffmap.machining.compensation import axis_errors, compensation_table
from stiffmap.ui.plot import map_figure

declared = sm.load_machine("travelling-column")
corrected = declared.with_effect("lead_error", element="ram_drive", legs=["machine"], slope=3e-5)
corrected = corrected.with_effect(
    "periodic_error", element="ram_drive", legs=["machine"], amplitude=3e-6, period=0.4
)
corrected = corrected.with_effect("compliance", element="spindle", legs=["machine"], scale=2.0)

y, z = np.linspace(0.65, 1.3, 27), np.linspace(0.62, 1.58, 25)
cutting = [0, 0, -1000, 0, 0, 0]
maps = {
    name: sm.error_map(
        m, x=[0.0], y=y, z=z, wrench={"F": cutting}, plane="yz", tolerance=3e-5, progress=False
    )
    for name, m in (("declared", declared), ("corrected", corrected))
}
shift = 1e6 * (maps["corrected"].deflection - maps["declared"].deflection)
print(f"the corrected map differs by {float(shift.min()):.1f} to {float(shift.max()):.1f} µm")
map_figure(maps["corrected"], variable="deflection_yz", case="F", tolerance=3e-5)

# %% [markdown]
# The positioning error along the ram (E_YY of ISO 230-1), and what a controller with linear interpolation leaves of it:

# %%
errors = axis_errors(corrected, "y", np.linspace(0.65, 1.3, 14), wrench=cutting)
forward, _ = errors.positioning
print(f"E_YY from {1e6 * forward.min():.1f} to {1e6 * forward.max():.1f} µm; "
      f"interpolation leaves {1e6 * errors.interpolation:.3f} µm")  # fmt: skip
print(compensation_table(errors, "linuxcnc"))

# %%
fine = np.linspace(0.65, 1.3, 101)
command = errors.corrected(fine)
p = np.column_stack([0 * fine, command, np.full(101, corrected.description.home.p[2])])
left = command + corrected.solve(p, cutting).displacement[:, 1] - fine
assert np.abs(left).max() < 1.1 * errors.interpolation < 0.1 * np.abs(forward).max()
print(f"with the table the tool is {1e6 * np.abs(left).max():.2f} µm off at most")
