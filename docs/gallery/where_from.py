# %% [markdown]
# # Where the deflection comes from
#
# The same force at the end of a short and of a long ram: which part gives way?

# %%
# %matplotlib inline
import matplotlib.pyplot as plt
import numpy as np

import stiffmap as sm

machine = sm.load_machine("travelling-column")
force = [0, 0, -1000, 0, 0, 0]
sm.deflection_budget(machine, [0, 1.3, 1.1], force)

# %%
reach = np.linspace(0.64, 1.3, 23)
budgets = [sm.deflection_budget(machine, [0, y, 1.1], force) for y in reach]
parts = {
    n: [1e6 * np.linalg.norm(b.displacement[:3]) * b.shares[i] for b in budgets]
    for i, n in enumerate(budgets[0].elements)
}
largest = sorted(parts, key=lambda n: -max(np.abs(parts[n])))[:6]

figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
axes.stackplot(1e3 * reach, [parts[n] for n in largest], labels=largest)
axes.set(
    xlabel="y of the tool, mm",
    ylabel="deflection under 1000 N, µm",
    title="The ram takes over where it is long",
)
_ = axes.legend(loc="upper left", fontsize=8)

# %% [markdown]
# Pulled in, the drive of the head, the spindle and the column lead; far out it is the ram, which bends with the third power of its
# length. A file with a ram of one length would not know.

# %%
ram = next(n for n in parts if n.endswith(".ram"))
share = [b.shares[b.elements.index(ram)] for b in (budgets[0], budgets[-1])]
print(f"the ram's share: {100 * share[0]:.0f} % pulled in, {100 * share[1]:.0f} % at full reach")
assert share[1] > 4 * share[0]
