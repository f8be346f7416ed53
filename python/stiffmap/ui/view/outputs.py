"""What leaves a view: pictures, the page, the link, and the lines that make the same."""

from __future__ import annotations

import shlex
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from stiffmap.ui.plot import save
from stiffmap.ui.view.moment import Moment
from stiffmap.ui.view.page import page_of
from stiffmap.ui.view.picture import view_figure
from stiffmap.ui.view.state import State, as_plain, permalink


class Outputs:
    """Buttons that hand files to the browser, and texts to copy."""

    def __init__(self, viewer: Any, gui: Any) -> None:
        self._viewer = viewer
        gui.add_button("Picture (PNG)").on_click(lambda e: self._hand(e, "png"))
        gui.add_button("Picture (SVG)").on_click(lambda e: self._hand(e, "svg"))
        gui.add_button("Scene as one page (HTML)").on_click(lambda e: self._hand(e, "html"))
        self._link = gui.add_text("Link", "", hint="add it to this view's address")
        self._command = gui.add_text("Command", "", multiline=True)
        self._python = gui.add_text("Python", "", multiline=True)

    def show(self, moment: Moment) -> None:
        """The texts of a state."""
        name = self.source
        for handle, text in (
            (self._link, f"/?state={permalink(name, moment.state)}"),
            (self._command, command_line(name, moment)),
            (self._python, python_lines(name, moment)),
        ):
            if handle.value != text:
                handle.value = text

    @property
    def source(self) -> str:
        """Shipped name, or the machine's file."""
        file = self._viewer.model.file
        return self._viewer.model.declared.name if file is None else str(file)

    def _hand(self, event: Any, kind: str) -> None:
        if event.client is None:
            return
        moment = self._viewer.now()
        content = (
            page_of(moment, self._viewer.data_again()).encode() if kind == "html" else _picture(moment, kind)
        )
        event.client.send_file_download(f"{moment.machine.name}.{kind}", content, save_immediately=True)


def _picture(moment: Moment, kind: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        return save(view_figure(moment), Path(folder) / f"view.{kind}").read_bytes()


def command_line(machine: str, moment: Moment) -> str:
    """For a shell; files and units as there: mm, deg, µm as mm."""
    s = moment.state
    words = [
        "stiffmap",
        "view",
        machine,
        f"--at={_numbers(1e3 * np.array(s.position))}",
        f"--force={_numbers(s.force)}",
    ]
    default = State(s.position)
    if s.rotation is not None:
        words.append(f"--rotation={_numbers(np.rad2deg(s.rotation))}")
    if any(s.moment):
        words.append(f"--moment={_numbers(s.moment)}")
    if s.gravity is not None:
        words.append(f"--gravity={_numbers(s.gravity)}")
    words.append(f"--plane={_numbers(s.normal) if s.plane == 'free' else s.plane}")
    if s.quantity != default.quantity:
        words.append(f"--quantity={s.quantity}")
    if s.tolerance != default.tolerance:
        words.append(f"--tolerance={1e3 * s.tolerance:.9g}")
    if s.frequency:
        words.append(f"--frequency={s.frequency:.9g}")
    if s.magnification is not None:
        words.append(f"--magnify={s.magnification:.9g}")
    words += [f"--set={a}={v!r}" for a, v in s.changes]
    words += [f"--start={_numbers(s.start)}"] if s.start is not None else []
    return shlex.join(words)


def python_lines(machine: str, moment: Moment) -> str:
    """A program that opens the view and, in the machine as its file says it, solves the pose."""
    s = moment.state
    given = ", ".join(f"{k}={v!r}" for k, v in as_plain(s).items() if k != "position")
    p = tuple(float(v) for v in s.position)
    lines = ["import stiffmap as sm", "", f"machine = sm.load_machine({machine!r})"]
    lines.append(f"machine.view({p!r}{', ' if given else ''}{given})")
    if not s.changes and s.rotation is None and s.start is None:
        gravity = "" if s.gravity is None else f", gravity={list(s.gravity)!r}"
        lines.append(
            f"print(machine.solve({list(p)!r}, {[float(v) for v in s.wrench]!r}{gravity}).displacement)"
        )
    return "\n".join(lines)


def _numbers(values: object) -> str:
    return ",".join(f"{v:.12g}" for v in np.asarray(values, dtype=float))
