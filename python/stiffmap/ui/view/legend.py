"""What the colours of the scene mean, and what in it can be dragged, as HTML."""

from __future__ import annotations

from html import escape

import numpy as np

from stiffmap.common.number_text import length_text
from stiffmap.ui.plot.scene import FORCE
from stiffmap.ui.plot.skeleton import Skeleton
from stiffmap.ui.plot.style import BLACK, TOLERANCE, leg_colours
from stiffmap.ui.view.moment import Moment
from stiffmap.ui.view.place import turns
from stiffmap.ui.view.quantities import tolerance_level
from stiffmap.ui.view.scene import DARK, GHOST, GREY

DOT = "width:.7em;height:.7em;border-radius:50%;border:1px solid #888"
PADDED = "padding:.3em .6em;font-size:85%"
SQUARE, LINE = "width:.7em;height:.7em", "width:1.4em;height:.25em"


def legend(moment: Moment, rest: Skeleton, factor: float) -> str:
    """Rows of what is drawn of this machine; `factor`: the magnification of the deflected one."""
    state = moment.state
    size = float(np.linalg.norm(state.force))
    rows = [(LINE, c, f"leg {leg}") for leg, c in leg_colours(moment.machine.legs).items() if leg]
    rows += [(LINE, GREY, "travel of the drives")] if len(rest.guides) else []
    rows += [(SQUARE, BLACK, "drive")] if len(rest.actuators) else []
    rows += [(DOT, "#FFFFFF", "passive joint")] if len(rest.passive) else []
    rows += [(SQUARE, DARK, "platform")] if len(rest.plate) else []
    rows += [("width:.6em;height:.6em;border:1px solid #888", "none", "workspace box")]
    rows += [(LINE, GHOST, f"under the load, × {factor:g}")] if factor else []
    rows += [(LINE, FORCE, f"force, {size:.4g} N")] if size else []
    if tolerance_level(state.quantity, state.tolerance) is not None:
        rows.append((LINE, TOLERANCE, f"tolerance, {length_text(state.tolerance)}"))
    said = "".join(
        f'<span style="display:inline-block;margin-right:1em"><span style="display:inline-block;vertical-align:middle;{shape};'
        f'background:{colour}"></span> {escape(text)}</span> '
        for shape, colour, text in rows
    )
    return f'<div style="{PADDED}">{said}</div>'


def hint(moment: Moment) -> str:
    """What can be dragged."""
    turned = "; its rings turn it" if any(turns(moment.machine)) else ""
    return (
        f'<div style="{PADDED}"><b>Drag</b> the tool by its arrows and squares{turned}. Drag the force by the arrows at its tail. '
        "Click the plane to place the probe, and drag its red dot.</div>"
    )
