# %% [markdown]
# # A machine of one's own
#
# From a text of thirty lines to an error map: a planar five-bar from a sketch (motors 200 mm apart, arms 250 mm, forearms
# 300 mm, the tool where the forearms meet).

# %%
# %matplotlib inline
import stiffmap as sm
from stiffmap.solve.advice import advice
from stiffmap.solve.trial import tried

LEG = """
    elements:
      - {actuator: motor, kind: revolute, axis: z, home: %s, compliance: 3.0e-8}
      - {offset: arm_length, translation: [250, 0, 0]}
      - {spring: arm, beam: {length: 250, tube: {outer: 30, inner: 24}, material: steel}}
      - {joint: elbow, kind: revolute, axis: z, home: %s}
      - {offset: forearm_length, translation: [300, 0, 0]}
      - {spring: forearm, beam: {length: 300, tube: {outer: 30, inner: 24}, material: steel}}
"""
TEXT = (
    """name: my-five-bar
units: {length: mm, force: N, angle: deg}
home: {translation: [0, 400, 0], solve: true}   # the angles below are a first guess
task: [x, y]
workspace: {x: [-80, 80], y: [340, 440], z: [-1, 1]}
materials: {steel: {E: 2.1e5, nu: 0.3}}
legs:
  left:
    frame: {translation: [-100, 0, 0]}"""
    + LEG % (120, -80)
    + """  right:
    frame: {translation: [100, 0, 0]}"""
    + LEG % (60, 80)
    + "      - {joint: pin, kind: revolute, axis: z, home: 0}\n"
)
with open("my-five-bar.yaml", "w", encoding="utf-8") as stream:
    stream.write(TEXT)
machine = sm.load_machine("my-five-bar.yaml")
machine

# %% [markdown]
# What an experienced colleague would ask about the file, and the softest direction over the workspace:

# %%
softest = tried(machine).stiffness
print(advice(machine, "my-five-bar.yaml") or "nothing odd")
print("N/µm:", [round(1e-6 * v, 2) for v in softest])

# %% [markdown]
# The map: the worst direction of 50 N at every position.

# %%
import numpy as np

from stiffmap.ui.plot import map_figure

x, y = np.linspace(-0.08, 0.08, 33), np.linspace(0.34, 0.44, 21)
ds = sm.error_map(machine, x=x, y=y, z=[0.0], wrench=[50, 0, 0, 0, 0, 0], tolerance=2.5e-4, progress=False)
assert bool((ds.status == 0).all())
map_figure(ds, variable="worst_deflection_xy", tolerance=2.5e-4)
