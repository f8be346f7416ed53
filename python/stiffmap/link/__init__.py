"""Link springs from displacement fields and finite elements, with their uncertainty (docs/link.md)."""

from stiffmap.link.identify import identify_link
from stiffmap.link.linkfile import LinkFile, load_link, save_link
from stiffmap.link.result import Link
from stiffmap.link.transport import transport_compliance

__all__ = ["Link", "LinkFile", "identify_link", "load_link", "save_link", "transport_compliance"]
