"""The numbers of each effect, with their units and bounds: what scene files read and studies vary."""

ANY, AT_LEAST_ZERO, POSITIVE = "a finite number", "a finite number >= 0", "a finite number > 0"
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
