"""What commands print with --json obeys the schemas of docs/schemas; a command without a schema is no command.
What takes long is tried by the examples of its help (test_help.py)."""

from __future__ import annotations

import json
import shlex
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import pytest
from tests.python.project.docs.json_calls import CALLS, COSTLY, MAPS
from tests.python.project.docs.json_schemas import SCHEMAS, obeys, schema
from tests.python.project.docs.test_help import make_workshop

from stiffmap.ui.cli import main
from stiffmap.ui.cli.commands import COMMANDS


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files of the calls."""
    return make_workshop(tmp_path_factory.mktemp("workshop"))


def test_every_command_has_calls_and_a_schema() -> None:
    assert {c.name for c in COMMANDS} == set(CALLS)
    assert {p.stem for p in SCHEMAS.glob("*.json")} == set(CALLS)


@pytest.mark.parametrize("name", sorted(set(CALLS) - COSTLY))
def test_quick_commands_obey_their_schema(
    name: str, workshop: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if name == "view":
        opening = pytest.importorskip("stiffmap.ui.view.open", reason="needs the extra [view]")
        monkeypatch.setattr(opening.View, "wait", opening.View.close)  # serves until it is interrupted
    monkeypatch.chdir(workshop)
    for call in CALLS[name]:
        assert main([*shlex.split(call), "--json"]) in (0, 1), capsys.readouterr().err
        obeys(name, capsys.readouterr().out)


def test_a_schema_refuses_a_missing_key_and_another_type() -> None:
    jsonschema = pytest.importorskip("jsonschema")
    validator = jsonschema.Draft202012Validator(schema("check"))
    assert not validator.is_valid({})
    assert not validator.is_valid([])


def places(form: Any, at: str = "") -> set[str]:
    """Places of a schema whose keys are the reader's."""
    out = {at} if "additionalProperties" in form else set()
    for key, inner in (*form.get("properties", {}).items(), ("*", form.get("additionalProperties"))):
        out |= places(inner, f"{at}.{key}") if inner else set()
    for inner in form.get("anyOf", ()):
        out |= places(inner, at)
    return out | (places(form["items"], f"{at}[]") if "items" in form else set())


@pytest.mark.parametrize("name", sorted(MAPS))
def test_maps_of_the_reader_s_names_have_no_keys_of_ours(name: str) -> None:
    found = places(schema(name))
    assert found
    for place in MAPS[name]:
        assert any(fnmatchcase(at, place.replace("[", "[[]")) for at in found), place


@pytest.mark.parametrize("starter", ["scara", "3-rrr", "gantry", "delta"])
def test_machines_of_other_names_obey(
    starter: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    monkeypatch.chdir(tmp_path)
    assert main(["new", "--from", starter, "mine.yaml"]) == 0
    text = Path("mine.yaml").read_text(encoding="utf-8")
    Path("mine.yaml").write_text(text.replace("left", "port").replace("arm", "limb"), encoding="utf-8")
    capsys.readouterr()
    for call in (
        "check mine.yaml",
        "show mine.yaml --no-picture",
        "stress mine.yaml",
        "solve mine.yaml --force 10,0,0",
    ):
        assert main([*call.split(), "--json"]) in (0, 1)
        out = json.loads(capsys.readouterr().out)
        jsonschema.Draft202012Validator(schema(call.split()[0])).validate(out)


def test_a_key_that_is_gone_or_of_another_type_is_refused() -> None:
    jsonschema = pytest.importorskip("jsonschema")
    right = {"folder": "a", "rows": 2, "repeats": 0, "columns": {"Uhr": "dx"}, "units": {"dx": "m"}}
    found = jsonschema.Draft202012Validator(schema("experiment"))
    found.validate(right)
    for wrong in (
        {**right, "rows": "2"},
        {**right, "columns": {"Uhr": 3}},
        {k: right[k] for k in ("folder", "rows")},
    ):
        assert not found.is_valid(wrong)
