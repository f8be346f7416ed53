"""Opening a view, from Python and from the command."""

from __future__ import annotations

import threading
import time
import webbrowser
from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from numpy.typing import ArrayLike

from stiffmap.common.broadcasting import given_path, real_array
from stiffmap.common.errors import StiffmapError
from stiffmap.common.open_view import OpenView
from stiffmap.solve.machine import Machine
from stiffmap.ui.view.data import Data, findings
from stiffmap.ui.view.model import ViewModel, first_state
from stiffmap.ui.view.serving import HERE, LOCAL, Guard, need_viser, silent, start_server
from stiffmap.ui.view.state import ViewState, as_plain, from_permalink, from_plain, permalink
from stiffmap.ui.view.viewer import Viewer

if TYPE_CHECKING:
    from stiffmap.experiment import Experiment
    from stiffmap.identification.diagnosis.report.result import Diagnosis
    from stiffmap.machining.toolpath import Toolpath

POLL = 0.2  # s between two looks whether the view is closed


class View(OpenView):
    """A view that is open; `close` ends it, as the end of a ``with`` block and of the program do."""

    def __init__(
        self, model: ViewModel, host: str = HERE, port: int | None = None, data: Data | None = None
    ) -> None:
        need_viser()
        self._guard = Guard(host, self._go)
        self._server = start_server(host, port, self._guard, model.declared.name)
        try:
            self._viewer = Viewer(model, self._server, data)
        except BaseException:
            with silent():
                self._server.stop()
            raise
        self._watch = None if model.file is None else Watch(model.file, self._reload)

    @property
    def url(self) -> str:
        """Address to open in a browser; beyond this computer it holds the token."""
        host = HERE if self._guard.host in LOCAL else self._guard.host
        token = f"/?token={self._guard.token}" if self._guard.token else ""
        shown = f"[{host}]" if ":" in host else host
        return f"http://{shown}:{self._server.get_port()}{token}"

    @property
    def link(self) -> str:
        """The address with a permalink: machine, pose, load, plane and changed numbers."""
        name = self._viewer.controls.outputs.source
        joint = "&" if "?" in self.url else "/?"
        return f"{self.url}{joint}state={permalink(name, self.state)}"

    @property
    def state(self) -> ViewState:
        """What is on the screen."""
        return self._viewer.model.state

    def set(self, **values: Any) -> None:
        """New values of the state, such as ``force=(0, 0, -500)``; SI. StiffmapError for bad ones."""
        with self._viewer.lock:
            self._viewer.model.put(**values)
        self._viewer.worker.ask()

    def _go(self, word: str) -> None:
        def deed(model: ViewModel) -> None:
            machine, state = from_permalink(word)
            if machine not in (model.declared.name, str(model.file)):
                raise StiffmapError(
                    f"the link is of the machine {machine}; this view shows {model.declared.name}"
                )
            model.put(**{k: getattr(state, k) for k in state.__dataclass_fields__})

        self._viewer.act(deed)

    def _reload(self) -> None:
        if self._viewer.act(lambda m: m.reload()):
            self._viewer.renew()

    def wait(self) -> None:
        """Until the program is interrupted."""
        try:
            while self._viewer is not None:
                time.sleep(POLL)  # short: a signal that comes just before a sleep is seen after it
        except KeyboardInterrupt:
            pass
        finally:
            self.close()

    def close(self) -> None:
        """End the view; it may be called twice."""
        if self._watch is not None:
            self._watch.stop()
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None  # type: ignore[assignment]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _repr_html_(self) -> str:
        """In a notebook: the view itself."""
        return f'<iframe src="{self.url}" width="100%" height="560" style="border:0" title="stiffmap view"></iframe>'

    def __repr__(self) -> str:
        return (
            f"View of {self._viewer.model.declared.name!r} at {self.url}" if self._viewer else "View, closed"
        )


def open_view(
    machine: Machine,
    position: object = None,
    *,
    port: int | None = None,
    browser: bool = True,
    file: str | PathLike[str] | None = None,
    experiment: Experiment | str | PathLike[str] | None = None,
    diagnosis: Diagnosis | str | PathLike[str] | None = None,
    path: Toolpath | ArrayLike | PathLike[str] | None = None,
    meshes: str | PathLike[str] | None = None,
    **state: object,
) -> View:
    """See `Machine.view`."""
    data = data_of(machine, experiment, diagnosis, path)
    view = View(model_of(machine, position, file, meshes, **state), port=port, data=data)
    if browser:
        webbrowser.open(view.url)
    return view


def data_of(
    machine: Machine,
    experiment: Experiment | str | PathLike[str] | None = None,
    diagnosis: Diagnosis | str | PathLike[str] | None = None,
    path: Toolpath | ArrayLike | PathLike[str] | None = None,
) -> Data | None:
    """What is drawn with the machine; None where there is nothing. Raises FileError for files that cannot be read.

    experiment: an `Experiment` or its folder. diagnosis: a `Diagnosis` or the folder of one. path: positions (n, 3) m,
    a `Toolpath`, or its file or outline.
    """
    if experiment is None and diagnosis is None and path is None:
        return None
    rows = line = found = None
    if experiment is not None:
        from stiffmap.experiment import Experiment, load_experiment

        rows = experiment if isinstance(experiment, Experiment) else load_experiment(experiment)
    if path is not None:
        from stiffmap.machining.toolpath import Toolpath, load_path, sampled

        if isinstance(path, str | PathLike):
            path = load_path(path)
        line = sampled(path).position if isinstance(path, Toolpath) else real_array(path, "path")
        if line.ndim != 2 or line.shape[1] != 3 or len(line) < 2:
            raise StiffmapError(
                f"path: expected positions (n, 3) m with n of 2 or more, got shape {line.shape}"
            )
    if diagnosis is not None:
        found = findings(diagnosis)
    return Data(rows, line, found, machine)


def model_of(
    machine: Machine,
    position: object = None,
    file: str | PathLike[str] | None = None,
    meshes: str | PathLike[str] | None = None,
    **state: object,
) -> ViewModel:
    """A model in a state given by keywords; StiffmapError for bad ones."""
    given = {k: _listed(v) for k, v in (state | {"position": position}).items() if v is not None}
    return ViewModel(
        machine, from_plain(as_plain(first_state(machine)) | given), file=file,
        meshes=None if meshes is None else given_path(meshes, "meshes", "a URDF file"),
    )  # fmt: skip


def _listed(value: object) -> Any:
    return value.tolist() if hasattr(value, "tolist") else list(value) if isinstance(value, tuple) else value


EVERY = 0.4  # s between two looks
Stamp = tuple[int, int] | None


def stamp(path: Path) -> Stamp:
    """What changes when a file is written; None where there is none."""
    try:
        s = path.stat()
    except OSError:
        return None
    return s.st_mtime_ns, s.st_size


class Watch:
    """Calls back when the file's stamp changes."""

    def __init__(self, path: Path, changed: Callable[[], None]) -> None:
        self._path, self._changed = path, changed
        self._end = threading.Event()
        self._seen = stamp(path)
        self._thread = threading.Thread(target=self._run, daemon=True, name="stiffmap view file")
        self._thread.start()

    def _run(self) -> None:
        while not self._end.wait(EVERY):
            now = stamp(self._path)
            if now is not None and now != self._seen:
                self._seen = now
                self._changed()

    def stop(self) -> None:
        """End the thread."""
        self._end.set()
