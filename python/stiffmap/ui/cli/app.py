"""The root of the command line: finds the command, runs it, turns errors into one line."""

from __future__ import annotations

import codecs
import errno
import io
import os
import re
import sys
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from inspect import getdoc
from typing import Any

import typer
from rich.markup import escape

from stiffmap.common.errors import FileError, FileErrors, StiffmapError
from stiffmap.common.number_text import number_in
from stiffmap.common.outputs.keeping import one_command
from stiffmap.ui.cli.commands import COMMANDS, import_all, load
from stiffmap.ui.cli.options import option

BAD_INPUT = 2
DEFECT = 70
INTERRUPTED = 130
COMPLETION = "_STIFFMAP_COMPLETE"  # set by a shell that asks what a word can become
TRACEBACK = "STIFFMAP_TRACEBACK"

HELP = """How far is a loaded machine pushed off its commanded position?

Lengths in mm, forces in N, angles in deg. Every command has [bold]--help[/bold] with
examples and [bold]--json[/bold]. Exit codes: 0 done, 1 done with findings, 2 bad input or a system that refuses (no space,
no memory), 70 a defect of stiffmap, 130 interrupted.
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``stiffmap`` (default: with the process's arguments); returns the exit code."""
    given = joined(_words() if arguments is None else arguments)
    try:
        with plain_streams(), one_command():
            build_command(given)(args=given, prog_name="stiffmap", obj=tuple(given))
    except StiffmapError as error:
        for problem in error.problems if isinstance(error, FileErrors) else (error,):
            print(f"stiffmap: {one_line(problem)}", file=sys.stderr)
        return BAD_INPUT
    except (KeyboardInterrupt, typer.Abort):
        return INTERRUPTED
    except MemoryError as error:
        print(f"stiffmap: out of memory{f': {one_line(error)}' if str(error) else ''}", file=sys.stderr)
        return BAD_INPUT
    except OSError as error:
        print(f"stiffmap: {_refusal(error)}", file=sys.stderr)
        return BAD_INPUT
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else int(stop.code is not None)
    except Exception as error:
        if os.environ.get(TRACEBACK):
            raise
        print(f"stiffmap: {_defect(error)}", file=sys.stderr)
        return DEFECT
    finally:
        if arguments is not None:  # the program goes on, and may use what is in these modules
            with suppress(ModuleNotFoundError):
                import_all()
    return 0


def _words() -> list[str]:
    """The process's arguments, or those that a shell (bash; zsh, fish) has of a line that is being typed."""
    if COMPLETION not in os.environ:
        return sys.argv[1:]
    return (os.environ.get("COMP_WORDS") or os.environ.get("_TYPER_COMPLETE_ARGS", "")).split()[1:]


def _refusal(error: OSError) -> str:
    """What the system refused, of which file."""
    what = error.strerror or one_line(error)
    return what if error.filename is None else f"{os.fsdecode(error.filename)}: {what}"


def _defect(error: Exception) -> str:
    at = traceback.extract_tb(error.__traceback__)[-1]
    place = "/".join(at.filename.replace("\\", "/").split("/")[-2:])
    what = f"{type(error).__name__} in {place}, line {at.lineno}: {one_line(error)}"
    return f"a defect of stiffmap, not of your files: {what}. Please report it with the output under {TRACEBACK}=1."


def one_line(error: Exception) -> str:
    """The message without line breaks."""
    return " ".join(str(error).split())


def build_app(arguments: Sequence[str]) -> typer.Typer:
    """App in which only the command that ``arguments`` name is imported; the others are their summaries."""
    wanted = next((a for a in _without_effects(arguments) if not a.startswith("-")), None)
    app = typer.Typer(
        help=flowed(HELP), no_args_is_help=True, rich_markup_mode="rich", pretty_exceptions_enable=False
    )
    app.callback()(_root)
    for command in COMMANDS:
        if command.name == wanted:
            function = load(command)
            app.command(command.name, help=flowed(getdoc(function) or ""))(function)
        else:
            app.command(command.name, help=command.summary)(lambda: None)
    return app


def build_command(arguments: Sequence[str]) -> Any:
    """The app as a command of click, in whose help only our own styles are markup: units such as [mm] are text."""
    command = typer.main.get_command(build_app(arguments))
    for each in (command, *getattr(command, "commands", {}).values()):
        for part in (each, *each.params):
            if part.help:
                part.help = styled(part.help)
    return command


def styled(text: str) -> str:
    """The text with every bracket escaped for rich but those of our own styles."""
    return re.sub(r"\\(\[/?(?:cyan|bold)\])", r"\1", escape(text))


def flowed(text: str) -> str:
    """Paragraphs and examples without the source's line breaks: the terminal breaks them at its own width."""
    paragraphs = text.replace("\n  [cyan]", "\n\n[cyan]").split("\n\n")
    return "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)


def _version(wanted: bool) -> None:
    if wanted:
        from stiffmap.common.version import __version__

        known = __version__ != "0"
        print(f"stiffmap {__version__}" if known else "stiffmap (not installed: version unknown)")
        raise typer.Exit


def _without_effects(arguments: Sequence[str]) -> list[str]:
    """The arguments less the files of ``--effects-from``."""
    return [a for before, a in zip(["", *arguments], arguments, strict=False) if before != "--effects-from"]


def _root(
    effects_from: list[str] = option(
        "Python file that defines a kind of effect; may be repeated.", [], metavar="FILE"
    ),
    version: bool = option("Print the version.", False, "--version", callback=_version, is_eager=True),
) -> None:
    if effects_from:
        from stiffmap.model.effects import load_effects

        for file in effects_from:
            load_effects(file)


_root.__doc__ = HELP


VECTORS = ("--at", "--force", "--moment", "--direction", "--by", "--turn", "--rotation", "--gravity", "--view",
           "--load")  # fmt: skip
"""Options whose value is a vector; all but ``--view`` have three numbers."""


def joined(arguments: Sequence[str]) -> list[str]:
    """The arguments with numbers that follow such an option drawn together by commas.

    A negative number would otherwise be read as an option, and a second one as an argument.
    """
    out: list[str] = []
    rest = list(arguments)
    while rest:
        word = rest.pop(0)
        option, equals, first = word.partition("=")
        if option not in VECTORS:
            out.append(word)
            continue
        parts = [first] if equals else []
        while rest and len(parts) < 3 and _numbers(rest[0]):
            parts.append(rest.pop(0).strip(" ,"))
        out.append(f"{option}={','.join(parts)}" if parts else word)
    return out


def _numbers(word: str) -> bool:
    """Whether a word is a number, or several with commas between."""
    try:
        return bool([number_in(part) for part in word.strip(" ,").split(",")])
    except ValueError:
        return False


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


def _warned(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
    if category is UserWarning:
        print(f"stiffmap: {' '.join(str(message).split())[:LONGEST]}", file=sys.stderr)


def _quiet() -> None:
    """Nothing more is written when the interpreter ends."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
