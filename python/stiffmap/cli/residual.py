"""``stiffmap residual``."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from stiffmap.cli.output import JsonOption, print_json
from stiffmap.diagnosis.limits import refuse
from stiffmap.diagnosis.result import plain
from stiffmap.experiment import Residual, load_experiment
from stiffmap.experiment import residual as compute
from stiffmap.machine import load_machine


def residual(
    machine: Annotated[str, typer.Argument(help="Declared machine: shipped name or machine file.")],
    data: Annotated[str, typer.Argument(help="Experiment: folder with experiment.yaml and its CSV file.")],
    rows: Annotated[int, typer.Option(help="Number of worst rows to print.")] = 5,
    as_json: JsonOption = False,
) -> None:
    """Prediction for every reading: rms, per axis, worst rows, noise floor, lack of fit, model-free checks.

    Examples:

      [cyan]stiffmap residual orthoglide-revised experiments/servo[/cyan]
    """
    experiment = load_experiment(data)
    result = compute(load_machine(machine), experiment)
    refuse(experiment, result.prediction)
    if as_json:
        print_json(as_plain(result, rows))
    else:
        _print(result, rows)


def as_plain(r: Residual, rows: int) -> dict[str, Any]:
    """JSON data, SI."""
    ids = [r.experiment.ids[i] for i in r.set_aside.nonzero()[0]]
    out = {
        "summary": r.summary,
        "noise_floor": r.noise.rms,
        "lack_of_fit": r.lack_of_fit,
        "poses_off": r.groups_off,
    }
    out |= {"set_aside": ids, "worst": r.worst(rows), "checks": r.checks}
    return {k: plain(v) for k, v in out.items()}


def _print(r: Residual, rows: int) -> None:
    s = r.summary
    print(f"{r.experiment.name}: {s.n} readings of {r.experiment.quantity}; reading minus prediction, mm")
    print(f"  rms {1e3 * s.rms:.4f}   95 % {1e3 * s.p95:.4f}   largest {1e3 * s.max:.4f}")
    print(
        "  "
        + "   ".join(
            f"{a} {1e3 * v:.4f}" if a[0] == "d" else f"{a} {v:.3g} rad" for a, v in s.per_axis.items()
        )
    )
    print(
        f"  noise floor {1e3 * r.noise.rms:.4f}; rms / floor {s.ratio:.2f}; "
        f"chance of this fit {r.lack_of_fit:.2g}"
    )
    print(
        f"  poses beyond noise: {r.groups_off} of {int(r.experiment.groups.max()) + 1}; "
        f"rows set aside: {int(r.set_aside.sum())}"
    )
    for c in r.checks:
        told = f"rms/noise {c.rms:.2f}, chance {c.p:.2g}" if c.contrasts else "the plan does not allow it"
        print(f"  {c.name} ({c.meaning}): {told}")
    print("  worst rows: " + ", ".join(f"{i} ({1e3 * v:.4f} mm)" for i, v in r.worst(rows)))
