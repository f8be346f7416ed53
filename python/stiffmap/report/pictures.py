"""Pictures inside a page."""

from __future__ import annotations

import base64
from io import BytesIO

from matplotlib.figure import Figure


def inline(figure: Figure) -> str:
    """PNG as a data address."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()
