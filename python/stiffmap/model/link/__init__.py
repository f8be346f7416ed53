"""Link springs from displacement fields and finite elements, with their uncertainty (docs/link.md)."""

from stiffmap.model.link.linkfile import LinkFile, load_link, save_link
from stiffmap.model.link.transport import transport_compliance

__all__ = ["LinkFile", "load_link", "save_link", "transport_compliance"]
