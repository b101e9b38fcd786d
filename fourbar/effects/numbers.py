"""The numbers of a scene and of each effect, with their units: what scene files read and studies vary."""

from fourbar.linkage import ANY, AT_LEAST_ZERO, POSITIVE

OF_EFFECT: dict[str, dict[str, tuple[str, str]]] = {
    "gravity": {"magnitude": ("m/s^2", ANY), "angle": ("rad", ANY)},
    "viscous": {"": ("N m s/rad", AT_LEAST_ZERO)},
    "friction": {"": ("N m", AT_LEAST_ZERO)},
    "pin_friction": {"coefficient": ("1", AT_LEAST_ZERO), "radius": ("m", AT_LEAST_ZERO)},
    "torsion": {"stiffness": ("N m/rad", POSITIVE), "rest": ("rad", ANY), "preload": ("N m", ANY)},
    "springs": {"stiffness": ("N/m", AT_LEAST_ZERO), "length": ("m", AT_LEAST_ZERO), "preload": ("N", ANY)},
    "flywheel": {"inertia": ("kg m^2", AT_LEAST_ZERO)},
}
"""Unit and bound of each number of an effect, by its name; the one number that a pin has needs none."""
OF_GAS_SPRING = {
    **{name: ("m", POSITIVE) for name in ("extended", "stroke")},
    **{name: ("N", AT_LEAST_ZERO) for name in ("extended_force", "compressed_force")},
}
"""The words of a gas spring, which becomes one of the springs."""
ROWS = {"viscous": "coefficients", "friction": "torques", "pin_friction": "pins", "torsion": "springs"}
"""Effects that hold rows (pin, number, ...), each with its field of them."""
OF_SCENE = {
    **dict.fromkeys(("ground", "input", "coupler", "output", "centre", "at", "from_pin"), "m"),
    **{f"theta_{bar}": "rad" for bar in (2, 3, 4)},
    **{f"omega_{bar}": "rad/s" for bar in (2, 3, 4)},
    **{f"alpha_{bar}": "rad/s^2" for bar in (2, 3, 4)},
    **{"stroke": "m", "stroke_speed": "m/s", "stroke_acceleration": "m/s^2"},
    **{
        "ground_angle": "rad",
        "mass": "kg",
        "inertia": "kg m^2",
        "force": "N",
        "moment": "N m",
        "gravity": OF_EFFECT["gravity"]["magnitude"][0],
    },
}
"""Unit of each other number by the last word of its key, of a pair that of its magnitude."""


def find_unit(key: str) -> str | None:
    """Return the unit of the number that a key of a scene file names; None where no scene has such a number."""
    *before, name = key.split(".")
    numbers = OF_EFFECT.get(before[1], {}) if before[:1] == ["effects"] and len(before) > 1 else {}
    if before and name in ("0", "1"):
        return "rad" if name == "1" else OF_SCENE.get(before[-1])
    return (numbers.get(name) or numbers.get("") or (OF_SCENE.get(name),))[0]
