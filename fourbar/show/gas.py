"""Where the ends of gas springs are farther apart, or nearer, than their stroke allows.

The force goes on along the same line there; the answer is then one of a spring that
does not exist.
"""

import numpy as np

from fourbar.effects import Spring, Springs
from fourbar.evaluation.case import compute_state
from fourbar.scene import Scene, command_at
from fourbar.show.units import write_short
from fourbar.solution import Array, Conversion, Solution
from fourbar.solving import solve

AT_END = 1e-6
"""Part of a gas spring's length within which it is at its end. A scene that states the
end as a place has fewer digits than that.
"""
HALVINGS = 40
"""Halvings of a step of the sweep: an end is then located to a double's digits."""


def list_gas_notes(scene: Scene, solution: Solution, units: Conversion) -> list[str]:
    """List from where and up to where each gas spring is beyond its stroke.

    `units`: units of the numbers; one that is left out is the SI unit with a prefix.
    """
    notes = []
    for number, spring in enumerate(_list_springs(scene), 1):
        if spring.stroke is None:
            continue
        shortest = spring.length - spring.stroke
        room = AT_END * spring.length
        for sign, end, word in (
            (1.0, spring.length, "longer than its extended length of"),
            (-1.0, shortest, "shorter than its compressed length of"),
        ):
            stretches = _list_stretches(scene, solution, number - 1, sign, end, room)
            if not stretches:
                continue
            length = write_short(end, "m", units)
            where = " and ".join(
                _write_stretch(solution, stretch, units) for stretch in stretches
            )
            notes.append(
                f"spring {number}, a gas spring, is {word} {length} {where}: it is"
                " taken to push on, and has no stops"
            )
    return notes


def _list_springs(scene: Scene) -> list[Spring]:
    """List the springs of a scene in the order of its file."""
    springs = list[Spring]()
    for effect in scene.settled().effects:
        if isinstance(effect, Springs):
            springs += effect.springs
    return springs


def _measure(scene: Scene, solution: Solution, index: int) -> Array:
    """Measure how far the ends of a spring are apart at each position, m."""
    state = compute_state(scene, solution.at)
    spring = _list_springs(scene)[index]
    across = spring.end.locate(state) - spring.start.locate(state)
    distance = np.broadcast_to(np.abs(across), solution.assembled.shape)
    return np.where(solution.assembled, distance, np.nan)


Stretch = tuple[float | None, float | None]
"""Places of the start and of the end; None: the motion begins or ends within."""


def _list_stretches(
    scene: Scene, solution: Solution, index: int, sign: float, end: float, room: float
) -> list[Stretch]:
    """List where a spring is beyond one of its ends."""
    with np.errstate(invalid="ignore"):
        beyond = sign * (_measure(scene, solution, index) - end) > room
    places = solution.at.places if solution.time is None else solution.time
    stretches, start = list[Stretch](), None
    for row in range(len(beyond)):
        if row and beyond[row] != beyond[row - 1]:
            place = float(places[row])
            if (
                scene.motion.free is None
                and solution.assembled[row - 1 : row + 1].all()
            ):
                low, high = float(places[row - 1]), place
                place = _locate(scene, index, sign, end, low, high)
            if beyond[row]:
                start = place
            else:
                stretches.append((start, place))
                start = None
    if beyond[-1]:
        stretches.append((start, None))
    return stretches


def _locate(
    scene: Scene, index: int, sign: float, end: float, low: float, high: float
) -> float:
    """Find between two positions where a spring reaches one of its ends."""

    def is_beyond(place: float) -> bool:
        one = solve(scene, "position", at=command_at(scene, np.array([place])))
        return bool(sign * (_measure(scene, one, index)[0] - end) > 0.0)

    at_low = is_beyond(low)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if is_beyond(middle) == at_low:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def _write_stretch(solution: Solution, stretch: Stretch, units: Conversion) -> str:
    """Write a stretch as "from theta_2 = 61.2 deg on"."""
    start, stop = stretch
    if solution.time is not None:
        name, unit = "t", "s"
    else:
        name = solution.commanded
        unit = "rad" if solution.at.stroke is None else "m"
    if start is None and stop is None:
        return "here" if len(solution) == 1 else "throughout"
    ends = [
        "" if place is None else f"{name} = {write_short(place, unit, units)}"
        for place in stretch
    ]
    if start is None:
        return f"up to {ends[1]}"
    if stop is None:
        return f"from {ends[0]} on"
    return f"from {ends[0]} to {ends[1]}"
