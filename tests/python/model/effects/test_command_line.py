"""Effects as a user meets them on the command line: the list, a definition, and what is refused."""

from __future__ import annotations

import json

import pytest

from stiffmap.model.effects import get, kinds
from stiffmap.ui.cli import main

GAP = "dead_zone actuator y half_width=12um"


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    code = main(arguments)
    out, err = capsys.readouterr()
    return code, out, err


def test_all_kinds_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "effects", "--json")
    listed = {e["kind"]: e for e in json.loads(out)}
    assert code == 0 and tuple(listed) == kinds()
    for kind, plain in listed.items():
        assert [p["name"] for p in plain["parameters"]] == [p.name for p in get(kind).parameters]
    code, out, _ = run(capsys, "effects")
    assert code == 0 and all(kind in out for kind in kinds())


def test_one_kind_and_where_it_can_be(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "effects", "joint_friction", "--on", "orthoglide-revised")
    assert code == 0
    for words in ("pin_proximal (x, y, z)", "loading_stuck", "torque [N·m] 0 … 100000"):
        assert words in " ".join(out.split())
    code, out, _ = run(capsys, "effects", "joint_friction", "--on", "tripteron", "--json")
    places = json.loads(out)[0]["places"]
    assert code == 0 and places and all(p["legs"] for p in places)


def test_shown_with_the_machine(capsys: pytest.CaptureFixture[str]) -> None:
    effects = [GAP, "joint_friction pin_distal torque=0.5N·m", "dead_zone bar.k44 z half_width=1mrad"]
    words = [w for e in effects for w in ("--effect", e)]
    code, out, _ = run(capsys, "show", "orthoglide-revised", "--no-picture", *words)
    assert code == 0
    assert "effect: dead_zone actuator y half_width=1.2e-05 m" in out
    assert "effect: joint_friction pin_distal x,y,z torque=0.5 N·m" in out
    assert "effect: dead_zone bar.k44 z half_width=0.001 rad" in out


REFUSED = {
    "no element 'spindle' that it can act on; there are: actuator": ["dead_zone spindle half_width=12um"],
    "no leg 'w' has it; legs that do: x, y, z": ["dead_zone actuator w half_width=12um"],
    "the unit is missing": ["dead_zone actuator y half_width=12"],
    "expected a unit such as m, got 'N'": ["dead_zone actuator y half_width=12N"],
    "expected a unit such as rad, got 'um'": ["dead_zone bar.k44 half_width=12um"],
    "expected a unit such as m, got 'mrad'": ["dead_zone actuator half_width=1mrad"],
    "expected 0 to 0.01 m, got 0.012": ["dead_zone actuator y half_width=12mm"],
    "hardening and dead_zone exclude each other on actuator, leg y": [
        GAP,
        "hardening actuator y cubic=1e14N/m^3",
    ],
    "joint_friction and joint_friction exclude each other": ["joint_friction pin_distal torque=1N·m"] * 2,
    "unknown parameter 'factor_9'": ["tabulated foot.k22 step=1um factor_9=0.5"],
    "tabulated: step is missing": ["tabulated foot.k22 factor_1=0.5"],
    "straightness: period is missing": ["straightness actuator x amplitude=1um"],
    "across=x is not across the guide": ["straightness actuator x amplitude=1um period=1m across=x"],
}


@pytest.mark.parametrize("message", REFUSED)
def test_refused(message: str, capsys: pytest.CaptureFixture[str]) -> None:
    words = [w for e in REFUSED[message] for w in ("--effect", e)]
    code, out, err = run(capsys, "solve", "orthoglide-revised", *words)
    assert code == 2 and out == ""
    assert message in err and err.count("\n") == 1
