"""Toolpaths: G-code, CL files, tables of points, built-in outlines; points along them and how the tool engages there."""

from stiffmap.machining.toolpath.engagement import Engagement, Points, box, engagement, sampled
from stiffmap.machining.toolpath.load import load_path
from stiffmap.machining.toolpath.outlines import outline, outline_names, outline_text
from stiffmap.machining.toolpath.path import Kind, Placement, Toolpath, path_of

__all__ = [
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
    "sampled",
]
