"""`stiffmap link`: the command lives next to what it does; this module keeps ``--help`` quick."""

from stiffmap.ui.cli.link_command import link_command

__all__ = ["link_command"]
