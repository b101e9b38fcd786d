"""A bar turned to a stroke by halving, apart from the law of cosines, and at its speed by the line's own lever."""

import numpy as np

from fourbar.scene import Command, Scene
from fourbar.scene.motion import Motion
from fourbar_validation.compare.answer import Array
from fourbar_validation.engines.description import place, resolve

HALVINGS = 80
"""Number of times half a turn is halved: beyond the last digit of an angle."""


def measure_cylinder(scene: Scene) -> tuple[complex, complex]:
    """Measure from the ground pin of its bar, at angle 0, to a cylinder's end on it, and to that on the ground, m."""
    drive = scene.drive
    assert drive is not None
    own, other = (drive.end, drive.start) if drive.start.bar == 1 else (drive.start, drive.end)
    pivot = 0.0j
    if own.bar == 4:
        pivot = complex(*resolve(scene.linkage.ground, scene.linkage.ground_angle))
    return complex(*resolve(own.distance, own.angle)), complex(*place(other, scene.linkage.ground_angle)) - pivot


def find_angle(command: Command, motion: Motion, arm: complex, ground: complex) -> Command:
    """Find the bar's angle where its cylinder has the stroke, on the side that is stated, and its rates.

    `arm` and `ground`: as `measure_cylinder` has them, or as an engine measures them.
    """
    assert command.stroke is not None
    sense = 1.0 if motion.side == "left" else -1.0
    towards = float(np.angle(ground / arm))

    def across(theta: Array) -> Array:
        return np.asarray(arm * np.exp(1j * theta) - ground)

    low, high = np.zeros(len(command.stroke)), np.full(len(command.stroke), np.pi)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        short = np.abs(across(towards + sense * middle)) < command.stroke
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    theta = towards + sense * 0.5 * (low + high)
    if motion.stroke_speed is None:
        return command._replace(angle=theta, speed=None)
    line, velocity = across(theta), 1j * arm * np.exp(1j * theta)  # velocity of the end, per rad/s
    stroke = np.abs(line)
    with np.errstate(all="ignore"):
        slope = (np.conj(line) * velocity).real / stroke
        omega = motion.stroke_speed / slope
        # s s'' + s'^2 = |v|^2 + line . a, with a = alpha velocity - omega^2 arm
        centripetal = (np.conj(line) * (-arm * np.exp(1j * theta))).real * omega**2
        rest = stroke * motion.stroke_acceleration + motion.stroke_speed**2 - np.abs(velocity * omega) ** 2
        alpha = (rest - centripetal) / (stroke * slope)
    return command._replace(angle=theta, speed=omega, acceleration=alpha)
