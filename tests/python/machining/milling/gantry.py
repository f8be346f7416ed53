"""A machine whose stiffness is known: three slides at right angles, and its drives' compliances."""

from __future__ import annotations

import stiffmap as sm
from stiffmap.model.files.load import description_from_text
from stiffmap.solve.machine import Machine

TEXT = """
name: gantry
units: {{length: mm, force: N, angle: deg}}
home: {{translation: [0, 0, 0]}}
workspace: {{x: [-200, 200], y: [-200, 200], z: [-200, 200]}}
legs:
  arm:
    elements:
      - {{actuator: x, kind: prismatic, axis: x, compliance: {x}, range: [-200, 200]}}
      - {{actuator: y, kind: prismatic, axis: y, compliance: {y}, range: [-200, 200]}}
      - {{actuator: z, kind: prismatic, axis: z, compliance: {z}, range: [-200, 200]}}
"""


def gantry(x: float = 1e-3, y: float = 1e-3, z: float = 1e-3) -> Machine:
    """Compliances in mm/N."""
    return sm.Machine(description_from_text(TEXT.format(x=x, y=y, z=z)))
