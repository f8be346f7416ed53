"""Who may steer a view: requests before the server sees them, ports, tokens."""

from __future__ import annotations

import gzip
import logging
import socket
from types import SimpleNamespace

import pytest

from stiffmap.common.errors import StiffmapError
from stiffmap.ui.view.serving import COOKIE, FIRST_PORT, HEAD, Guard, free_port, in_one_line, named

HERE = {"Host": "127.0.0.1:8080"}


@pytest.mark.parametrize("host", ["127.0.0.1:8080", "localhost:8080", "[::1]:8080"])
def test_this_computer_is_let_in_without_a_token(host: str) -> None:
    guard = Guard("127.0.0.1")
    assert guard.token == ""
    assert guard.refusal("/", {"Host": host}) == ""
    assert guard.refusal("/", {"Host": host, "Origin": f"http://{host}"}) == ""


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Host": "evil.example:8080"},
        {"Host": "127.0.0.1.evil.example"},
        HERE | {"Origin": "http://evil.example"},
        HERE | {"Origin": "http://127.0.0.1:9999"},
        HERE | {"Origin": "null"},
        HERE | {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Dest": "image"},
        HERE | {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Dest": "document"},
        HERE | {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Dest": "iframe"},
        HERE | {"Sec-Fetch-Site": "cross-site"},
        HERE | {"Sec-Fetch-Site": "same-site", "Sec-Fetch-Dest": "image"},
        HERE | {"Sec-Fetch-Site": "same-site", "Sec-Fetch-Dest": "script"},
    ],
)
def test_other_names_and_other_pages_are_refused(headers: dict[str, str]) -> None:
    assert Guard("127.0.0.1").refusal("/", headers)


@pytest.mark.parametrize(
    "headers",
    [
        {"Sec-Fetch-Site": "none", "Sec-Fetch-Dest": "document"},
        {"Sec-Fetch-Site": "same-origin", "Sec-Fetch-Dest": "websocket"},
        {"Sec-Fetch-Site": "same-origin", "Sec-Fetch-Dest": "image"},
        {"Sec-Fetch-Site": "same-site", "Sec-Fetch-Dest": "iframe"},  # a notebook shows a view
    ],
)
def test_its_own_pages_are_let_in(headers: dict[str, str]) -> None:
    assert Guard("127.0.0.1").refusal("/", HERE | headers) == ""


@pytest.mark.parametrize("to", ["image", "script", "style", "empty", "document", "iframe"])
def test_a_link_sets_the_state_as_a_page_only(to: str) -> None:
    links: list[str] = []
    answer = Guard("127.0.0.1", links.append).wrapped(lambda connection, request: None)
    headers = HERE | {"Sec-Fetch-Site": "same-origin", "Sec-Fetch-Dest": to}
    answer(None, SimpleNamespace(path="/?state=abc", headers=headers))
    assert links == (["abc"] if to in ("document", "iframe") else [])


def test_beyond_this_computer_a_token_is_asked_for() -> None:
    guard = Guard("0.0.0.0")
    far = {"Host": "192.168.0.7:8080"}
    assert len(guard.token) >= 32 and guard.token != Guard("0.0.0.0").token
    assert "token" in guard.refusal("/", far)
    assert "token" in guard.refusal("/?token=wrong", far)
    assert "token" in guard.refusal("/?token=", far)
    assert guard.refusal(f"/?token={guard.token}", far) == ""
    assert guard.refusal("/", far | {"Cookie": f"a=b; {COOKIE}={guard.token}"}) == ""
    assert guard.refusal("/", far | {"Cookie": f"{COOKIE}=ü"})
    assert guard.refusal(f"/?token={guard.token}", far | {"Origin": "http://evil.example"})


@pytest.mark.parametrize("packed", [False, True])
def test_the_page_gets_names_and_style(packed: bool) -> None:
    page = b"<html><head><title>t</title></head><body></body></html>"
    out = named(gzip.compress(page) if packed else page, packed)
    text = gzip.decompress(out) if packed else out
    added = HEAD.read_bytes()
    assert text.replace(added, b"") == page and added in text
    assert named(b"no page", False) == b"no page"


def test_a_taken_port_is_named_and_another_is_found() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(StiffmapError, match=f"cannot listen on 127.0.0.1, port {port}"):
            free_port("127.0.0.1", port)
    assert free_port("127.0.0.1", None) >= FIRST_PORT
    with pytest.raises(StiffmapError, match="--port: expected 0 to 65535, got 70000"):
        free_port("127.0.0.1", 70000)


@pytest.mark.parametrize("kind", [KeyError, TypeError, AssertionError, UnicodeDecodeError])
def test_a_hostile_message_is_one_line(kind: type[Exception], caplog: pytest.LogCaptureFixture) -> None:
    log = logging.getLogger("asyncio.of.a.test")
    log.addFilter(in_one_line)
    try:
        raise kind(*(("utf-8", b"", 0, 1, "bad") if kind is UnicodeDecodeError else ("type",)))
    except kind:
        log.exception("Task exception was never retrieved\nfuture: <Task finished>")
    (line,) = caplog.text.splitlines()
    assert line.endswith(f"a message was not understood and is ignored ({kind.__name__})")
