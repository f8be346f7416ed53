"""Standard output and error: terminals without our signs, full disks, readers that have gone, warnings."""

from __future__ import annotations

import codecs
import errno
import io
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from stiffmap.common.errors import FileError

ASCII = {
    "µ": "u", "μ": "u", "°": " deg", "±": "+-", "·": "*", "×": "x", "²": "^2", "³": "^3", "⁻": "^-", "≤": "<=", "≥": ">=",
    "→": "->", "–": "-", "—": "-", "−": "-", "…": "...", "’": "'", "‘": "'", "“": '"', "”": '"', "√": "sqrt", "θ": "theta",
    "φ": "phi", "σ": "sigma", "χ": "chi", "ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss",
}  # fmt: skip
"""Signs of our own texts for terminals that have ASCII only."""


def _in_ascii(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object[error.start : error.end]
    return "".join(
        ASCII.get(c, f"\\u{ord(c):04x}" if ord(c) < 0x10000 else f"\\U{ord(c):08x}") for c in text
    ), error.end


STREAM = (errno.ENOSPC, errno.EFBIG, errno.EIO, errno.EBADF)
"""What a write to a stream may be refused for; files have their own errors."""
LONGEST = 300  # characters of a warning


codecs.register_error("stiffmap", _in_ascii)


@contextmanager
def plain_streams() -> Iterator[None]:
    """Whatever is printed inside can be printed; FileError where standard output cannot be written.

    A reader that has gone (``| head``) ends the command quietly. Warnings to the user are one line each; those that
    libraries have for programmers are not shown.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="stiffmap")
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _warned
            try:
                yield
            finally:
                sys.stdout.flush()
    except BrokenPipeError:
        _quiet()
        raise SystemExit(0) from None
    except OSError as error:
        if error.filename is not None or error.errno not in STREAM:
            raise
        _quiet()
        raise FileError(f"cannot be written: {error.strerror or error}", file="standard output") from error


def _warned(message: Warning | str, category: type[Warning], *_: object) -> None:
    if category is UserWarning:
        print(f"stiffmap: {' '.join(str(message).split())[:LONGEST]}", file=sys.stderr)


def _quiet() -> None:
    """Nothing more is written when the interpreter ends."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
