"""One version, and every documentation page is in reach of the index."""

from __future__ import annotations

import re
import shutil
import subprocess
import tomllib
from importlib.metadata import version
from pathlib import Path

import pytest

import stiffmap as sm

ROOT = Path(__file__).parents[3]


def test_one_version() -> None:
    """The tag says it; where there is none, what the newest heading of the changes is on the way to."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert project["project"]["dynamic"] == ["version"]
    next_one = project["tool"]["setuptools_scm"]["fallback_version"].removesuffix(".dev0")
    newest = re.search(r"^## \[?([\d.]+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert newest is not None and newest[1] == next_one
    assert f"version: {next_one}" in (ROOT / "CITATION.cff").read_text().replace('"', "")
    if sm.__version__ != "0":
        assert sm.__version__ == version("stiffmap")
        assert re.match(r"\d+\.\d+", sm.__version__)


@pytest.mark.parametrize(
    ("done", "expected"),
    [
        ([], r"0\.1\.0\.dev1"),
        (["git tag v3.4.5"], r"3\.4\.5"),
        (["git tag v3.4.5", "git commit -q --allow-empty -m next"], r"3\.4\.6\.dev1"),
        (["rm -rf .git"], r"0\.1\.0\.dev0"),
    ],
    ids=["no tag", "a tag", "a commit after it", "no git"],
)
def test_the_version_comes_from_the_tag(tmp_path: Path, done: list[str], expected: str) -> None:
    """A clone without tags, as in continuous integration, and an archive have a version as well."""
    scm = pytest.importorskip("setuptools_scm")
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    who = "git -c user.name=a -c user.email=a@b"
    for line in ["git init -q .", "git add -A", "git commit -q -m first", *done]:
        subprocess.run(re.sub(r"^git", who, line), shell=True, cwd=tmp_path, check=True)
    found = scm.get_version(root=str(tmp_path), local_scheme="no-local-version", fallback_version=fallback())
    assert re.fullmatch(expected.replace(r"0\.1\.0", re.escape(fallback().removesuffix(".dev0"))), found)


def fallback() -> str:
    """The version where nothing tells one."""
    return str(
        tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools_scm"]["fallback_version"]
    )


def test_every_public_name_is_there() -> None:
    for name in sm.__all__:
        assert getattr(sm, name) is not None


def test_local_links_lead_somewhere() -> None:
    for page in [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md")]:
        for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", page.read_text(encoding="utf-8")):
            if not target.startswith(("http", "mailto")):
                assert (page.parent / target).exists(), f"{page.name} -> {target}"


def test_licences_of_what_is_compiled_in_go_into_the_wheel() -> None:
    """Eigen's and pybind11's code is in the module: their licences are in `licenses`, which the wheel takes along."""
    patterns = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["license-files"]
    files = {p.name: p.read_text(encoding="utf-8") for pattern in patterns for p in ROOT.glob(pattern)}
    assert "Mozilla Public License Version 2.0" in files["Eigen-MPL-2.0.txt"]
    assert "Wenzel Jakob" in files["pybind11-BSD-3-Clause.txt"]
    assert all(name in files["NOTICE.txt"] for name in files if name not in ("LICENSE", "NOTICE.txt"))


def test_every_requirement_has_a_lowest_version_and_no_highest() -> None:
    """`.ci/versions` runs the lowest and the newest."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    for requirement in [
        *project["dependencies"],
        *(r for name, rs in extras.items() if name != "all" for r in rs),
    ]:
        assert re.fullmatch(r"[a-z0-9-]+>=[0-9.]+", requirement), requirement
    assert set(extras) - {"all"} == set(re.fullmatch(r"stiffmap\[(.*)\]", extras["all"][0])[1].split(","))  # type: ignore[index]
