"""Files are written in one room: `stiffmap.common.outputs`, or to the scratch path of its `writing`."""

from __future__ import annotations

import ast
from importlib import import_module
from inspect import signature
from pathlib import Path

import typer
from tests.python.project.test_imports import MODULES

from stiffmap.ui.cli.commands import COMMANDS

METHODS = {
    "write_text", "write_bytes", "touch", "savefig", "to_netcdf", "to_zarr", "to_csv", "to_excel", "dump", "tofile",
    "rename", "replace", "copyfile", "copy", "copy2", "copytree", "move", "mkdir", "makedirs", "open_memmap", "savetxt",
    "savez", "symlink_to", "hardlink_to",
}  # fmt: skip
MODULE_ONLY = {"replace": "os", "rename": "os", "dump": "json", "copy": "shutil", "move": "shutil"}
"""Words that are writers as functions of a module only: ``text.replace`` writes nothing."""
ELSEWHERE = {
    "stiffmap.workspace.maps.files": {
        "mkdir",
        "to_zarr",
    },  # the folder in which a map grows; a folder that is renamed
    "stiffmap.workspace.maps.store": {
        "open_memmap",
        "copyfile",
        "mkdir",
    },  # arrays, chunks and frame of a map
    "stiffmap.model.link.solve": {"write_text"},  # a temporary folder, for another program
    "stiffmap.ui.report.sheet": {"savefig"},  # into memory
}


def direct_writes(path: Path) -> set[str]:
    """Calls that write files, but those inside ``with writing(...)``."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    scratch = {
        id(n)
        for w in ast.walk(tree)
        if isinstance(w, ast.With) and any("writing(" in ast.unparse(i.context_expr) for i in w.items)
        for n in ast.walk(w)
    }
    found = set()
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call) or id(node) in scratch:
            continue
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if name in METHODS:
            owner = ast.unparse(node.func.value) if isinstance(node.func, ast.Attribute) else ""
            room = name == "write_text" and not owner
            if not room and MODULE_ONLY.get(name, owner) == owner:
                found.add(name)
        if name == "open":
            modes = [*node.args[:2], *(k.value for k in node.keywords if k.arg == "mode")]
            texts = [m.value for m in modes if isinstance(m, ast.Constant) and isinstance(m.value, str)]
            if any(set(t) <= set("rwxabt+") and set(t) & set("wxa+") for t in texts):
                found.add("open")
    return found


def test_no_module_writes_files_itself() -> None:
    wrong = {
        name: found
        for name, path in MODULES.items()
        if not name.startswith("stiffmap.common.outputs")
        and (found := direct_writes(path) - ELSEWHERE.get(name, set()))
    }
    assert wrong == {}
    unused = {n: words for n, words in ELSEWHERE.items() if words - direct_writes(MODULES[n])}
    assert unused == {}


def test_the_reader_of_calls_sees_writers(tmp_path: Path) -> None:
    sample = tmp_path / "sample.py"
    sample.write_text(
        "p.open('w')\nopen(p, mode='ab')\np.open()\np.open('rb')\np.write_text('')\ntext.replace('a', 'b')\n"
        "os.replace(a, b)\nwith writing(p) as fresh:\n    fresh.write_bytes(b'')\n"
    )
    assert direct_writes(sample) == {"open", "write_text", "replace"}


def test_every_output_of_a_command_is_reserved_before_it_computes() -> None:
    """Options that hold a path to write have the callback of `written`."""
    missing, seen = [], 0
    for command in COMMANDS:
        function = import_module(command.module).command
        for name, parameter in signature(function, eval_str=True).parameters.items():
            option = next(
                (
                    m
                    for m in (*getattr(parameter.annotation, "__metadata__", ()), parameter.default)
                    if isinstance(m, typer.models.OptionInfo)
                ),
                None,
            )
            if option is None or "Path" not in str(parameter.annotation):
                continue
            words = f"{option.param_decls} {option.help}".lower()
            if "-o" in words or "write" in words or "folder for" in words:
                seen += 1
                if option.callback is None:
                    missing.append(f"{command.name}: {name}")
    assert missing == [] and seen >= 18
