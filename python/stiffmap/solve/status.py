"""How a pose ended (`Status`), and what else is to be known of it (`Flag`)."""

from stiffmap.solve.compiled.status import Flag, Status

__all__ = ["Flag", "Status"]
