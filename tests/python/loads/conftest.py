"""Makes the helpers beside the tests, and the small machines of the core's tests, importable."""

from __future__ import annotations

import sys
from pathlib import Path

here = Path(__file__).parent
sys.path[:0] = [str(here), str(here.parent / "core")]
