"""The largest numbers of a scene, beside its drawing in the workbench.

Once a page rests they are those that `analyze` prints, located between the positions;
while somebody drags they are those of the positions, which are reached at least.
"""

import math

import numpy as np

from fourbar.linkage import PIN_FORCE
from fourbar.show.motion_curves import compute_pin_loads, find_drive_rounding
from fourbar.show.shown_units import write_short
from fourbar.show.summary import Facts
from fourbar.solution import Conversion, Solution

_DRIVE = {"torque": "N m", "drive_force": "N"}


def write_headline(
    solution: Solution,
    units: Conversion,
    facts: Facts | None,
) -> str:
    """Write the drive's peak, the largest pin force and the least transmission angle.

    `facts`: those of the solution; without them numbers are said to be reached at
    least.
    """
    reached = "" if facts is not None or len(solution) == 1 else "at least "
    among = " (of these positions)" if facts and facts.kind == "list" else ""
    peaks = list_peaks(solution, facts)
    parts = []
    for name in _DRIVE.keys() & peaks.keys():
        words = name.replace("_", " ")
        peak = peaks[name]
        if peak is None:
            parts.append(f"{words} grows without bound")
        else:
            text = write_short(peak, _DRIVE[name], units)
            parts.append(f"peak {words} {reached}{text}{among}")
    loads = {pin: peaks[name] for pin, name in PIN_FORCE.items() if name in peaks}
    unbounded = [pin for pin, load in loads.items() if load is None]
    if unbounded:
        parts.append(f"pin forces grow without bound at {', '.join(unbounded)}")
    elif loads:
        load, pin = max((load or 0.0, pin) for pin, load in loads.items())
        text = write_short(load, "N", units)
        parts.append(f"largest pin force {reached}{text} at {pin}{among}")
    if facts is None:
        least = math.asin(min(float(np.nanmin(np.abs(solution.sin_mu))), 1.0))
        reached = reached.replace("least", "most")
    else:
        least = facts.transmission.value
    parts.append(f"least transmission angle {reached}{math.degrees(least):.1f}°{among}")
    return "; ".join(parts)


def list_peaks(solution: Solution, facts: Facts | None) -> dict[str, float | None]:
    """List the largest magnitudes of drive and pin forces; None: without bound, SI.

    `facts`: where they are located between the positions.
    """
    peaks = dict[str, float | None]()
    if solution.F12 is not None:
        for force, sizes in compute_pin_loads(solution).items():
            if np.isfinite(sizes).any():
                peaks[force] = float(np.nanmax(sizes))
    if facts is not None:
        for pin, load in facts.pins.items():
            peaks[PIN_FORCE[pin]] = None if load.peak is None else load.peak.value
    for name in _DRIVE:
        values = getattr(solution, name)
        is_driven = solution.scene is None or solution.scene.motion.free is None
        if is_driven and values is not None and np.isfinite(values).any():
            peak = float(np.nanmax(np.abs(values)))
            if facts is not None and facts.peak is not None:
                peak = abs(facts.peak.value)
            peaks[name] = 0.0 if peak <= find_drive_rounding(solution) else peak
    if facts is not None:
        peaks |= dict.fromkeys(facts.motion.panels.growing & peaks.keys())
    return peaks
