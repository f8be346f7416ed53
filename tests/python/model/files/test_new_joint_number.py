"""A number of a joint is declared on one line: a copy of the package with that line more knows it everywhere."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import stiffmap
from stiffmap import _core
from stiffmap.common.units import Dimension
from stiffmap.model.description import Drive, Joint
from stiffmap.model.description.numbers import DeclaredNumber, numbers_of

LINE = '    lash: float | None = number("wear.lash", "Lost motion.", coordinate=1, lower=0.0, upper=0.01)\n'
BEFORE = '    speed: float | None = number("speed"'

SCRIPT = """
import re
import sys

sys.meta_path = [m for m in sys.meta_path if "Editable" not in type(m).__name__ and "Scikit" not in type(m).__name__]
sys.path.insert(0, sys.argv[1])
from pathlib import Path
import stiffmap as sm
from stiffmap.model.description.tree import all_elements
from stiffmap.model.files.schema import MachineFile
from stiffmap.model.addresses import moved, number

assert sm.__file__.startswith(sys.argv[1]), sm.__file__
folder = Path(sys.argv[1])
shipped = (folder / "stiffmap/model/machines/orthoglide-revised.yaml").read_text()


def machine(value):
    file = folder / "worn.yaml"
    text, n = re.subn(r"( +)(speed: [^\\n]+)", rf"\\1\\2\\n\\1wear: {{lash: {value}}}", shipped)
    assert n
    file.write_text(text)
    return sm.load_machine(file)


worn = machine("{value: 0.012, u: 0.003}")  # the file is in mm
drives = {n: e for n, e in all_elements(worn.description) if getattr(e, "actuated", False)}
full = next(iter(drives))
assert drives[full].drive.lash == 1.2e-5
key = f"{full}/wear.lash"
assert dict(worn.description.uncertainty)[key] == 3e-6
assert number(worn.description, key) == 1.2e-5
assert abs(number(moved(worn.description, key, 1e-6), key) - 1.3e-5) < 1e-18
worn.save(folder / "again.yaml")
assert sm.load_machine(folder / "again.yaml").description == worn.description
schema = str(MachineFile.model_json_schema())
assert "lash" in schema and "Lost motion." in schema
for value, words in (("-1", "wear.lash: expected 0 to 0.01 (SI); found -1"), ("wide", "number"), ("20", "0.01")):
    try:
        machine(value)
    except sm.StiffmapError as error:
        assert words in str(error), error
    else:
        raise AssertionError(value)
print("known everywhere")
"""


OF_A_BODY = (
    '    share: float | None = number("filling.share", "Of the body that is filled.", lower=0.0, upper=1.0)\n'
)
BEFORE_IT = "    inertia: Rows = "

SCRIPT_OF_A_BODY = """
import sys

sys.meta_path = [m for m in sys.meta_path if "Editable" not in type(m).__name__ and "Scikit" not in type(m).__name__]
sys.path.insert(0, sys.argv[1])
from pathlib import Path
import stiffmap as sm
from stiffmap.model.addresses import listed

assert sm.__file__.startswith(sys.argv[1]), sm.__file__
folder = Path(sys.argv[1])
text = (folder / "stiffmap/model/machines/orthoglide-revised.yaml").read_text()


def machine(value):
    return sm.load_machine(text.replace("body: platform", f"body: platform\\n    filling: {{share: {value}}}"))


filled = machine("{value: 0.4, u: 0.1}")
(row,) = [r for r in listed(filled.description) if r.address == "platform.platform/filling.share"]
assert (row.value, row.unit, row.u) == (0.4, "", 0.1)
filled.save(folder / "again.yaml")
assert sm.load_machine(folder / "again.yaml").description == filled.description
try:
    machine(2)
except sm.StiffmapError as error:
    assert "share: expected 0 to 1 (SI); found 2" in str(error), error
else:
    raise AssertionError
print("known everywhere")
"""


@pytest.mark.parametrize(
    ("line", "before", "script"), [(LINE, BEFORE, SCRIPT), (OF_A_BODY, BEFORE_IT, SCRIPT_OF_A_BODY)]
)
def test_one_line_declares_a_number(tmp_path: Path, line: str, before: str, script: str) -> None:
    copy = tmp_path / "stiffmap"
    shutil.copytree(
        Path(stiffmap.__file__).parent, copy, ignore=shutil.ignore_patterns("__pycache__", "*.so")
    )
    for library in Path(_core.__file__).parent.glob("*.so"):
        (copy / library.name).symlink_to(library)
    file = copy / "model/description/elements.py"
    text = file.read_text(encoding="utf-8")
    assert text.count(before) == 1
    file.write_text(text.replace(before, line + before), encoding="utf-8")
    command = [sys.executable, "-c", script, str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "known everywhere"


def test_numbers_of_the_core_have_one_name_in_both_languages() -> None:
    declared = [n.core for holder in (Joint, Drive) for n in numbers_of(holder) if n.core]
    assert sorted(declared) == sorted(_core.DRIVE_NUMBERS)


@pytest.mark.parametrize("holder", [Joint, Drive])
def test_keys_are_unique_and_bounds_in_order(holder: type) -> None:
    numbers = numbers_of(holder)
    assert numbers
    assert len({n.key for n in numbers}) == len(numbers)
    assert all(n.lower < n.upper and n.doc.endswith(".") for n in numbers)


def test_units_follow_the_joint() -> None:
    viscous = DeclaredNumber("friction.viscous", "", coordinate=-1, effort=1)
    assert viscous.dimension(angular=False) == Dimension(length=-1, force=1)
    assert viscous.dimension(angular=True) == Dimension(length=1, force=1, angle=-1)


def test_the_core_refuses_a_number_that_it_does_not_have() -> None:
    with pytest.raises(KeyError, match="the core's drives do not have"):
        _core.Chain().joint(
            name="j", prismatic=True, axis=[1.0, 0.0, 0.0], actuated=True, home=0.0, law=None,
            numbers={"moon": 1.0}, errors=[], lower=-1.0, upper=1.0, guide_errors=[], friction=0.0, about_command=False,
        )  # fmt: skip
