"""One version, and every documentation page is in reach of the index."""

from __future__ import annotations

import re
import tomllib
from importlib.metadata import version
from pathlib import Path

import stiffmap as sm

ROOT = Path(__file__).parents[3]


def test_one_version() -> None:
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert sm.__version__ in (declared, "0")
    if sm.__version__ != "0":
        assert version("stiffmap") == declared
    cmake = re.search(r"project\(stiffmap VERSION ([\d.]+)", (ROOT / "CMakeLists.txt").read_text())
    assert cmake is not None and cmake.group(1) == declared
    assert f"version: {declared}" in (ROOT / "CITATION.cff").read_text().replace('"', "")
    assert re.search(rf"## \[?{re.escape(declared)}", (ROOT / "CHANGELOG.md").read_text())


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
    """`.ci/lowest` runs the former; with no upper limit every fresh environment is the job with the newest."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    for requirement in [
        *project["dependencies"],
        *(r for name, rs in extras.items() if name != "all" for r in rs),
    ]:
        assert re.fullmatch(r"[a-z0-9-]+>=[0-9.]+", requirement), requirement
    assert set(extras) - {"all"} == set(re.fullmatch(r"stiffmap\[(.*)\]", extras["all"][0])[1].split(","))  # type: ignore[index]
