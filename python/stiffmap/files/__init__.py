"""Machine files: YAML to the SI description and back."""

from stiffmap.files.load import description_from_text, load_description
from stiffmap.files.shipped import ShippedMachine, shipped_machines

__all__ = [
    "ShippedMachine",
    "description_from_text",
    "load_description",
    "shipped_machines",
]
