"""Boxes and volumes of the workspace in which every requirement holds."""
