"""Heavy libraries of the extra ``[fea]``, imported only when finite elements are asked for."""

from __future__ import annotations

import ctypes
import importlib
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

from stiffmap.common.errors import StiffmapError


def need(module: str) -> ModuleType:
    """The module, or one error that says how to install it.

    Raises:
        StiffmapError: the module or a system library of it is missing.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError:
        raise StiffmapError(
            f"finite elements need {module}, which is not installed: pip install stiffmap[fea]"
        ) from None
    except OSError as error:  # gmsh's wheel loads libGLU and libX11 libraries of the system
        raise StiffmapError(
            f"{module} is installed but misses a system library ({error}); on Debian: "
            "apt install libglu1-mesa libxcursor1 libxft2 libxinerama1"
        ) from None


@contextmanager
def gmsh_session() -> Iterator[ModuleType]:
    """A fresh, silent gmsh model; its errors become :class:`StiffmapError`.

    Lengths in the model are millimetres, since OpenCASCADE's tolerances are absolute.
    """
    gmsh = need("gmsh")
    with _same_action(
        "SIGPIPE"
    ):  # gmsh takes the default: a connection that is closed later would end the process
        gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.NumThreads", 1)  # meshes repeat bit for bit
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        yield gmsh
    except StiffmapError:
        raise
    except Exception as error:
        if type(error) is not Exception:  # gmsh raises bare Exception; anything else is ours
            raise
        raise StiffmapError(f"gmsh: {' '.join(str(error).split())}") from None
    finally:
        gmsh.finalize()


@contextmanager
def _same_action(name: str) -> Iterator[None]:
    """What the process does on a signal is the same before and after, in any thread, whatever a library sets meanwhile."""
    if not hasattr(signal, name):  # a system without it
        yield
        return
    number, sigaction = int(getattr(signal, name)), ctypes.CDLL(None).sigaction
    action = ctypes.create_string_buffer(512)  # a struct sigaction has some 150 bytes
    sigaction(number, None, action)
    try:
        yield
    finally:
        sigaction(number, action, None)
