"""Type checkers know which names stiffmap has."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import stiffmap as sm

ROOT = Path(__file__).parents[3]
SHOP_WINDOW = ROOT / "python/stiffmap/__init__.py"


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


def test_every_lazy_name_is_one_to_type_checkers() -> None:
    """The quick sibling: names of the table are imported under TYPE_CHECKING, and ``__getattr__`` is hidden there."""
    tree = ast.parse(SHOP_WINDOW.read_text(encoding="utf-8"))
    tests = [n for n in tree.body if isinstance(n, ast.If)]
    (shown,) = (n for n in tests if ast.unparse(n.test) == "TYPE_CHECKING")
    (hidden,) = (n for n in tests if ast.unparse(n.test) == "not TYPE_CHECKING")
    names = {a.name for n in shown.body if isinstance(n, ast.ImportFrom) for a in n.names}
    assert set(sm._HOME) == names
    assert [n.name for n in hidden.body if isinstance(n, ast.FunctionDef)] == ["__getattr__"]
    assert not any(isinstance(n, ast.FunctionDef) and n.name == "__getattr__" for n in tree.body)
    with pytest.raises(AttributeError, match="no attribute 'misspelt'"):
        sm.misspelt  # type: ignore[attr-defined]  # noqa: B018
