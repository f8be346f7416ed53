"""The meshes of a URDF in the scene, on the joints of the machine that was imported from it."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

from stiffmap.common.broadcasting import Floats
from stiffmap.common.errors import FileError, needed
from stiffmap.model.urdf.chains import plain_name
from stiffmap.model.urdf.reader import read_urdf
from stiffmap.solve.machine import Machine

NODE = "/meshes"


class Meshes:
    """Draws what a URDF draws; called with all coordinates (m, rad) of the machine, it moves it there.

    Raises FileError for a file that is no URDF, holds nothing that is drawn or has no joint of the machine, and
    MissingPartError without the extra ``[view]``.
    """

    def __init__(self, api: object, machine: Machine, urdf: Path) -> None:
        with needed("drawing meshes of a URDF", "view"):
            import yourdfpy
            from viser.extras import ViserUrdf
        model = read_urdf(urdf)
        joints = {plain_name(j.name): j.name for j in model.moving if j.mimic is None}
        places = machine.compiled.names.joints
        self._places = {
            joints[n]: at for name, at in places.items() if (n := name.rpartition(".")[2]) in joints
        }
        if not self._places:
            raise FileError(f"no joint of {machine.name} is in it", file=str(urdf))
        missing: list[str] = []

        def resolved(fname: str) -> str:
            file = str(yourdfpy.filename_handler_magic(fname, dir=str(urdf.parent)))
            if not Path(file).is_file():
                missing.append(fname)
            return file

        with _in_words(urdf):
            found = yourdfpy.URDF.load(str(urdf), filename_handler=resolved)
            if not found.scene.geometry:
                raise FileError("none of the meshes that it names can be read", file=str(urdf))
            self._shown = ViserUrdf(SimpleNamespace(scene=api), found, root_node_name=NODE)  # type: ignore[arg-type]
        self.remark = f"meshes that were not found: {', '.join(dict.fromkeys(missing))}" if missing else ""
        """What of the file is not drawn; empty where all is."""

    def __call__(self, coordinates: Floats) -> None:
        self._shown.update_cfg({joint: float(coordinates[at]) for joint, at in self._places.items()})  # type: ignore[arg-type]


@contextmanager
def _in_words(urdf: Path) -> Iterator[None]:
    """What the reader of meshes refuses, in one line; what it only remarks is not printed."""
    log = logging.getLogger("yourdfpy")
    before = log.level
    log.setLevel(logging.CRITICAL)
    try:
        yield
    except FileError:
        raise
    except Exception as problem:  # whatever a file of a mesh makes its reader raise
        raise FileError(f"its meshes cannot be read: {problem}", file=str(urdf)) from None
    finally:
        log.setLevel(before)
