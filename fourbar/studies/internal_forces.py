"""Internal forces of a bar along the line between its two pins.

Normal force, shear force and bending moment are meant. With x from the first pin (O2,
A, O4) towards the second and y to the left of it, over all that acts at or before x,
inertia (d'Alembert) and weight included:

    N(x) = -sum F_x  (tension > 0),
    V(x) = sum F_y,
    M(x) = sum (F_y (x - x_i)) - sum of the couples  (ccw > 0).

A force beside the line acts at its foot on it, together with its couple about that
foot.
"""

from typing import Any, NamedTuple

import numpy as np

from fourbar.effects.effect import Actions, list_bodies
from fourbar.errors import InputError, expect
from fourbar.evaluation.case import Case
from fourbar.formulas.arithmetic import cross, polar, vector
from fourbar.formulas.motion import State
from fourbar.linkage import ENDS, PIN_FORCE, PINS, require_bar, require_numbers
from fourbar.quantities import Array
from fourbar.scene import Scene
from fourbar.solution import Solution

_STATIONS = 41
"""Equal stations, where none are given."""
SAME_FOOT = 1e-9
"""Part of the bar's length within which two feet are one. A load and the inertia, both
at G, differ by round-off.
"""


class Bending(NamedTuple):
    """Largest bending moment of a bar at each position."""

    moment: Array
    """Signed, N m, (n,)."""
    x: Array
    """Place of the moment along the bar, m, (n,)."""


class InternalForces(NamedTuple):
    """Result of `internal_forces`; NaN at positions without forces."""

    x: Array
    """Stations from the first pin along the line between the bar's pins, m, (k,)."""
    N: Array
    """Normal force, tension > 0, N, (n, k)."""
    V: Array
    """Shear force, N, (n, k)."""
    M: Array
    """Bending moment, N m, (n, k)."""
    uniform: bool
    """True if weight and inertia are spread as those of a uniform slender bar.
    Otherwise they act at G.
    """
    largest: Bending
    """Largest |M| of all x, on both sides of every foot and where V = 0."""


def internal_forces(
    scene: Scene,
    solution: Solution,
    bar: int,
    stations: Array | None = None,
) -> InternalForces:
    """Compute the internal forces of a moving bar.

    A bar counts as uniform where its inertia and centre are left out; the weight and
    inertia of any other act at G, its rotary inertia as a couple there. A load's couple
    acts at its place, the drive's at the bar's ground pin (of bar 3 at A), the couples
    of effects at their pins.

    Parameters
    ----------
    solution : of the scene, up to the forces.
    bar : 2, 3 or 4.
    stations : x, m, (k,); left out: 41 equal ones from pin to pin, and beyond as far
        as anything acts.
    """
    expect("scene", scene, Scene)
    expect("solution", solution, Solution)
    bar = require_bar("bar", bar)
    if solution.F12 is None:
        raise InputError(
            "solution", "F12", "was not evaluated: solve up to the stage 'force'"
        )
    if solution.theta_2.ndim != 1:
        raise InputError("solution", "a study", "must be of one scene: take one member")
    beam = _Beam(scene, solution, bar)
    feet = beam.foot[solution.assembled]
    first = np.nanmin(feet, initial=0.0)
    last = np.nanmax(feet, initial=beam.length)
    x = np.linspace(first, last, _STATIONS)
    if stations is not None:
        x = np.atleast_1d(
            require_numbers("stations", stations, "must be finite lengths", "m")
        )
    rows = np.broadcast_to(x, (len(solution), len(x)))
    return InternalForces(x, *beam.at(rows), beam.uniform, beam.find_largest())


def largest_bending(scene: Scene, solution: Solution, bar: int) -> Bending:
    """Compute the largest bending moment of a moving bar at each position."""
    return _Beam(scene, solution, bar).find_largest()


