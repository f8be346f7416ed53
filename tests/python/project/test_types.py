"""Type checkers know which names stiffmap has."""

from __future__ import annotations

import ast
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
PACKAGE = ROOT / "python/stiffmap"


def test_a_misspelt_name_is_an_error_to_mypy(tmp_path: Path) -> None:
    pytest.importorskip("mypy")
    sample = tmp_path / "sample.py"
    sample.write_text("import stiffmap as sm\n\nsm.load_machine\nsm.calibrate\nsm.misspelt\n")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", str(sample)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout.count("error:") == 1, done.stdout
    assert 'sample.py:5: error: Module has no attribute "misspelt"' in done.stdout


@pytest.mark.parametrize("stub", sorted(PACKAGE.rglob("__init__.pyi")), ids=lambda p: p.parent.name)
def test_every_name_of_a_stub_is_there_when_it_is_asked_for(stub: Path) -> None:
    package = import_module(".".join(stub.parent.relative_to(PACKAGE.parent).parts))
    names = {
        a.name
        for n in ast.walk(ast.parse(stub.read_text()))
        if isinstance(n, ast.ImportFrom)
        for a in n.names
    }
    assert names == {*package.__all__} == {*dir(package)}
    for name in names:
        assert getattr(package, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'misspelt'"):
        package.misspelt  # noqa: B018


def test_the_package_is_imported_without_what_it_loads_later() -> None:
    script = "import sys, stiffmap, stiffmap.experiment.files, stiffmap.workspace.maps.inputs; assert 'xarray' not in sys.modules"
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0
