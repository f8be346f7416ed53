"""Toolpaths: G-code, CL files, tables of points, built-in outlines; points along them and how the tool engages there."""

from stiffmap.toolpath.engagement import Box, Engagement, box, engagement, plate
from stiffmap.toolpath.load import load_path
from stiffmap.toolpath.outlines import outline, outline_names, outline_text
from stiffmap.toolpath.path import Kind, Placement, Toolpath, path_of
from stiffmap.toolpath.sampling import Points, sampled

__all__ = [
    "Box",
    "Engagement",
    "Kind",
    "Placement",
    "Points",
    "Toolpath",
    "box",
    "engagement",
    "load_path",
    "outline",
    "outline_names",
    "outline_text",
    "path_of",
    "plate",
    "sampled",
]
