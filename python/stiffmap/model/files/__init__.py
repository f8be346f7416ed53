"""Machine files: YAML to the SI description and back."""

from stiffmap.model.files.load import description_from_text, load_description
from stiffmap.model.files.save import description_text, save_description
from stiffmap.model.files.shipped import ShippedMachine, shipped_machines

__all__ = [
    "ShippedMachine", "description_from_text", "description_text", "load_description", "save_description",
    "shipped_machines",
]  # fmt: skip
