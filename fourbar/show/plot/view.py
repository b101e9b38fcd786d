"""What a drawing shows: the sweep of a scene on one branch, and one position of it in detail."""

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fourbar.effects.actions import Actions, bodies
from fourbar.errors import NotAssembledError
from fourbar.evaluation.case import state_at
from fourbar.formulas.arithmetic import Number
from fourbar.formulas.motion import State
from fourbar.linkage import MOVING_BARS, PINS
from fourbar.scene import Command, Scene, command, require_input
from fourbar.scene.motion import FromLimit
from fourbar.solution import Array, Conversion, Solution
from fourbar.solve import solve

CLEAR = 0.3
"""Motion and drive condition of the position drawn, where any has them: next to a pole forces dwarf all others."""
LEAD = math.radians(60.0)
"""The position drawn where none is named: so far into the longest stretch that assembles, or half of a shorter one."""


@dataclass(slots=True)
class View:
    """A scene on one branch.

    `sweep` runs over theta_2 in rising order, `here` is the one position drawn to scale, `notes`
    collects what a caption has to say about the panels.
    """

    scene: Scene
    sweep: Solution
    here: Solution
    notes: list[str] = field(default_factory=list)
    units: Conversion = field(default_factory=dict)
    """Of the numbers drawn; what is left out has the SI unit with a prefix."""
    dimensions: bool = False
    """The lengths of the bars are written at them."""
    others: "list[View]" = field(default_factory=list)
    """The other branch, where it is drawn next to this one: to the same scales."""

    @property
    def alike(self) -> "list[View]":
        """List this view and those that share its scales."""
        return [self, *self.others]

    @property
    def degrees(self) -> Array:
        """theta_2 of the sweep, degrees."""
        return np.degrees(self.sweep.theta_2)

    @property
    def time(self) -> Array | None:
        """Of a motion given over time, s."""
        return self.sweep.time

    @property
    def at(self) -> str:
        """The position drawn, in words."""
        theta = f"θ₂ = {math.degrees(float(self.here.theta_2[0])):.4g}°"
        if self.here.time is None:
            return theta.replace("-", "−")
        return f"{theta}, t = {self.here.time[0]:.4g} s".replace("-", "−")

    @property
    def moves(self) -> bool:
        """Whether velocities, accelerations and forces were evaluated."""
        return self.sweep.omega_2 is not None

    @property
    def branch_name(self) -> str:
        """Return "open", "crossed", or "both signs" where the motion follows a smooth path through change points."""
        branch = self.sweep.branch
        return "open" if np.all(branch == 1) else "crossed" if np.all(branch == -1) else "both signs"

    def state(self) -> State:
        """Kinematics at the position drawn."""
        here = self.here
        alpha_2 = 0.0 if here.alpha_2 is None else here.alpha_2
        return state_at(self.scene, Command(here.theta_2, here.branch, here.omega_2, alpha_2))


def point_vectors(scene: Scene, solution: Solution, letter: str) -> dict[str, Array]:
    """Velocities ("v") or accelerations ("a") of A, B, the mass centres of bars that have mass, and own points."""
    drawn = ("A", "B", *(f"G{bar}" for bar in MOVING_BARS if scene.linkage.bar(bar).mass > 0.0))
    found = {name: getattr(solution, f"{letter}_{name}") for name in drawn}
    found |= solution.velocity if letter == "v" else solution.acceleration
    return {name: values for name, values in found.items() if values is not None}


def one(vector: Any) -> complex:
    """Return the one complex number of an array, at the position drawn."""
    return complex(np.ravel(vector)[0])


class Recorder(Actions):
    """Forces and couples that are kept one by one, each force with its arm, for a free-body diagram."""

    def __init__(self, scene: Scene, state: State) -> None:
        super().__init__(state, bodies(scene.linkage))
        self.arrows: list[tuple[int, complex, complex]] = []
        """Bar, force (N), and from the bar's first pin to where it acts (m)."""
        self.turns: list[tuple[int, float]] = []
        """Bar and couple, N m."""

    def force(self, bar: int, force: Number, arm: Number = 0.0j) -> None:
        """Add a force on a bar, applied at `arm` from the bar's first pin."""
        self.arrows.append((bar, one(force), one(arm)))

    def moment(self, bar: int, moment: Number) -> None:
        """Add a pure couple on a bar."""
        if bar != 1:
            self.turns.append((bar, one(moment).real))

    def couple(self, pin: str, couple: Number) -> None:
        """Add a couple on the second of the two bars that meet at a pin, and its opposite on the first."""
        first, second = PINS[pin]
        self.moment(second, couple)
        self.moment(first, -couple)


def over_time(scene: Scene) -> bool:
    """Whether the motion is one through time: released, or by a law."""
    return scene.motion.free is not None or scene.motion.law is not None


