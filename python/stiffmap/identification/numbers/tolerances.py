"""Standard uncertainties of what a machine file and a certificate declare, where they say nothing else."""

from __future__ import annotations

from dataclasses import dataclass, fields


@dataclass(frozen=True)
class Tolerances:
    """One standard uncertainty per class of number, SI. Machine files override single ones with ``u``.

    position, direction
        Place of a joint's axis across itself; its direction (m, rad).
    length, mismatch
        Of a link between two passive joints; difference of links that should be alike (m).
    zero, turning_zero
        Of a sliding and a turning drive (m, rad).
    gain
        Scale of a drive's coordinate (1).
    compliance, mass
        Relative.
    instrument
        Scale of the instrument that reads positions: a laser tracker's certificate says 1e-5.
    tool
        The point that is read, in the tool's axes (m).
    frame, frame_direction
        Place and turn of an instrument's frame that the experiment calls known (m, rad); 0: exact.
    """

    position: float = 2e-4
    direction: float = 1e-3
    length: float = 2e-4
    mismatch: float = 2e-4
    zero: float = 2e-4
    turning_zero: float = 1e-3
    gain: float = 2e-4
    compliance: float = 0.2
    mass: float = 0.05
    instrument: float = 1e-5
    tool: float = 5e-4
    frame: float = 0.0
    frame_direction: float = 0.0

    def scaled(self, factor: float) -> Tolerances:
        """All but the instrument's own, times a factor."""
        own = ("instrument", "frame", "frame_direction")
        scale = {f.name: 1.0 if f.name in own else factor for f in fields(self)}
        return Tolerances(**{name: getattr(self, name) * s for name, s in scale.items()})
