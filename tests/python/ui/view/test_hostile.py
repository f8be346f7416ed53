"""A live view under messages that no page sends: no traceback, and it goes on."""

from __future__ import annotations

import asyncio
import math
import random
from typing import Any

import numpy as np
import pytest

import stiffmap as sm

JUNK = [
    None, -1, 1e308, math.nan, "x", "", [], {}, [1] * 50, True, b"\x00\xff", 2**63 - 1, [None] * 3,
    [0, 0, 0], [0, 0, 0, 0], [1e300] * 3, [math.nan] * 4,
]  # fmt: skip
"""Values of any field."""


def messages(controls: list[str], nodes: list[str], count: int) -> list[dict[str, Any]]:
    rng = random.Random(3)
    out = []
    for _ in range(count):
        kind = rng.choice(["GuiUpdateMessage", "TransformControlsUpdateMessage", "ScenePointerMessage"])
        out.append(
            {
                "type": kind, "uuid": rng.choice(controls), "updates": {"value": rng.choice(JUNK)}, "name": rng.choice(nodes),
                "wxyz": rng.choice(JUNK), "position": rng.choice(JUNK), "event_type": "click", "screen_pos": [[0, 0]],
                "ray_origin": rng.choice(JUNK), "ray_direction": rng.choice(JUNK), "modifier": None,
            }
        )  # fmt: skip
    return out


async def sent(port: int, given: list[dict[str, Any]]) -> None:
    """Each by a connection of its own: the server ends one that it does not understand."""
    import msgspec
    import viser
    from websockets.asyncio.client import connect

    for message in given:
        async with connect(f"ws://127.0.0.1:{port}", subprotocols=[f"viser-v{viser.__version__}"]) as socket:  # type: ignore[list-item]
            await socket.send(msgspec.msgpack.encode(message))


def test_messages_that_no_page_sends_leave_no_traceback(capfd: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("viser", reason="viser is not installed (pip install stiffmap[view])")
    from stiffmap.ui.view.open import View, model_of

    with View(model_of(sm.load_machine("orthoglide-revised"))) as view:
        server = view._server
        controls = list(server.gui._gui_input_handle_from_uuid)
        nodes = list(server.scene._handle_from_node_name)
        asyncio.run(sent(server.get_port(), messages(controls, nodes, 60)))
        view._viewer.drag(np.zeros(3), np.zeros(4))
        assert "norm" in view._viewer.error
        assert view._viewer.worker.idle(60)
        view._viewer.drag(np.array([0.05, 0, 0]), np.array([1.0, 0, 0, 0]))
        assert not view._viewer.error and view.state.position == (0.05, 0.0, 0.0)
    assert "Traceback" not in capfd.readouterr().err
