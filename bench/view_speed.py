"""From a drag to the message with the new colours: `python bench/view_speed.py [--drags 60] [--force] [machine ...]`.

A view is served on 127.0.0.1, a WebSocket client receives what a browser would. The tool is moved across its plane, so that
every drag needs a new map (--force: the force is turned instead); counted is the time from the event to the arrival of the
message with the plane's new image, and the processor time of the whole process, client included. Poses: along an edge of
the map that came first; the full 101 x 101 follow when the hand rests (fine: event to their arrival).
"""

from __future__ import annotations

import argparse
import asyncio
import threading
import time
from typing import Any

import numpy as np
import viser
import websockets
import zstandard

import stiffmap as sm
from stiffmap.ui.view.open import View, model_of

QUIET = 1.0
"""s without a message."""


class Listener:
    """Arrival times of messages about the plane's image."""

    def __init__(self, url: str) -> None:
        self.url, self.arrived, self.ready = url, threading.Event(), threading.Event()
        self.at = self.last = 0.0
        self._loop = asyncio.new_event_loop()
        threading.Thread(target=lambda: self._loop.run_until_complete(self._listen()), daemon=True).start()
        self.ready.wait(20)
        while time.perf_counter() - self.last < QUIET:  # what a browser is sent when it connects
            time.sleep(0.1)

    async def _listen(self) -> None:
        protocol: Any = f"viser-v{viser.__version__}"
        async with websockets.connect(self.url, subprotocols=[protocol], max_size=None) as socket:
            async for message in socket:
                now = self.last = time.perf_counter()
                self.ready.set()
                words = unpacked(message)
                if (
                    b"/map" in words or b'id="scale"' in words
                ):  # equal pixels under another scale are not sent again
                    self.at = now
                    self.arrived.set()


def unpacked(message: bytes) -> bytes:
    """The part of a message of viser that names nodes: two sizes, then msgpack behind zstd."""
    size = int.from_bytes(message[8:16], "little")
    return zstandard.ZstdDecompressor().decompress(message[16 : 16 + size])


def measure(name: str, drags: int, force: bool) -> tuple[Any, ...]:
    machine = sm.load_machine(name)
    low, high = machine.workspace
    with View(model_of(machine, quantity="deflection")) as view:
        viewer = view._viewer
        listener = Listener(view.url.replace("http", "ws"))
        viewer.worker.idle()
        state = view.state
        axis = "xyz".index(state.plane)
        home = np.array(state.position)
        reach = min(high[axis] - home[axis], home[axis] - low[axis])
        still = "xyz"[axis] not in machine.description.task
        first, processor, fine, counts = [], [], [], []
        for i in range(drags):
            while time.perf_counter() - listener.last < 0.1:  # the last drag's messages are all there
                time.sleep(0.01)
            swing = np.sin(0.7 * (i + 1))
            listener.arrived.clear()
            viewer.dragging = True
            used, begun = time.process_time(), time.perf_counter()
            if force or still:
                a = 0.3 * (i + 1)
                viewer.act(lambda m, a=a: m.put(force=(300 * np.cos(a), 300 * np.sin(a), 0.0), keep=False))
            else:
                p = home.copy()
                p[axis] += 0.5 * reach * swing
                viewer.drag(p, np.array(viewer.scene.gizmo.wxyz))
            if not listener.arrived.wait(QUIET):
                if not viewer.worker.idle(20) or viewer.error:
                    raise SystemExit(f"{name}: no message after drag {i + 1}: {viewer.error}")
                continue  # the same picture again, as on a machine that is alike everywhere: nothing is sent
            first.append(listener.at - begun)
            processor.append(time.process_time() - used)
            counts.append(viewer._plane.count)
            viewer.worker.idle()
            time.sleep(0.02)
            fine.append(listener.at - begun)
    keep = slice(drags // 4, None)  # the first ones also measure how long a pose takes
    return tuple(np.array(x[keep]) for x in (first, processor, fine, counts))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("machines", nargs="*")
    parser.add_argument("--drags", type=int, default=60)
    parser.add_argument("--force", action="store_true")
    given = parser.parse_args()
    print(
        "| machine | least, ms | median, ms | 95 %, ms | processor (median), ms | poses | 101 x 101, least, ms |"
    )
    print("|---|---|---|---|---|---|---|")
    for name in given.machines or sm.machine_names():
        first, processor, fine, counts = measure(name, given.drags, given.force)
        a, b, c = 1e3 * np.min(first), 1e3 * np.median(first), 1e3 * np.quantile(first, 0.95)
        print(
            f"| {name} | {a:.1f} | {b:.1f} | {c:.1f} | {1e3 * np.median(processor):.1f} | {int(np.median(counts))}² "
            f"| {1e3 * fine.min():.0f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
