"""The server of a view: on this computer only unless asked, then with a token; other pages' scripts are refused."""

from __future__ import annotations

import contextlib
import gzip
import hmac
import io
import logging
import secrets
import socket
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit

from stiffmap.common.errors import StiffmapError, needed

if TYPE_CHECKING:
    from viser import ViserServer
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response

    Answer = Callable[[ServerConnection, Request], Response | None]

HERE = "127.0.0.1"
LOCAL = (HERE, "localhost", "::1")
FIRST_PORT, TRIED_PORTS = 8080, 100
COOKIE = "stiffmap_view"


def need_viser() -> ModuleType:
    """The library of the extra ``[view]``, imported only when something is to be looked at; MissingPartError that says how
    to install it."""
    with needed("a view", "view"):
        import viser
    return viser


class Guard:
    """Decides about every request before the server sees it."""

    def __init__(self, host: str, on_link: Callable[[str], None] | None = None) -> None:
        self.host = host
        self.token = "" if host in LOCAL else secrets.token_urlsafe(24)
        self.on_link = on_link

    def refusal(self, path: str, headers: Mapping[str, str]) -> str:
        """Why a request is refused; empty if it is not."""
        name = urlsplit(f"//{headers.get('Host', '')}").hostname or ""
        if self.host in LOCAL and name not in LOCAL:
            return "this view is for programs on its own computer"
        origin, site = headers.get("Origin"), headers.get("Sec-Fetch-Site")
        foreign = site == "cross-site" or (site == "same-site" and not _is_page(headers))
        if foreign or (origin and urlsplit(origin).netloc != headers.get("Host", "")):
            return "another page may not steer this view; open its address yourself"
        if self.token and not (self._same(self.asked(path, "token")) or self._same(_cookie(headers))):
            return "open the address with the token that stiffmap view printed"
        return ""

    def _same(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(), self.token.encode())

    def asked(self, path: str, name: str) -> str:
        """The value of a query in a path; empty where there is none."""
        return parse_qs(urlsplit(path).query).get(name, [""])[0]

    def wrapped(self, process: Answer) -> Answer:
        """The server's own answers behind the guard."""
        from websockets.datastructures import Headers
        from websockets.http11 import Response

        def answer(connection: ServerConnection, request: Request) -> Response | None:
            why = self.refusal(request.path, request.headers)
            if why:
                body = f"403: {why}\n".encode()
                head = {"Content-Type": "text/plain; charset=utf-8", "Content-Length": str(len(body))}
                return Response(HTTPStatus.FORBIDDEN, "Forbidden", Headers(**head), body)
            link = self.asked(request.path, "state")
            page = _is_page(request.headers) and request.headers.get("Upgrade") != "websocket"
            if link and self.on_link is not None and page:
                self.on_link(link)
            out = process(connection, request)
            if out is not None and out.headers.get("Content-Type", "").startswith("text/html"):
                out.body = named(bytes(out.body), out.headers.get("Content-Encoding") == "gzip")
                del out.headers["Content-Length"]
                out.headers["Content-Length"] = str(len(out.body))
            if out is not None and self.token:
                out.headers["Set-Cookie"] = f"{COOKIE}={self.token}; HttpOnly; SameSite=Strict; Path=/"
            return out

        return answer


def _is_page(headers: Mapping[str, str]) -> bool:
    """Whether a browser asks for a page to show, not for a picture or a script; programs don't say."""
    return headers.get("Sec-Fetch-Dest", "document") in ("document", "iframe")


def _cookie(headers: Mapping[str, str]) -> str:
    try:
        kept = SimpleCookie(headers.get("Cookie", ""))
    except CookieError:
        return ""
    return kept[COOKIE].value if COOKIE in kept else ""


def start_server(host: str, port: int | None, guard: Guard, label: str) -> ViserServer:
    """A viser server behind a guard; StiffmapError where the port or the address cannot be used."""
    viser = need_viser()
    chosen = free_port(host, port)
    with _guarded(guard), silent():
        server: ViserServer = viser.ViserServer(host=host, port=chosen, label=label, verbose=False)
    logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
    logging.getLogger("asyncio").addFilter(in_one_line)  # the same function is added once
    return server


def in_one_line(record: logging.LogRecord) -> bool:
    """A message that the server does not understand, in place of its traceback."""
    if record.exc_info and record.exc_info[0] is not None:
        what = record.exc_info[0].__name__
        record.msg, record.args = f"stiffmap view: a message was not understood and is ignored ({what})", ()
        record.exc_info = record.exc_text = None
    return True


@contextlib.contextmanager
def silent() -> Iterator[None]:
    """viser prints its own addresses and farewell; the command prints the one that counts."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield


@contextlib.contextmanager
def _guarded(guard: Guard) -> Iterator[None]:
    """While a server starts, what it hands to websockets as its answers is put behind the guard.

    viser has no hook for requests of its own, so the function that it calls is replaced for that moment.
    """
    import websockets.asyncio.server as module

    plain = module.serve

    def serve(*args: Any, **given: Any) -> Any:
        given["process_request"] = guard.wrapped(given["process_request"])
        return plain(*args, **given)

    module.serve = serve  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        module.serve = plain  # type: ignore[misc]


def free_port(host: str, port: int | None) -> int:
    """The port asked for, or the first free one from 8080 on."""
    for p in range(FIRST_PORT, FIRST_PORT + TRIED_PORTS) if port is None else (port,):
        if not 0 <= p <= 65535:
            raise StiffmapError(f"--port: expected 0 to 65535, got {p}")
        try:
            with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as s:
                s.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                s.bind((host, p))
                return int(s.getsockname()[1])
        except OSError as problem:
            if port is not None or isinstance(problem, socket.gaierror):
                raise StiffmapError(f"cannot listen on {host}, port {p}: {problem.strerror}") from None
    raise StiffmapError(f"no port from {FIRST_PORT} to {FIRST_PORT + TRIED_PORTS - 1} is free; give --port")


HEAD = Path(__file__).parent / "pages/head.html"
"""Script and style for the head of viser's page. Names for screen readers: its client labels the first field of a row at best, and no
button with a picture. A number that comes without a key (pasted, dictated) is judged by where the last key or mouse button left the
cursor, and is dropped where the field has become shorter since; so the field looks for its cursor before each text. On narrow screens
the panel stands below the scene, over which the client lays it."""


@lru_cache(maxsize=4)
def named(body: bytes, packed: bool) -> bytes:
    """The page with script and style in its head; `packed`: as it is sent, by gzip."""
    text = gzip.decompress(body) if packed else body
    head, end, tail = text.partition(b"</head>")
    out = head + HEAD.read_bytes() + end + tail if end else text
    return gzip.compress(out, mtime=0) if packed else out
