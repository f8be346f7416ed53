"""The state of a view: links that restore it, undo, and what is refused."""

from __future__ import annotations

import base64
import json
import zlib

import pytest

from stiffmap.common.errors import StiffmapError
from stiffmap.ui.view.state import (
    History,
    ViewState,
    as_plain,
    from_permalink,
    from_plain,
    permalink,
)

FULL = ViewState(
    (0.1, -0.2, 0.3), rotation=(0.0, 0.1, 0.0), force=(1.0, 2.0, 3.0), moment=(0.5, 0.0, 0.0), gravity=(0.0, 0.0, -9.81),
    plane="free", normal=(1.0, 1.0, 0.0), quantity="worst", tolerance=1e-4, magnification=200.0, frequency=12.0,
    start=(0.1, 0.2), changes=(("x.foot/beam.EIx", 4000.0),),
)  # fmt: skip


@pytest.mark.parametrize("state", [FULL, ViewState((0.0, 0.0, 0.0))])
def test_a_link_restores_machine_and_state(state: ViewState) -> None:
    word = permalink("my machine.yaml", state)
    assert word.replace("-", "").replace("_", "").isalnum()
    assert from_permalink(word) == ("my machine.yaml", state)
    assert from_plain(json.loads(json.dumps(as_plain(state)))) == state


def test_a_plain_state_is_short() -> None:
    assert as_plain(ViewState((0.0, 0.0, 0.0))) == {"position": (0.0, 0.0, 0.0)}


def bomb() -> str:
    packed = zlib.compress(b'{"machine":"a","position":[0,0,0],"plane":"' + b"x" * 3_000_000 + b'"}', 9)
    return base64.urlsafe_b64encode(packed).decode().rstrip("=")


@pytest.mark.parametrize("word", ["", "abc", "%%%", permalink("a", FULL)[:-7], "A" * 20_000, bomb()])
def test_a_damaged_link_is_one_error(word: str) -> None:
    with pytest.raises(StiffmapError, match="the link is damaged"):
        from_permalink(word)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ([], "expected a mapping"),
        ({}, "position: missing"),
        ({"position": 5}, "position: expected a list; found a number"),
        ({"position": [0, 0]}, r"position\[2\]: missing"),
        ({"position": [0, 0, "1"]}, r"position\[2\]: expected a number; found text \('1'\)"),
        ({"position": [0, 0, True]}, r"position\[2\]: expected a number"),
        ({"position": [0, 0, 0], "colour": 1}, "unknown key 'colour'"),
        ({"position": [0, 0, 0], "plane": "w"}, "plane: expected 'x', 'y', 'z' or 'free'; found text"),
        ({"position": [0, 0, 0], "plane": 3}, "plane: expected"),
        ({"position": [0, 0, 0], "quantity": "taste"}, "quantity: expected 'deflection'"),
        ({"position": [0, 0, 0], "tolerance": -1}, "tolerance: expected a number greater than 0"),
        ({"position": [0, 0, 0], "normal": [0, 0, 0]}, "normal: expected a direction"),
        (
            {"position": [0, 0, 0], "magnification": -2},
            "magnification: expected a number greater than or equal to 0",
        ),
        ({"position": [0, 0, 0], "frequency": -2}, "frequency: expected a number greater than or equal to 0"),
        ({"position": [0, 0, 0], "changes": [["a"]]}, r"changes\[0\]\[1\]: missing"),
        ({"position": [0, 0, 0], "changes": {"a": "b"}}, r"changes\[0\]\[1\]: expected a number; found text"),
    ],
)
def test_a_wrong_state_is_named(data: object, words: str) -> None:
    with pytest.raises(StiffmapError, match=words):
        from_plain(data)


def test_undo_skips_what_was_dragged_over() -> None:
    h = History(ViewState((0.0, 0.0, 0.0)))
    h.put(ViewState((0.1, 0.0, 0.0)))
    h.mark()
    for i in range(5):
        h.put(ViewState((0.1, 0.1 * i, 0.0)), keep=False)
    assert h.now.position == (0.1, 0.4, 0.0)
    assert h.undo().position == (0.1, 0.0, 0.0)
    assert h.undo().position == (0.0, 0.0, 0.0)
    assert h.undo().position == (0.0, 0.0, 0.0)


def test_reset_can_be_undone() -> None:
    h = History(ViewState((0.0, 0.0, 0.0)))
    h.put(FULL)
    assert h.reset() == ViewState((0.0, 0.0, 0.0))
    assert h.undo() == FULL


def test_a_change_is_put_and_taken_back() -> None:
    s = FULL.changed("a/b", 1.0).changed("x.foot/beam.EIx", None)
    assert dict(s.changes) == {"a/b": 1.0}
