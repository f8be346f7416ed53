"""What leaves a view: pictures, the page, the link, and the lines that make the same."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from stiffmap.ui.view.lines import command_line, python_lines
from stiffmap.ui.view.moment import Moment
from stiffmap.ui.view.page import page_of
from stiffmap.ui.view.picture import write_view_picture
from stiffmap.ui.view.state import permalink


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
        file = Path(folder) / f"view.{kind}"
        write_view_picture(moment, file)
        return file.read_bytes()
