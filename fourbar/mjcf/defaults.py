"""A scene from bare bar lengths, with every default it takes."""

import math

from fourbar.formulas.mobility import choose_range, turns_fully
from fourbar.linkage import BAR_NAMES, uniform
from fourbar.scene import Scene
from fourbar.scene.motion import Motion

PER_METRE = 1.0
"""kg/m of the uniform bars."""
OMEGA = 1.0
"""rad/s of the input."""


def make_scene(ground: float, input: float, coupler: float, output: float, omega: float = OMEGA) -> Scene:
    """Uniform slender bars of 1 kg/m on the open branch, the input at omega (rad/s) from mid-range; lengths in m."""
    linkage = uniform(ground, input, coupler, output, per_metre=PER_METRE)
    title = f"four-bar {ground!r} {input!r} {coupler!r} {output!r}"
    # half a turn from the ground's line would start a parallelogram in its change point
    quarter = linkage.ground_angle + math.pi / 2.0
    start = quarter if turns_fully(linkage) else 0.5 * sum(choose_range(linkage))
    return Scene(linkage, Motion(start, omega), title=title)


def list_defaults(scene: Scene) -> list[str]:
    """List the lengths that `make_scene` was given and its defaults, one line each."""
    theta_2 = scene.motion.theta_2
    assert isinstance(theta_2, float)
    return [
        "lengths in m: "
        + ", ".join(f"{n} {x!r}" for n, x in zip(BAR_NAMES.values(), scene.linkage.lengths, strict=True)),
        f"bars: uniform and slender, {PER_METRE:g} kg/m",
        "branch: open",
        f"omega_2: {scene.motion.omega_2!r} rad/s, alpha_2: 0",
        f"start: theta_2 = {theta_2!r} rad ({math.degrees(theta_2):.6g} deg)",
        "drive: bar 2; no gravity, no loads",
    ]
