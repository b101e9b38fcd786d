"""A drive along a line in ball arithmetic: what its stroke commands, what a newton of it does, its leverage."""

from typing import NamedTuple

from flint import acb, arb

from fourbar.effects import LinearDrive
from fourbar.scene import Scene
from fourbar_validation.engines.ball_vectors import Ball, Complex, Values, dot, polar, wedge

ENDS = ("from", "to")


def collect_ends(drive: LinearDrive | None) -> dict[str, float]:
    """Collect the stored doubles of a drive."""
    points = () if drive is None else zip(ENDS, (drive.start, drive.end), strict=True)
    return {key: value for name, point in points for key, value in zip((name, f"{name}_angle"), point[1:], strict=True)}


def turn_by_stroke(scene: Scene, x: Values) -> Values | None:
    """Add angle, speed and acceleration of the bar that a commanded stroke turns; None where the triangle stays open.

    With l and r from the pin to the ends: s^2 = l^2 + r^2 - 2 l r cos beta, twice differentiated.
    """
    drive, motion = scene.drive, scene.motion
    assert drive is not None and motion.side is not None
    (_, other), (bar, own) = sorted(zip((drive.start.bar, drive.end.bar), ENDS, strict=True))
    held = polar(x[own], x[f"{own}_angle"])
    fixed = polar(x[other], x[f"{other}_angle"] + x["theta_1"])
    if bar == 4:
        fixed -= polar(x["d"], x["theta_1"])
    s, speed, length, reach = x["stroke"], x["stroke_speed"], abs(held), abs(fixed)
    cosine = (length**2 + reach**2 - s**2) / (2 * length * reach)
    if abs(cosine) > 1:
        return None
    beta, side = cosine.acos(), 1 if motion.side == "left" else -1  # to the left the stroke grows with the angle
    across, along = length * reach * beta.sin(), length * reach * cosine
    rate = s * speed / across
    growth = (speed**2 + s * x["stroke_acceleration"] - along * rate**2) / across
    lever = across / s / (length if length > reach else reach)
    turned = {f"theta_{bar}": fixed.arg() - held.arg() + side * beta, f"omega_{bar}": side * rate}
    return x | turned | {f"alpha_{bar}": side * growth, "lever": lever}


class BallLine(NamedTuple):
    """Line of the drive between its two points, at one position of the linkage."""

    stroke: Ball
    line: Complex
    """Unit vector from one point to the other."""
    arms: dict[int, Complex]
    """Vectors from the first pin to the end, of the bars with an end."""
    sense: dict[int, int]
    """Sign of the drive's push along the line on each of these bars."""

    def speed(self, foot: dict[int, Complex], omega: dict[int, Ball]) -> Ball:
        """Return ds/dt from the speeds of the bars' first pins and the bars' angular speeds."""
        ends = (sense * (foot[k] + acb(0, omega[k]) * self.arms[k]) for k, sense in self.sense.items())
        return dot(self.line, sum(ends, acb(0)))

    def push(self, bar: int, centre: Complex) -> tuple[Ball, Ball, Ball]:
        """Force (x, y) and moment about the mass centre of a bar, per newton."""
        if bar not in self.sense:
            return arb(0), arb(0), arb(0)
        force = self.sense[bar] * self.line
        return force.real, force.imag, wedge(self.arms[bar] - centre, force)


def find_line(drive: LinearDrive, x: Values, w: dict[int, Complex], first_pin: dict[int, Complex]) -> BallLine:
    """Find the line of a drive from the directions and first pins of all bars, the ground's too."""
    bars = drive.start.bar, drive.end.bar
    arms = {k: w[k] * polar(x[name], x[f"{name}_angle"]) for k, name in zip(bars, ENDS, strict=True)}
    start, end = (first_pin[k] + arms[k] for k in bars)
    stroke = abs(end - start)
    return BallLine(stroke, (end - start) / stroke, arms, dict(zip(bars, (-1, 1), strict=True)))


def compute_condition(line: BallLine, x: Values, tip: Complex, sines: dict[int, Ball]) -> Ball:
    """|P|/L, P the speed of the stroke with (sin mu, (a/b) sin(theta_2 - theta_4), (a/c) sin(theta_2 - theta_3)).

    L is the sum of what each end could move: r on bar 2, a + r a/b on bar 3, r a/c on bar 4, `tip` is A.
    """
    a, b, c = x["a"], x["b"], x["c"]
    turning = {1: arb(0), 2: sines[2], 3: -a / b * sines[3], 4: -a / c * sines[4]}
    foot = {1: acb(0), 2: acb(0), 3: acb(0, turning[2]) * tip, 4: acb(0)}
    most = {1: (0, 0), 2: (0, 1), 3: (a, a / b), 4: (0, a / c)}
    reach = sum((most[k][0] + most[k][1] * abs(arm) for k, arm in line.arms.items()), arb(0))
    return abs(line.speed(foot, turning)) / reach