def sweep_command(scene: Scene) -> Command:
    """List the positions of a scene in rising theta_2; a single position is put among those of the default range."""
    motion = scene.motion
    own = command(scene)
    if len(own.theta_2) > 1:
        order = np.argsort(own.theta_2, kind="stable")
        return own._replace(angle=own.theta_2[order], branch=own.branch[order])
    assert motion.theta_2 is None or isinstance(motion.theta_2, (float, FromLimit, np.ndarray))
    wide = command(replace(scene, motion=replace(motion, theta_2=None)))
    # the same position may lie whole turns away from the default range
    turns = np.round((0.5 * (wide.theta_2[0] + wide.theta_2[-1]) - own.theta_2) / math.tau)
    theta_2, first = np.unique(np.concatenate([wide.theta_2, own.theta_2 + turns * math.tau]), return_index=True)
    return wide._replace(angle=theta_2, branch=np.concatenate([wide.branch, own.branch])[first])


def common_position(scenes: "list[Scene]") -> float | None:
    """Choose a position that shows each of several scenes over the same theta_2; None where each has its own."""
    if any(over_time(scene) for scene in scenes) or len(command(scenes[0]).theta_2) == 1:
        return None
    sweeps = [solve(scene, at=sweep_command(scene)) for scene in scenes]
    sweeps = [sweep for sweep in sweeps if sweep.assembled.any()]
    return representative(sweeps) if sweeps else None


def on_branch(scene: Scene, branch: int) -> Scene:
    """Put the same scene on the given branch."""
    return replace(scene, motion=replace(scene.motion, branch=branch))


def view(scene: Scene, position: float | None = None) -> View:
    """Evaluate the sweep of a scene, or its motion through time, and one position of it.

    Parameters
    ----------
    position : theta_2 drawn to scale, rad; left out: the scene's own where it names one (the start of
        a motion through time), else 60 deg into the longest stretch that assembles, clear of poles.

    Raises
    ------
    NotAssembledError : no position of the sweep assembles, or the one named does not.
    """
    require_input(scene, "a picture")
    if over_time(scene):
        return _through_time(scene, position)
    where = sweep_command(scene)
    sweep = solve(scene, at=where)
    _something(sweep)
    own = command(scene)
    if position is None:
        position = float(own.theta_2[0]) if len(own.theta_2) == 1 else representative([sweep])
    branch = np.array([where.branch[np.argmin(np.abs(where.theta_2 - position))]], dtype=np.int8)
    here = solve(scene, at=Command(np.array([position]), branch, own.omega_2, own.alpha_2))
    if not here.assembled[0]:
        raise NotAssembledError(f"the linkage does not assemble at theta_2 = {math.degrees(position):.6g} deg")
    return View(scene, sweep, here)


def _something(sweep: Solution) -> None:
    if not sweep.assembled.any():
        raise NotAssembledError("nothing to draw: the linkage assembles at none of the scene's positions")


def _through_time(scene: Scene, position: float | None) -> View:
    """Evaluate a motion; drawn is the instant that assembles first, or whose theta_2 comes nearest to the position."""
    sweep = solve(scene)
    _something(sweep)
    assert sweep.time is not None and sweep.omega_2 is not None and sweep.alpha_2 is not None
    if position is None:
        index = int(np.argmax(sweep.assembled))
    else:
        low, high = math.degrees(np.min(sweep.theta_2)), math.degrees(np.max(sweep.theta_2))
        if not low <= math.degrees(position) <= high:
            raise NotAssembledError(
                f"the motion does not pass theta_2 = {math.degrees(position):.6g} deg: it stays within "
                f"{low:.6g} and {high:.6g} deg"
            )
        index = int(np.argmin(np.abs(sweep.theta_2 - position)))
    one = slice(index, index + 1)
    here = solve(scene, at=Command(sweep.theta_2[one], sweep.branch[one], sweep.omega_2[one], sweep.alpha_2[one]))
    here.time = sweep.time[one]
    shown = View(scene, sweep, here)
    if sweep.stopped_at is not None:
        shown.notes.append(f"The linkage stops at a limit position at t = {sweep.stopped_at:.4g} s.")
    return shown


def representative(sweeps: "list[Solution]") -> float:
    """Choose a position, the same for all sweeps, that shows the bars apart; well conditioned where one is."""
    ends = np.flatnonzero(np.diff(np.concatenate([[False], sweeps[0].assembled, [False]]).astype(int))).reshape(-1, 2)
    run = slice(*ends[int(np.argmax(ends[:, 1] - ends[:, 0]))])
    theta_2 = sweeps[0].theta_2[run]
    quality = np.full(len(theta_2), np.inf)
    for sweep in sweeps:
        for condition in (sweep.condition, sweep.drive_condition):
            if condition is not None:
                quality = np.minimum(quality, np.nan_to_num(condition[run]))
    good = quality >= min(CLEAR, float(quality.max()))
    target = theta_2[0] + min(LEAD, 0.5 * (theta_2[-1] - theta_2[0]))
    return float(theta_2[good][np.argmin(np.abs(theta_2[good] - target))])
