"""Link springs from displacement fields and finite elements, with their uncertainty (docs/link.md)."""

from stiffmap.link.identify import identify_link
from stiffmap.link.result import Link
from stiffmap.link.transport import transport_compliance

__all__ = ["Link", "identify_link", "transport_compliance"]
