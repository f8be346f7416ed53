"""One call or more of every command with ``--json``, in the folder of `test_help.workshop`."""

from __future__ import annotations

CALLS: dict[str, tuple[str, ...]] = {
    "machines": ("machines",),
    "new": ("new s.yaml --overwrite", "new --from scara s.yaml --overwrite", "new --list"),
    "check": ("check five-bar", "check my_machine.yaml"),
    "show": (
        "show five-bar --no-picture",
        "show ur10 --no-picture",
        "show five-bar --load 100,0,0 --no-picture",
    ),
    "effects": ("effects",),
    "solve": (
        "solve orthoglide-revised --force 300,0,0",
        "solve ur10 --force 0,0,-50",
        "solve orthoglide-revised --at path_small.csv --force 0,0,-100",
        "solve orthoglide-revised --at 0,0,900",
    ),
    "map": (
        "map five-bar --points 4 -o m --no-pictures",
        "map five-bar --points 4 --estimate",
        "map five-bar --points 4 --statistics",
        "map five-bar --toolpath path_flat.csv -o m --no-pictures",
    ),
    "polar": ("polar five-bar -o p",),
    "wrench": (
        "wrench orthoglide-revised --by 0.1,0,0",
        "wrench five-bar --by 0.1,0,0",
    ),
    "stress": ("stress orthoglide-revised", "stress hexapod"),
    "import": ("import arm.urdf -o a.yaml --overwrite",),
    "sweep": (
        "sweep orthoglide-revised --direction 1,0,0",
        "sweep orthoglide-revised --direction 1,0,0 --to 500 --points 4",
    ),
    "measures": (
        "measures five-bar --nodes 3 --coarse 3",
        "measures orthoglide-revised --nodes 3 --coarse 3",
    ),
    "efforts": ("efforts orthoglide-revised cut.yaml", "efforts ur10 path.csv --feed 600"),
    "optimize": ("optimize my_design.yaml --generations 1 -o opt",),
    "paper": ("paper --points 5 -o pap",),
    "link": ("link bar.yaml --quick --size 6 -o b.yaml",),
    "experiment": (
        "experiment new clocks.csv --machine five-bar --map dx='Uhr 1|Uhr 2' --set z=0 --overwrite -o clocks",
    ),
    "residual": ("residual orthoglide-revised january", "residual linear-delta experiments/heights"),
    "diagnose": ("diagnose orthoglide-revised january -o d1",),
    "calibrate": ("calibrate orthoglide-revised held_out -o c1",),
    "simulate": ("simulate five-bar --poses 3 -o sim",),
    "plan": (
        "plan orthoglide-revised --identify 'compliance actuator x scale=1' --rows 4 --poses 8",
        "plan examples/taps/kr210.yaml --taps 2 --poses 4",
    ),
    "monitor": ("monitor orthoglide-revised january june --effect 'dead_zone actuator y half_width=10um'",),
    "compensate": (
        "compensate orthoglide-revised poses.csv",
        "compensate travelling-column --axis z -o z.csv",
    ),
    "mill": ("mill orthoglide-revised outline.ngc --process trimming -o mil",),
    "bench": ("bench --rounds 1",),
    "process": ("process forces.csv --process slot -o process.yaml", "process signals.csv"),
    "lobes": ("lobes linear-delta --process slot --mode 1243,6.2,0.048,x --mode 1747,2.9,0.1,y",),
    "taps": ("taps examples/taps/kr210.yaml examples/taps/taps.csv --only compliance",),
    "view": ("view five-bar --html v.html",),
}
COSTLY = {
    "optimize",
    "paper",
    "link",
    "diagnose",
    "calibrate",
    "mill",
    "bench",
    "plan",
    "monitor",
    "measures",
    "taps",
}
"""Left to the slow lane."""
