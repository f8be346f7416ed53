"""The machine file as it is written: pydantic models, no conversion and no numerics."""

from stiffmap.model.files.schema.machine import MachineFile

__all__ = ["MachineFile"]