class _Beam:
    """Forces and couples on a bar, by their feet on its line.

    The load that inertia and weight of a uniform bar spread over the line is included.
    """

    @np.errstate(all="ignore")
    def __init__(self, scene: Scene, solution: Solution, bar: int) -> None:
        described = scene.linkage.bar(bar)
        self.length = described.length
        self.uniform = described.inertia is None and described.centre is None
        self.density = described.mass / self.length if self.uniform else 0.0
        """Mass per length of a uniform bar, kg/m; otherwise 0."""
        zero = np.zeros(len(solution))
        omega = zero + solution[f"omega_{bar}"]
        alpha = zero + solution[f"alpha_{bar}"]
        spread = "gravity" if self.uniform else ""
        recorder = record_acting(scene, solution, bar, spread)
        gravity = 0.0j
        effects: tuple[Any, ...] = scene.effects
        for effect in effects:
            if effect.key == spread:
                gravity = gravity + effect.field
            if bar in effect.added_inertia:  # a flywheel turns about the ground pin
                recorder.couple(bar, -effect.added_inertia[bar] * alpha)
        back = np.conj(recorder.state.direction(bar))
        pull = (vector(*solution.a_A.T) if bar == 3 else zero) - gravity
        of_mass = -described.mass * (vector(*solution[f"a_G{bar}"].T) - gravity)
        of_inertia = -described.moment_of_inertia * alpha
        recorder.record(described.to_centre, of_mass * back, of_inertia)
        supports = _support(recorder, solution)
        if self.uniform:
            recorder.items.pop()
        columns = []
        for _, _, place, force, couple in recorder.items + supports:
            # with the couple of a force beside the line
            beside = couple + cross(-force, 1j * np.imag(place))
            columns.append(np.broadcast_arrays(np.real(place), force, beside, zero))
        self.foot, self.force, self.couple, _ = (
            np.stack(column, axis=1) for column in zip(*columns, strict=True)
        )
        """Feet, m, forces x + i y in the bar's axes, N, and couples, N m, (n, f)."""
        self.pull = (pull * back)[:, None]
        """Acceleration of the first pin less gravity, in the bar's axes, (n, 1)."""
        self.omega = omega[:, None]
        self.alpha = alpha[:, None]

    def at(self, x: Array, side: float = 1.0) -> tuple[Array, Array, Array]:
        """Compute N, V, M at x, (n, k).

        `side`: -1: without what acts at x itself.
        """
        foot = self.foot[:, :, None]
        acts = foot < (x + side * SAME_FOOT * self.length)[:, None]
        force = np.where(acts, self.force[:, :, None], 0.0)
        couple = np.where(acts, self.couple[:, :, None], 0.0)
        s = np.clip(x, 0.0, self.length)
        across = self.pull.imag
        alpha = self.alpha
        stretched = self.density * s * (self.pull.real - 0.5 * self.omega**2 * s)
        sheared = -self.density * s * (across + 0.5 * alpha * s)
        bent = -self.density * np.square(s) * (0.5 * across + alpha * s / 6.0)
        bent = bent + sheared * np.maximum(x - self.length, 0.0)
        moments = force.imag * (x[:, None] - foot) - couple
        return (
            (0.0 - force.real.sum(axis=1)) + stretched,
            force.imag.sum(axis=1) + sheared,
            moments.sum(axis=1) + bent,
        )

    def find_largest(self) -> Bending:
        """Find the largest |M|: at a foot, on either side of it, or where V = 0."""
        ends = np.broadcast_to([0.0, self.length], (len(self.foot), 2))
        feet = np.sort(np.concatenate([self.foot, ends], axis=1), axis=1)
        places = [feet, feet]
        moments = [self.at(feet)[2], self.at(feet, -1.0)[2]]
        if self.density > 0.0:
            across = self.pull.imag
            bend = 0.5 * self.alpha
            spread = feet * (across + bend * feet)
            single = self.at(feet)[1] / self.density + spread  # forces at feet only
            inside = np.clip(feet, 0.0, self.length)
            after = np.append(inside[:, 1:], inside[:, -1:], axis=1)
            # where V = 0, without cancellation; NaN where it is nowhere
            with np.errstate(all="ignore"):
                root = np.sqrt(across * across + 4.0 * bend * single)
                q = -0.5 * (across + np.copysign(root, across))
                roots = q / bend, -single / q
            for root in roots:
                places.append(np.clip(np.nan_to_num(root), inside, after))
                moments.append(self.at(places[-1])[2])
        x = np.concatenate(places, axis=1)
        M = np.concatenate(moments, axis=1)
        # where one is NaN, that one counts as the largest
        worst = np.arange(len(M)), np.argmax(np.abs(M), axis=1)
        moment = np.where(np.isfinite(M[worst]), M[worst], np.nan)
        return Bending(moment, np.where(np.isfinite(moment), x[worst], np.nan))


class Acting(NamedTuple):
    """A force or a couple on a bar, in the bar's axes."""

    term: int
    """Index of the load or effect, loads first; -1: the drive."""
    pin: str
    """Pin at which a couple acts between two bars; empty for anything else."""
    place: Any
    """Place from the bar's first pin, complex, m."""
    force: Any
    """Complex, N."""
    couple: Any
    """N m."""


