"""The two stop-watch stories: a machine of one's own to its map, a spreadsheet of one's own to a diagnosis.

Only commands of the documentation are used; the machine file is written as docs/machine_files.md says.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import stiffmap as sm
from stiffmap.ui.cli import main

# From a sketch: motors 200 mm apart, arms 250 mm, forearms 300 mm, tool where the forearms meet.

SKETCH = """name: my-five-bar
title: Five-bar from a sketch
units: {length: mm, force: N, angle: deg, mass: kg}
home: {translation: [0, 400, 0]}
task: [x, y]
workspace: {x: [-80, 80], y: [340, 440], z: [-1, 1]}
materials:
  steel: {E: 2.1e5, nu: 0.3}
legs:
  left:
    frame: {translation: [-100, 0, 0]}
    elements:
      - {actuator: motor, kind: revolute, axis: z, home: LEFT, compliance: 3.0e-8}
      - {offset: arm_length, translation: [250, 0, 0]}
      - {spring: arm, beam: {length: 250, along: x, tube: {outer: 30, inner: 24}, material: steel}}
      - {joint: elbow, kind: revolute, axis: z, home: -BEND}
      - {offset: forearm_length, translation: [300, 0, 0]}
      - {spring: forearm, beam: {length: 300, along: x, tube: {outer: 30, inner: 24}, material: steel}}
  right:
    frame: {translation: [100, 0, 0]}
    elements:
      - {actuator: motor, kind: revolute, axis: z, home: RIGHT, compliance: 3.0e-8}
      - {offset: arm_length, translation: [250, 0, 0]}
      - {spring: arm, beam: {length: 250, along: x, tube: {outer: 30, inner: 24}, material: steel}}
      - {joint: elbow, kind: revolute, axis: z, home: BEND}
      - {offset: forearm_length, translation: [300, 0, 0]}
      - {spring: forearm, beam: {length: 300, along: x, tube: {outer: 30, inner: 24}, material: steel}}
      - {joint: pin, kind: revolute, axis: z, home: PIN}
"""


def sketched() -> str:
    """The file with the angles of the sketch, to a tenth of a degree; home is closed when it is loaded."""
    arm, forearm, reach = 250.0, 300.0, float(np.hypot(100, 400))
    at = np.degrees(np.arctan2(400, 100))
    inner = np.degrees(np.arccos((arm**2 + reach**2 - forearm**2) / (2 * arm * reach)))
    bend = 180 - np.degrees(np.arccos((arm**2 + forearm**2 - reach**2) / (2 * arm * forearm)))
    left, right = at + inner, 180 - at - inner
    pin = (left - bend) - (right + bend)
    text = SKETCH
    for name, value in {"LEFT": left, "RIGHT": right, "BEND": bend, "PIN": pin}.items():
        text = text.replace(name, f"{value:.1f}")
    turned = f"    attach: {{turns: [{{about: z, by: {bend - left:.1f}}}]}}\n"
    return text.replace("  right:\n", turned + "  right:\n") + turned


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    Path("mine.yaml").write_text(sketched(), encoding="utf-8")
    return "mine.yaml"


def test_from_a_sketch_to_a_map(machine: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", "starter.yaml"]) == 0  # what one starts from; its keys are those used above
    assert main(["check", machine]) == 0
    assert "usable" in capsys.readouterr().out
    assert main(["show", machine, "--load", "0", "-100", "0"]) == 0
    assert "of which" in capsys.readouterr().out
    assert main(["map", machine, "--force", "100", "--points", "3", "-o", "map", "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["failed"] == {}
    assert all(np.isfinite(r["max"]) for r in data["rows"])
    assert Path("map/report.html").is_file() and Path("map/map-loaded.png").is_file()
    assert Path("map/map-worst.png").is_file() and Path("my-five-bar.png").is_file()


def test_from_a_spreadsheet_to_a_diagnosis(machine: str, capsys: pytest.CaptureFixture[str]) -> None:
    real = sm.load_machine(machine).with_effect("compliance", element="motor", legs=["left"], scale=2.0)
    rng = np.random.default_rng(4)
    lines = [
        "Prüfprotokoll;;;;;;;;",
        "Nr;X [mm];Y [mm];Fx [N];Fy [N];Uhr X 1 [µm];Uhr X 2 [µm];Uhr Y 1 [µm];Uhr Y 2 [µm]",
    ]
    number = 0
    for x in (-60, 0, 60):
        for y in (350, 390, 430):
            for f in ((80, 0), (-80, 0), (0, 80), (0, -80)):
                number += 1
                d = 1e6 * real.solve([x / 1e3, y / 1e3, 0], [*f, 0, 0, 0, 0]).displacement[:2]
                read = d.repeat(2) + rng.normal(0, 2.0, 4)
                lines.append(";".join([str(number), str(x), str(y), str(f[0]), str(f[1]),
                                       *(f"{v:.1f}".replace(".", ",") for v in read)]))  # fmt: skip
    Path("clocks.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    command = ["experiment", "new", "clocks.csv", "--machine", machine, "-o", "readings", "--set", "z=0",
               "--map", "dx=Uhr X 1|Uhr X 2", "--map", "dy=Uhr Y 1|Uhr Y 2", "--noise", "dx=2", "--noise", "dy=2"]  # fmt: skip
    assert main(command) == 0
    assert "72 rows of deflection at 9 poses; reads dx, dy" in capsys.readouterr().out
    assert main(["residual", machine, "readings"]) == 1
    capsys.readouterr()
    assert main(["diagnose", machine, "readings", "-o", "result"]) == 1
    found = json.loads(Path("result/diagnosis.json").read_text(encoding="utf-8"))
    assert found["verdict"] == "effects"
    (effect,) = found["effects"]
    assert (effect["kind"], effect["element"], effect["legs"]) == ("compliance", "motor", ["left"])
    value, low, high, _ = effect["parameters"]["scale"]
    assert low < 2.0 < high and abs(value - 2.0) < 0.1
    assert main(["map", "result/machine.yaml", "--force", "100,0,0", "--points", "5", "-o", "corrected"]) == 0
    assert "left" in Path("result/report.html").read_text(encoding="utf-8")
