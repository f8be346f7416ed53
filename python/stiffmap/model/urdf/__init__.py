"""URDF files, with a sidecar for what they cannot say, as machines."""

from stiffmap.model.urdf.importing import Imported, import_urdf

__all__ = ["Imported", "import_urdf"]
