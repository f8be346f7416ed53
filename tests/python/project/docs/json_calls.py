"""One call or more of every command with ``--json``, in the folder of `test_help.workshop`."""

from __future__ import annotations

SHIPPED = (
    "3-rps", "five-bar", "hexapod", "hybrid", "linear-delta", "orthoglide-original", "orthoglide-revised", "rotary-delta",
    "swing-table", "travelling-column", "tripteron", "ur10",
)  # fmt: skip
EXPERIMENTS = ("A-servo", "B-none", "C-backlash", "D-gravity", "E-leglength")
"""Of tests/data/experiments, all of orthoglide-revised; `make_workshop` puts them into its folder `measured`."""
CALLS: dict[str, tuple[str, ...]] = {
    "machines": ("machines",),
    "new": ("new s.yaml --overwrite", "new --from scara s.yaml --overwrite", "new --list"),
    "check": (*(f"check {name}" for name in SHIPPED), "check my_machine.yaml"),
    "show": (
        *(f"show {name} --no-picture" for name in SHIPPED),
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
        "map orthoglide-revised --y 0 --plane xz --points 4 -o m --no-pictures",
        "map orthoglide-revised --x 0 --plane yz --points 4 -o m --no-pictures",
        "map five-bar --points 4 --estimate",
        "map five-bar --points 4 --statistics",
        "map five-bar --toolpath path_flat.csv -o m --no-pictures",
    ),
    "polar": ("polar five-bar -o p", "polar tripteron --at 300,400,500 --plane xz -o p"),
    "wrench": (
        "wrench orthoglide-revised --by 0.1,0,0",
        "wrench five-bar --by 0.1,0,0",
    ),
    "stress": ("stress orthoglide-revised", "stress hexapod"),
    "import": ("import arm.urdf -o a.yaml --overwrite",),
    "sweep": (
        "sweep orthoglide-revised --direction 1,0,0",
        "sweep orthoglide-revised --direction 1,0,0 --to 500 --points 4",
        "sweep orthoglide-revised --from 0 --to 500 --points 4",
        "sweep linear-delta --direction 0,0,-1 --control displacement --limit 20",
    ),
    "measures": (
        "measures five-bar --nodes 3 --coarse 3",
        "measures orthoglide-revised --nodes 3 --coarse 3",
    ),
    "efforts": ("efforts orthoglide-revised cut.yaml", "efforts ur10 path.csv --feed 600"),
    "optimize": ("optimize my_design.yaml --generations 1 -o opt",),
    "paper": ("paper --points 5 -o pap",),
    "link": (
        "link bar.yaml --quick --size 6 -o b.yaml",
        "link bracket.step --fixed face3 --loaded face7 --material aluminium --size 4 --quick",
        "link field.csv --cases cases.csv --reference 310,0,0",
    ),
    "experiment": (
        "experiment new clocks.csv --machine five-bar --map dx='Uhr 1|Uhr 2' --set z=0 --overwrite -o clocks",
        "experiment new more_clocks.csv --machine five-bar --set z=0 --overwrite -o more_clocks",
    ),
    "residual": (
        *(f"residual orthoglide-revised measured/{name}" for name in EXPERIMENTS),
        "residual orthoglide-revised january",
        "residual linear-delta experiments/heights",
    ),
    "diagnose": (
        *(f"diagnose orthoglide-revised measured/{name}" for name in EXPERIMENTS),
        "diagnose orthoglide-revised january -o d1",
    ),
    "calibrate": (
        *(f"calibrate orthoglide-revised measured/{name}" for name in EXPERIMENTS),
        "calibrate orthoglide-revised held_out -o c1",
    ),
    "simulate": ("simulate five-bar --poses 3 -o sim",),
    "plan": (
        "plan orthoglide-revised --identify 'compliance actuator x scale=1' --rows 4 --poses 8",
        "plan examples/taps/kr210.yaml --taps 2 --poses 4",
        "plan orthoglide-revised --identify 'compliance actuator scale=1' --until 0.05 --twin 'compliance actuator scale=1.4'",
        "plan orthoglide-revised --identify 'dead_zone actuator y half_width=10um' --rival 'compliance actuator y scale=1.2'",
    ),
    "monitor": ("monitor orthoglide-revised january june --effect 'dead_zone actuator y half_width=10um'",),
    "compensate": (
        "compensate orthoglide-revised poses.csv",
        "compensate travelling-column --axis z -o z.csv",
        "compensate results/map.nc --case Fx --axis x --format siemens -o x.mpf",
        "compensate calibrated_arm.yaml --urdf arm.urdf -o corrected.urdf",
        "compensate corrected.yaml --check held_out",
        "compensate ur10 --effect 'zero_offset elbow error=1mrad' --dh arm.csv",
    ),
    "mill": ("mill orthoglide-revised outline.ngc --process trimming -o mil",),
    "bench": ("bench --rounds 1",),
    "process": ("process forces.csv --process slot -o process.yaml", "process signals.csv"),
    "lobes": (
        "lobes linear-delta --process slot --mode 1243,6.2,0.048,x --mode 1747,2.9,0.1,y --points 4,3",
    ),
    "taps": ("taps examples/taps/kr210.yaml examples/taps/taps.csv --only compliance",),
    "view": ("view five-bar --html v.html", "view five-bar --no-browser --port 0"),
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
    "lobes",
}
"""Left to the examples of their help."""
MAPS: dict[str, tuple[str, ...]] = {
    "calibrate": (
        ".validity.drives", ".validity.loads", ".before.per_axis", ".after.per_axis", ".held_out.before.per_axis",
        ".held_out.after.per_axis",
    ),
    "check": (".home_gaps", ".home_changes"),
    "diagnose": (
        ".effects[].parameters", ".effects[].evidence", ".alternatives[][].parameters", ".alternatives[][].evidence",
        ".before.per_axis", ".after.per_axis", ".noise.floor", ".noise.repeats", ".noise.declared", ".noise.consistency",
        ".detectable[].sizes", ".seconds",
    ),
    "experiment": (".columns", ".units"),
    "map": (".failed", ".worst_pose.shares", ".worst_pose.sources", ".rows[].percentiles"),
    "mill": (".statuses",),
    "new": (".dimensions", ".*.dimensions"),
    "optimize": (".chosen", ".refined", ".refined.*.found", ".refined.*.refined", ".refined.*.deviation.*"),
    "paper": (".statements[].numbers",),
    "process": (".laws[].numbers",),
    "residual": (".summary.per_axis", ".noise_floor"),
    "show": (".legs", ".elements"),
    "solve": (".actuator_effort", ".leg_wrench", ".joint_coordinates", ".spring_deflection"),
    "stress": (".springs", ".joints", ".legs"),
    "taps": (".named[].parameters", ".named[].u"),
    "wrench": (".leg_wrench", ".leg_stiffness", ".actuator_effort"),
}  # fmt: skip
"""Places in what a command prints whose keys are names of parts, drives, channels, columns or measures, not words of ours; * is any text."""
