"""The linkage of a scene as a small SVG: bars and pins to scale over the paths of A, B and the coupler's centre."""

import math
from collections.abc import Iterable

import numpy as np

from fourbar.errors import NotAssembledError
from fourbar.scene import Scene
from fourbar.solution import Array, Solution

INK, SOFT, PAPER = "currentColor", "#6e7781", "#fefefe"
WIDTH, HEIGHT, MARGIN = 300.0, 270.0, 30.0
BARS = {2: "#0072b2", 3: "#c74f00", 4: "#00845f"}
POINT = "#8a3b78"
Point = tuple[float, float]
MOST_POINTS = 120
"""Points of a path: finer than can be seen at this size."""


def draw_scene(scene: Scene, solution: Solution) -> str:
    """Draw the linkage at its best conditioned position; ink in the colour of the text around it.

    Raises NotAssembledError where it assembles nowhere.
    """
    if not solution.assembled.any():
        raise NotAssembledError("nothing to draw: the linkage assembles at none of the positions")
    good = solution.assembled
    index = int(np.argmax(np.where(good, solution.condition, -1.0)))
    d, theta_1 = scene.linkage.ground, scene.linkage.ground_angle
    O2, O4 = np.zeros(2), d * np.array([math.cos(theta_1), math.sin(theta_1)])
    paths = [(solution.A, BARS[2]), (solution.B, BARS[4]), (solution.G3, BARS[3])]
    paths += [(getattr(solution, f"G{n}"), BARS[n]) for n in (2, 4) if scene.linkage.bar(n).mass > 0.0]
    paths += [(path, POINT) for path in solution.points.values()]
    shown = np.concatenate([np.array([O2, O4]), *(path[good] for path, _ in paths)])
    low, high = shown.min(axis=0), shown.max(axis=0)
    scale = float(np.min((np.array([WIDTH, HEIGHT]) - 2.0 * MARGIN) / np.maximum(high - low, 1e-300)))
    middle = 0.5 * (low + high)

    def place(point: Array) -> Point:
        x, y = (point - middle) * scale
        return (WIDTH / 2.0 + float(x), HEIGHT / 2.0 - float(y))

    A, B = solution.A[index], solution.B[index]
    every = max(1, np.count_nonzero(good) // MOST_POINTS)
    parts = [_draw_path([place(point) for point in path[good][::every]], colour) for path, colour in paths]
    parts += [_draw_bar(place(start), place(end), BARS[n]) for n, start, end in ((2, O2, A), (3, A, B), (4, O4, B))]
    parts += [_draw_support(*place(O2)), _draw_support(*place(O4))]
    centre = np.mean([place(point) for point in (O2, A, B, O4)], axis=0)
    for name, point in (("O₂", O2), ("A", A), ("B", B), ("O₄", O4)):
        parts.append(_pin(name, place(point), (float(centre[0]), float(centre[1])), supported=name[0] == "O"))
    theta_2 = f"{math.degrees(solution.theta_2[index]):.1f}".replace("-", "−")
    parts.append(_draw_text(f"θ₂ = {theta_2}°", WIDTH / 2.0, HEIGHT - 6.0, 11, SOFT))
    box = f'viewBox="0 0 {WIDTH:g} {HEIGHT:g}"'
    return f'<svg class="linkage" xmlns="http://www.w3.org/2000/svg" {box}>{"".join(parts)}</svg>'


def _draw_path(points: Iterable[Point], colour: str) -> str:
    line = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-dasharray="2 3" opacity=".7"/>'


def _draw_bar(start: Point, end: Point, colour: str) -> str:
    line = 'x1="{:.1f}" y1="{:.1f}" x2="{:.1f}" y2="{:.1f}"'.format(*start, *end)
    return f'<line {line} stroke="{colour}" stroke-width="6" stroke-linecap="round"/>'


def _draw_support(x: float, y: float) -> str:
    return (
        f'<path d="M{x:.1f} {y:.1f}l-8 13h16z" fill="{PAPER}" stroke="{INK}"/>'
        f'<path d="M{x - 12:.1f} {y + 13:.1f}h24" stroke="{INK}"/>'
    )


def _draw_text(text: str, x: float, y: float, size: int, colour: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="middle" font-size="{size}" fill="{colour}">{text}</text>'


def _pin(name: str, at: Point, centre: Point, *, supported: bool) -> str:
    """Draw a pin, and its name on the side away from the middle of the linkage."""
    (x, y), (dx, dy) = at, (at[0] - centre[0], at[1] - centre[1])
    size = max(math.hypot(dx, dy), 1e-9)
    across, up = 15.0 * dx / size, 15.0 * dy / size
    if supported and up > 0.0:
        across, up = math.copysign(18.0, dx), 2.0  # clear of the support
    circle = f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{PAPER}" stroke="{INK}" stroke-width="1.5"/>'
    return circle + _draw_text(name, x + across, y + up + 4.0, 13, INK)
