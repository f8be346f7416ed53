# %% [markdown]
# # What the file does not know
#
# A machine is measured with dial gauges. Something in it is softer than its file says; nobody knows what. Here the machine is a
# twin, so that the answer can be checked.

# %%
# %matplotlib inline
import stiffmap as sm
from stiffmap.experiment import random_plan, simulate
from stiffmap.model.description import AppliedEffect

machine = sm.load_machine("orthoglide-revised")
hidden = AppliedEffect("compliance", "actuator", ("z",), (("scale", 2.15),))
data = simulate(machine, random_plan(machine, "deflection", poses=12, seed=7), [hidden], seed=5)
data

# %% [markdown]
# How far are the readings from what the file predicts?

# %%
sm.residual(machine, data)

# %% [markdown]
# Which effect explains it, where, how large:

# %%
found = sm.diagnose(machine, data, seed=1, cross_validate=False)
effect = found.effects[0]
value, low, high, _ = effect.parameters["scale"]
assert (effect.kind, effect.element, effect.legs) == ("compliance", "actuator", ("z",))
assert low < 2.15 < high
found

# %% [markdown]
# What is left beside noise, before and after:

# %%
from stiffmap.ui.report.diagnosis.pictures import histogram

histogram(found)

# %% [markdown]
# `found.report("report.html", date="…")` writes the page that a workshop signs, `found.machine.save(…)` the corrected machine.
