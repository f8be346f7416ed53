"""Machine files: YAML to the SI description and back."""

from stiffmap.files.check import FileCheck, check_file
from stiffmap.files.load import description_from_text, load_description
from stiffmap.files.save import description_text, save_description
from stiffmap.files.shipped import ShippedMachine, shipped_machines

__all__ = [
    "FileCheck",
    "ShippedMachine",
    "check_file",
    "description_from_text",
    "description_text",
    "load_description",
    "save_description",
    "shipped_machines",
]
