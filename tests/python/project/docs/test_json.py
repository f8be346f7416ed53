"""What commands print with --json obeys the schemas of docs/schemas; a command without a schema is no command."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Any

import pytest
from tests.python.project.docs.json_calls import CALLS, COSTLY
from tests.python.project.docs.test_help import make_workshop

from stiffmap.ui.cli import main
from stiffmap.ui.cli.commands import COMMANDS

SCHEMAS = Path(__file__).parents[4] / "docs/schemas"


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files of the calls."""
    return make_workshop(tmp_path_factory.mktemp("workshop"))


def schema(name: str) -> Any:
    return json.loads((SCHEMAS / f"{name}.json").read_text(encoding="utf-8"))


def test_every_command_has_calls_and_a_schema() -> None:
    assert {c.name for c in COMMANDS} == set(CALLS)
    assert {p.stem for p in SCHEMAS.glob("*.json")} == set(CALLS)


def obeys(
    name: str, workshop: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    monkeypatch.chdir(workshop)
    for call in CALLS[name]:
        assert main([*shlex.split(call), "--json"]) in (0, 1), capsys.readouterr().err
        jsonschema.Draft202012Validator(schema(name)).validate(json.loads(capsys.readouterr().out))


@pytest.mark.parametrize("name", sorted(set(CALLS) - COSTLY))
def test_quick_commands_obey_their_schema(
    name: str, workshop: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if name == "view":
        pytest.importorskip("viser", reason="needs the extra [view]")
    obeys(name, workshop, monkeypatch, capsys)


@pytest.mark.parametrize("name", sorted(COSTLY - {"bench"}))
def test_costly_commands_obey_their_schema(
    name: str, workshop: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if name == "link":
        pytest.importorskip("gmsh", reason="needs the extra [fea]", exc_type=(ImportError, OSError))
    obeys(name, workshop, monkeypatch, capsys)


def test_a_schema_refuses_a_missing_key_and_another_type() -> None:
    jsonschema = pytest.importorskip("jsonschema")
    validator = jsonschema.Draft202012Validator(schema("check"))
    assert not validator.is_valid({})
    assert not validator.is_valid([])
