"""Chosen designs as machine files, measured in full beside the machine that the search began with."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import yaml

from stiffmap.design.search import ParetoSet
from stiffmap.machine import load_machine
from stiffmap.performance.table import MeasuresTable, measures


def measured(found: ParetoSet, place: Path, nodes: int = 21) -> dict[str, MeasuresTable]:
    """Tables by name: ``start`` and each chosen design, whose machine file is written to `place`."""
    design = found.design
    names = list(
        dict.fromkeys(
            [
                *(n for n, _ in design.constraints),
                *design.model.objectives,
                "force",
                "acceleration",
                "frequency",
            ]
        )
    )
    task = replace(design.requirements, bounds=design.constraints)
    out = {"start": measures(load_machine(design.machine_file), requirements=task, only=names, nodes=nodes)}
    done: dict[int, str] = {}
    for name, i in found.chosen().items():
        data = dict(design.data(found.x[i]))
        data["name"] = f"{design.model.name}-{name}"
        file = place / f"{name}.yaml"
        values = ", ".join(f"{k} = {v:.5g}" for k, v in design.names(found.x[i]).items())
        text = yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=110)
        file.write_text(
            f"# Written by stiffmap optimize ({design.model.name}): {values}\n{text}", encoding="utf-8"
        )
        if i in done:
            out[name] = out[done[i]]
        else:
            out[name] = measures(load_machine(file), requirements=task, only=names, nodes=nodes)
            done[i] = name
    return out