class _Recorder(Actions):
    """Forces and couples on one bar, each where it acts."""

    def __init__(self, state: State, scene: Scene, bar: int) -> None:
        super().__init__(state, list_bodies(scene.linkage))
        self.bar, self.length = bar, scene.linkage.bar(bar).length
        self.items: list[Acting] = []
        self.term = -1
        """Index of what acts at present."""
        self.place: Any = 0.0j
        """Point in the bar's axes where a pure couple acts."""

    def record(self, place: Any, force: Any, couple: Any, pin: str = "") -> None:
        """Record a force or a couple in the bar's axes."""
        self.items.append(Acting(self.term, pin, place, force, couple))

    def force(
        self,
        bar: int,
        force: Any,
        point: Any = 0.0j,
        beyond: Any = None,
    ) -> None:
        """Record a force on the bar, world axes."""
        if bar == self.bar:
            back = np.conj(self.state.direction(bar))
            place = point if beyond is None else point + beyond * back
            self.record(place, force * back, 0.0)

    def couple(self, bar: int, moment: Any) -> None:
        """Record a couple on the bar."""
        if bar == self.bar:
            self.record(self.place, 0.0j, moment)

    def pin_couple(self, pin: str, couple: Any) -> None:
        """Record a couple between two bars at their pin."""
        if self.bar in PINS[pin]:
            place = 0.0j if pin == ENDS[self.bar][0] else self.length + 0.0j
            sign = 1.0 if self.bar == PINS[pin][1] else -1.0
            self.record(place, 0.0j, sign * couple, pin)

    def pull(self, start: Any, end: Any, force: Any) -> None:
        """Record both forces where they act.

        Between bars that meet it matters too, inside a bar.
        """
        self.pull_ends(start, end, force)


@np.errstate(all="ignore")
def record_acting(
    scene: Scene,
    solution: Solution,
    bar: int,
    left_out: str = "",
) -> _Recorder:
    """Record what acts on a bar at each position, apart from its pins and its inertia.

    `left_out`: key of an effect that is left out.
    """
    G = scene.linkage.bar(bar).to_centre
    case = Case.of(scene, solution.at.bar).begin_with(solution.at)
    state = case.at(solution.at)
    recorder = _Recorder(state, scene, bar)
    if scene.motion.free is None:
        if solution.drive is not None:
            solution.drive.act(recorder, solution.drive_force)
        elif scene.drive_bar == bar:
            recorder.couple(bar, solution.torque)  # at the bar's first pin
    pin_forces = {name: solution[name] for name in PIN_FORCE.values()}
    terms: tuple[Any, ...] = case.terms
    for index, term in enumerate(terms):
        if term.key == left_out:
            continue
        recorder.term = index
        if term.key == "load" and term.bar == bar:
            recorder.place = term.foot(G)
            if term.arm is not None:
                back = np.conj(state.direction(bar))
                recorder.place = recorder.place + polar(*term.arm) * back
        term.act(recorder, state)
        recorder.place = 0.0j
        term.act_known(recorder, pin_forces)
    return recorder


def _support(recorder: _Recorder, solution: Solution) -> list[Acting]:
    """Return the forces at both pins of a bar.

    Along the bar the pin forces of the solution are taken. Across it the reactions are
    those of a beam on two supports, by the moments of all else about the other pin:

        F_y (x - x_other) = -sum(moments about the other pin).

    Beside a pole of the drive the part along a bar without drive may be any number of
    times larger than all that bends it. Its rounding must not enter M.

    `recorder`: with all else that acts on the bar, weight and inertia at G too.
    """
    back = np.conj(recorder.state.direction(recorder.bar))
    ends = (0.0, recorder.length)
    supports = []
    for pin, x, x_other in zip(ENDS[recorder.bar], ends, ends[::-1], strict=True):
        name = PIN_FORCE[pin]
        sign = 1.0 if name[2] == str(recorder.bar) else -1.0
        along = (sign * vector(*solution[name].T) * back).real
        moments = 0.0
        for _, _, place, force, couple in recorder.items:
            moments = moments + cross(place - x_other, force) + couple
        across = np.where(np.isfinite(along), -moments / (x - x_other), np.nan)
        supports.append(Acting(-1, pin, x, along + 1j * across, 0.0))
    return supports
