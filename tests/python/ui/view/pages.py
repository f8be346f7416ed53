"""Pages of a view in a browser: opening them, where a point is on them, the mouse, the picture."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from stiffmap.ui.view.open import View


def until(true: Callable[[], object], seconds: float = 60.0) -> bool:
    end = time.monotonic() + seconds
    while not true() and time.monotonic() < end:
        time.sleep(0.1)
    return bool(true())


def opened(browser: Any, view: View, width: int = 1100, height: int = 700) -> Any:
    """A page on which the panel has arrived."""
    page = browser.new_page()
    page.set_viewport_size({"width": width, "height": height})
    page.goto(view.url)
    page.get_by_role("tab", name="Tool and load").wait_for()
    return page


CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": (1.0, 0.0, 0.0, 0.0), "position": (0.6, -0.8, 0.9), "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0), "fov": 0.8, "near": 0.01, "far": 100.0, "image_height": 700, "image_width": 1100,
}  # fmt: skip
"""What a page says first."""


class Tab:
    """What a page receives, without a browser that draws it."""

    def __init__(self, view: View) -> None:
        import msgspec
        import viser
        from websockets.sync.client import connect
        from websockets.typing import Subprotocol

        names = [Subprotocol(f"viser-v{viser.__version__}")]
        self._socket = connect(
            f"ws://127.0.0.1:{view._server.get_port()}",
            subprotocols=names,
            max_size=None,
            max_queue=None,
            proxy=None,
        )
        self._socket.send(msgspec.msgpack.encode(CAMERA))

    def shows(self, text: str, seconds: float = 60.0) -> bool:
        """Whether a message with this text arrives: messages are compressed but for their arrays."""
        import zstandard

        end = time.monotonic() + seconds
        with contextlib.suppress(TimeoutError):
            while True:
                message = self._socket.recv(end - time.monotonic())
                assert isinstance(message, bytes)
                packed = message[16 : 16 + int.from_bytes(message[8:16], "little")]
                if text.encode() in zstandard.decompress(packed):
                    return True
        return False

    def close(self) -> None:
        self._socket.close()


def client_of(view: View) -> Any:
    """The server's side of the one page that is open."""
    assert until(view._server.get_clients)
    return next(iter(view._server.get_clients().values()))


def pull(page: Any, a: tuple[float, float], b: tuple[float, float]) -> None:
    """Press the mouse at a place of the page, move it to another and let go."""
    page.mouse.move(*a)
    page.mouse.down()
    for k in range(1, 9):
        page.mouse.move(a[0] + (b[0] - a[0]) * k / 8, a[1] + (b[1] - a[1]) * k / 8)
        page.wait_for_timeout(60)
    page.mouse.up()


def works(page: Any, act: Callable[[], None], done: Callable[[], object]) -> bool:
    """Whether something is done by an act with the mouse. A page that is still drawing has no handle to take and no place to click on
    (it turns its camera instead), so it is tried again."""
    for _ in range(4):
        page.wait_for_timeout(2000)
        act()
        if until(done, 15.0):
            return True
    return False


def pulled(view: View, page: Any, a: Any, b: Any, moved: Callable[[], object]) -> bool:
    """Whether something moves that is pulled from one place of the scene (m) to another."""
    return works(page, lambda: pull(page, on_screen(view, page, a), on_screen(view, page, b)), moved)


def pixels(page: Any) -> np.ndarray[Any, Any]:
    import io

    import matplotlib.image

    return np.rint(
        255 * matplotlib.image.imread(io.BytesIO(page.screenshot()), format="png")[..., :3]
    ).astype(int)


def on_screen(view: View, page: Any, point: Any) -> tuple[float, float]:
    """Where a point (m) is on the page, by the camera of the server's side."""
    camera = client_of(view).camera
    forward = np.asarray(camera.look_at) - camera.position
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, camera.up_direction)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    d = np.asarray(point) - camera.position
    depth = d @ forward
    box = page.locator("canvas").first.bounding_box()
    half = np.tan(camera.fov / 2)
    x = box["x"] + box["width"] / 2 + d @ right / depth / half * box["height"] / 2
    y = box["y"] + box["height"] / 2 - d @ up / depth / half * box["height"] / 2
    return float(x), float(y)
