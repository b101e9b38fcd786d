"""Invariants of the mechanics over random linkages.

A symmetry or a second derivation, never the formula again.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st

import fourbar
from fourbar.effects import Gravity, Load, Viscous
from fourbar.linkage import MOVING_BARS, Bar, FourBar
from fourbar.scene import Scene
from fourbar.scene.motion import Motion
from fourbar.solution import Solution
from tests.support.scenes import change_place, mirrored

WORST_CONDITION = 0.2
"""Sines below this are drawn elsewhere: here every relation must hold to round-off."""
ROUND_OFF = 100.0 * 2.0**-52 / WORST_CONDITION**3
"""Two methods of fifty roundings each, divided by the motion condition squared and the
drive condition: 2.8e-12.
"""
EXAMPLES = settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow],
)
"""The same examples on every run: what is new is looked for by fuzzing."""
FORCES = ("F12", "F32", "F43", "F14")
_KITE = FourBar(1.0, Bar(1.0), Bar(0.5160425119921928), Bar(0.5160425119921928))
"""Ground and input are equal, and so are coupler and output."""


def between(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False)


@st.composite
def scenes(draw: st.DrawFn, effects: bool = True) -> Scene:
    """Lengths from the angles of the triangle A, B, O4.

    Every scene then assembles with a known condition.
    """
    d, a, psi = (
        draw(between(0.1, 1.0)),
        draw(between(0.1, 1.0)),
        draw(between(-3.1, 3.1)),
    )
    e = abs(d - a * complex(math.cos(psi), math.sin(psi)))
    assume(e > 0.05)
    mu = draw(
        between(
            math.asin(WORST_CONDITION) + 0.01,
            math.pi - math.asin(WORST_CONDITION) - 0.01,
        )
    )
    beta = draw(between(0.1, 0.9)) * (math.pi - mu)
    b, c = (
        e * math.sin(math.pi - mu - beta) / math.sin(mu),
        e * math.sin(beta) / math.sin(mu),
    )
    bars = []
    for length in (a, b, c):
        mass, k = draw(between(0.0, 5.0)), draw(between(0.01, 0.5))
        bars.append(
            Bar(
                length,
                mass,
                mass * length**2 * k,
                (length * draw(between(-0.5, 1.5)), draw(between(-3, 3))),
            )
        )
    loads = [draw_load(draw) for _ in range(draw(st.integers(0, 2)) if effects else 0)]
    terms = []
    if effects and draw(st.booleans()):
        terms.append(Gravity(9.81, draw(between(-3, 3))))
    if effects and draw(st.booleans()):
        terms.append(
            Viscous.at(
                O2=draw(between(0, 1)),
                B=draw(between(0, 1)),
                O4=draw(between(0, 1)),
            )
        )
    omega = draw(st.sampled_from([-1.0, 1.0])) * draw(between(0.5, 20.0))
    theta_1 = draw(between(-3, 3))
    motion = Motion(
        theta_1 + psi, omega, draw(between(-50, 50)), draw(st.sampled_from([-1, 1]))
    )
    scene = Scene(
        FourBar(d, *bars, theta_1),
        motion,
        draw(st.sampled_from(MOVING_BARS)),
        tuple(loads),
        tuple(terms),
    )
    solution = fourbar.solve(scene, "force")
    assume(
        solution.drive_condition is not None
        and solution.drive_condition[0] >= WORST_CONDITION
    )
    return scene


def draw_load(draw: Any) -> Load:
    """A force at a place of any form, and a couple.

    The direction of the force is fixed or turns.
    """
    frame = draw(st.sampled_from(["world", "bar"]))
    forms = ["from_pin", "from_centre", *(["arm"] if frame == "world" else [])]
    at = {draw(st.sampled_from(forms)): (draw(between(0, 0.5)), draw(between(-3, 3)))}
    return Load(
        draw(st.sampled_from(MOVING_BARS)),
        (draw(between(-20, 20)), draw(between(-3, 3))),
        moment=draw(between(-5, 5)),
        frame=frame,
        **at,
    )


def arm_from_G(scene: Scene, s: fourbar.Solution, load: Load) -> Any:
    """The vector from G to where a load acts, world axes."""

    def vector(r: float, phi: float) -> Any:
        return r * np.array([math.cos(phi), math.sin(phi)])

    turn = float(getattr(s, f"theta_{load.bar}")[0])
    if load.arm is not None:
        return vector(*load.arm)
    if load.from_centre is not None:
        r, phi = load.from_centre
        return vector(r, phi + turn)
    r, phi = load.from_pin
    G, psi = scene.linkage.bar(load.bar).mass_centre
    return vector(r, phi + turn) - vector(G, psi + turn)


def force_size(scene: Scene, solution: Solution) -> float:
    """Sum of the magnitudes of everything that acts, N.

    What the forces are rounded by.
    """
    size = sum(float(np.hypot(*getattr(solution, name)[0])) for name in FORCES)
    for bar in MOVING_BARS:
        part = scene.linkage.bar(bar)
        size += part.mass * (float(np.hypot(*getattr(solution, f"a_G{bar}")[0])) + 9.81)
    size += sum(abs(load.force[0]) for load in scene.loads if load.force)
    return size + torque_size(scene, solution, 0.0) / min(scene.linkage.lengths)


def torque_size(scene: Scene, solution: Solution, size: float) -> float:
    """Sum of the magnitudes of all moments, N m; `size` is that of the forces."""
    longest = max(
        *scene.linkage.lengths,
        *(abs(scene.linkage.bar(bar).mass_centre[0]) for bar in MOVING_BARS),
        0.5,
    )
    couples = abs(float(solution.torque[0])) + sum(
        abs(load.moment) for load in scene.loads
    )
    for bar in MOVING_BARS:
        couples += scene.linkage.bar(bar).moment_of_inertia * abs(
            float(getattr(solution, f"alpha_{bar}")[0])
        )
    for effect in scene.effects:
        if isinstance(effect, Viscous):
            speeds = sum(
                abs(float(getattr(solution, f"omega_{bar}")[0])) for bar in MOVING_BARS
            )
            couples += 3.0 * speeds
    return couples + longest * size


def same_forces(
    scene: Scene,
    ours: Solution,
    theirs: dict[str, np.ndarray],
    torque: float,
    factor: float = 1.0,
) -> None:
    """Forces and torque of `ours` equal those given.

    They are in units of everything that acts.
    """
    size = force_size(scene, ours)
    for name, expected in theirs.items():
        assert (
            np.abs(getattr(ours, name)[0] - expected).max() <= factor * ROUND_OFF * size
        ), name
    assert abs(float(ours.torque[0]) - torque) <= factor * ROUND_OFF * torque_size(
        scene, ours, size
    )


def forces(solution: Solution) -> dict[str, np.ndarray]:
    return {name: getattr(solution, name)[0] for name in FORCES}


@EXAMPLES
@given(scenes())
def test_the_loop_closes(scene: Scene) -> None:
    s, link = fourbar.solve(scene), scene.linkage
    d, a, b, c = link.lengths
    loop = (
        a * np.exp(1j * s.theta_2)
        + b * np.exp(1j * s.theta_3)
        - c * np.exp(1j * s.theta_4)
    )
    assert abs(loop[0] - d * np.exp(1j * link.ground_angle)) <= ROUND_OFF * sum(
        link.lengths
    )
    assert np.sign(np.sin(s.theta_4 - s.theta_3))[0] == scene.motion.branch


@EXAMPLES
@given(scenes())
def test_power_balance(scene: Scene) -> None:
    """T omega_k + power of loads and effects = d/dt of the kinetic energy.

    It follows from points and speeds alone.
    """
    s = fourbar.solve(scene)
    w = {1: 0.0} | {bar: float(getattr(s, f"omega_{bar}")[0]) for bar in MOVING_BARS}
    power = float(s.torque[0]) * w[scene.drive_bar]
    terms = abs(power)
    velocity = {}
    A = s.A[0]

    def spin(omega: float, arm: np.ndarray) -> np.ndarray:
        return omega * np.array([-arm[1], arm[0]])

    d, theta_1 = scene.linkage.ground, scene.linkage.ground_angle
    foot = {
        2: np.zeros(2),
        3: A,
        4: d * np.array([math.cos(theta_1), math.sin(theta_1)]),
    }
    base = {2: np.zeros(2), 3: spin(w[2], A), 4: np.zeros(2)}
    for bar in MOVING_BARS:
        part, G = scene.linkage.bar(bar), getattr(s, f"G{bar}")[0]
        velocity[bar] = base[bar] + spin(w[bar], G - foot[bar])
        gain = part.mass * velocity[bar] @ getattr(s, f"a_G{bar}")[0]
        turn = part.moment_of_inertia * w[bar] * float(getattr(s, f"alpha_{bar}")[0])
        power -= gain + turn
        terms += abs(gain) + abs(turn)
    for load in scene.loads:
        turn = float(getattr(s, f"theta_{load.bar}")[0]) if load.frame == "bar" else 0.0
        force = load.force[0] * np.array(
            [math.cos(load.force[1] + turn), math.sin(load.force[1] + turn)]
        )
        arm = arm_from_G(scene, s, load)
        given_power = (
            force @ (velocity[load.bar] + spin(w[load.bar], arm))
            + load.moment * w[load.bar]
        )
        power += given_power
        terms += abs(load.force[0]) * float(
            np.hypot(*velocity[load.bar]) + abs(w[load.bar]) * 0.5
        ) + abs(load.moment * w[load.bar])
    for effect in scene.effects:
        if isinstance(effect, Gravity):
            pull = effect.magnitude * np.array(
                [math.cos(effect.angle), math.sin(effect.angle)]
            )
            for bar in MOVING_BARS:
                power += scene.linkage.bar(bar).mass * pull @ velocity[bar]
                terms += (
                    scene.linkage.bar(bar).mass * 9.81 * float(np.hypot(*velocity[bar]))
                )
        else:
            assert isinstance(effect, Viscous)
            for pin, k in effect.coefficients:
                i, j = {"O2": (1, 2), "A": (2, 3), "B": (3, 4), "O4": (1, 4)}[pin]
                power -= k * (w[j] - w[i]) ** 2
                terms += k * (abs(w[j]) + abs(w[i])) ** 2
    assert abs(power) <= ROUND_OFF * terms


@EXAMPLES
@given(scenes())
def test_ground_carries_what_acts_and_what_accelerates(scene: Scene) -> None:
    """F12 + F14 + loads + weights = sum of m a_G: internal forces are gone."""
    s = fourbar.solve(scene)
    total = s.F12[0] + s.F14[0]
    for load in scene.loads:
        turn = float(getattr(s, f"theta_{load.bar}")[0]) if load.frame == "bar" else 0.0
        total = total + load.force[0] * np.array(
            [math.cos(load.force[1] + turn), math.sin(load.force[1] + turn)]
        )
    for bar in MOVING_BARS:
        mass = scene.linkage.bar(bar).mass
        total = total - mass * getattr(s, f"a_G{bar}")[0]
        for effect in scene.effects:
            if isinstance(effect, Gravity):
                total = total + mass * effect.magnitude * np.array(
                    [math.cos(effect.angle), math.sin(effect.angle)]
                )
    assert np.abs(total).max() <= ROUND_OFF * force_size(scene, s)


@EXAMPLES
@given(scenes())
def test_mirror_symmetry(scene: Scene) -> None:
    """Mirrored in the x-axis.

    Angles, couples and speeds change sign, so do y-components and the branch.
    """
    ours, of_mirrored = fourbar.solve(scene), fourbar.solve(mirrored(scene))
    flipped = {name: value * (1.0, -1.0) for name, value in forces(of_mirrored).items()}
    same_forces(scene, ours, flipped, -float(of_mirrored.torque[0]))
    assert (
        abs(math.remainder(float(ours.theta_4[0] + of_mirrored.theta_4[0]), math.tau))
        <= ROUND_OFF
    )


@EXAMPLES
@given(scenes(), st.integers(-20, 20), st.integers(-20, 20), st.integers(-20, 20))
def test_length_mass_and_time_scale(
    scene: Scene,
    length: int,
    mass: int,
    time: int,
) -> None:
    """By powers of two, which round nothing.

    Forces scale as m L/t^2, torques as m L^2/t^2.
    """
    L, M, T = 2.0**length, 2.0**mass, 2.0**time
    force, torque = M * L / T**2, M * L * L / T**2
    link, m = scene.linkage, scene.motion

    def bar(old: Bar) -> Bar:
        return Bar(
            old.length * L,
            old.mass * M,
            old.moment_of_inertia * M * L * L,
            (old.mass_centre[0] * L, old.mass_centre[1]),
        )

    scaled = replace(
        scene,
        linkage=FourBar(
            link.ground * L,
            bar(link.input),
            bar(link.coupler),
            bar(link.output),
            link.ground_angle,
        ),
        motion=m.replace(speed=m.omega_2 / T, acceleration=m.alpha_2 / T**2),
        loads=tuple(
            replace(
                load,
                force=(load.force[0] * force, load.force[1]),
                moment=load.moment * torque,
                **change_place(load, lambda r, phi: (r * L, phi)),
            )
            for load in scene.loads
        ),
        effects=tuple(
            (
                replace(e, magnitude=e.magnitude * L / T**2)
                if isinstance(e, Gravity)
                else Viscous(
                    tuple((pin, k * M * L * L / T) for pin, k in e.coefficients)
                )
            )
            for e in scene.effects
        ),
    )
    ours, of_scaled = fourbar.solve(scene), fourbar.solve(scaled)
    back = {name: value / force for name, value in forces(of_scaled).items()}
    same_forces(scene, ours, back, float(of_scaled.torque[0]) / torque)


@EXAMPLES
@given(scenes(effects=False), between(0.01, 100.0))
def test_forces_go_as_the_speed_squared(scene: Scene, times: float) -> None:
    """No loads, no gravity, constant omega_2."""
    slow = replace(scene, motion=scene.motion.replace(acceleration=0.0))
    fast = replace(slow, motion=slow.motion.replace(speed=times * slow.motion.omega_2))
    ours, of_fast = fourbar.solve(slow), fourbar.solve(fast)
    back = {name: value / times**2 for name, value in forces(of_fast).items()}
    same_forces(slow, ours, back, float(of_fast.torque[0]) / times**2)


@EXAMPLES
@given(scenes())
def test_time_reversal(scene: Scene) -> None:
    """Backwards through the same position.

    The same forces, without what depends on the sense of motion.
    """
    still = replace(
        scene,
        effects=tuple(e for e in scene.effects if isinstance(e, Gravity)),
    )
    back = replace(still, motion=still.motion.replace(speed=-still.motion.omega_2))
    ours, of_back = fourbar.solve(still), fourbar.solve(back)
    same_forces(still, ours, forces(of_back), float(of_back.torque[0]))
    assert float(ours.omega_4[0]) == -float(of_back.omega_4[0])


@EXAMPLES
@given(scenes(), between(-3, 3))
def test_frame_rotation(scene: Scene, turn: float) -> None:
    """The whole scene turned: forces turn with it, the torque stays."""
    link, m = scene.linkage, scene.motion
    turned = replace(
        scene,
        linkage=replace(link, ground_angle=link.ground_angle + turn),
        motion=m.replace(angle=float(m.theta_2) + turn),
        loads=tuple(
            (
                load
                if load.frame == "bar"
                else replace(
                    load,
                    force=(load.force[0], load.force[1] + turn),
                    arm=load.arm and (load.arm[0], load.arm[1] + turn),
                )
            )
            for load in scene.loads
        ),
        effects=tuple(
            replace(e, angle=e.angle + turn) if isinstance(e, Gravity) else e
            for e in scene.effects
        ),
    )
    ours, of_turned = fourbar.solve(scene), fourbar.solve(turned)
    cosine, sine = math.cos(turn), math.sin(turn)
    matrix = np.array([[cosine, sine], [-sine, cosine]])
    # theta_1, theta_2 and their turn are rounded: some 10 eps of angle on top
    same_forces(
        scene,
        ours,
        {k: matrix @ v for k, v in forces(of_turned).items()},
        float(of_turned.torque[0]),
        factor=shape(scene),
    )


@EXAMPLES
@given(scenes())
@example(Scene(_KITE, Motion(0.5, -1.0, branch=-1)))
def test_relabelled_from_the_other_end(scene: Scene) -> None:
    """Bars 2 and 4 exchanged, the ground turned end for end.

    The same forces under their other names.
    """
    s, link = fourbar.solve(scene), scene.linkage
    theta_1 = link.ground_angle + math.pi
    b = link.coupler

    # the coupler's first pin is now B: G from there, along the line from B to A
    def place_from_B(r: float, phi: float) -> tuple[float, float]:
        return b.length - r * math.cos(phi), -r * math.sin(phi)

    x, y = place_from_B(*b.mass_centre)
    coupler = replace(b, centre=(math.hypot(x, y), math.atan2(y, x)))
    names = {2: 4, 3: 3, 4: 2}

    def relabelled(load: Load) -> Load:
        if load.bar != 3:
            return replace(load, bar=names[load.bar])
        # the bar's line points in the opposite direction, from its other end
        size, direction = load.force
        if load.frame == "bar":
            direction += math.pi
        if load.from_centre is not None:
            r, phi = load.from_centre
            return replace(
                load,
                force=(size, direction),
                from_centre=(r, phi + math.pi),
            )
        if load.from_pin is not None:
            x, y = place_from_B(*load.from_pin)
            at = (math.hypot(x, y), math.atan2(y, x))
            return replace(load, force=(size, direction), from_pin=at)
        return load

    pins = {"O2": "O4", "A": "B", "B": "A", "O4": "O2"}
    ends = FourBar(link.ground, link.output, coupler, link.input, theta_1)
    other_end = Scene(
        ends,
        Motion(
            float(s.theta_4[0]),
            float(s.omega_4[0]),
            float(s.alpha_4[0]),
            _branch_from_the_other_end(ends, s),
        ),
        names[scene.drive_bar],
        tuple(relabelled(load) for load in scene.loads),
        tuple(
            (
                Viscous.at(**{pins[pin]: k for pin, k in e.coefficients})
                if isinstance(e, Viscous)
                else e
            )
            for e in scene.effects
        ),
    )
    # bars 2, 3 must be as far from collinear as bars 3, 4
    back = abs(math.sin(float(s.theta_3[0] - s.theta_2[0])))
    assume(back >= WORST_CONDITION)
    o = fourbar.solve(other_end)
    # F32 at A is now F34 = -F43, F43 at B is F23 = -F32
    exchanged = {"F12": o.F14[0], "F14": o.F12[0], "F32": -o.F43[0], "F43": -o.F32[0]}
    # omega_4 and alpha_4 were rounded before, and lose what the shape of the linkage
    # makes of it
    same_forces(
        scene,
        s,
        exchanged,
        float(o.torque[0]),
        factor=10.0 * shape(scene) / WORST_CONDITION,
    )


def _branch_from_the_other_end(ends: FourBar, s: Solution) -> int:
    """B' = A: the branch on which bar 4' lies where bar 2 did.

    It is no side of a diagonal. A kite or a parallelogram keeps its branch where it
    passes a change point, and its bars change sides there.
    """

    def miss(branch: int) -> float:
        motion = Motion(float(s.theta_4[0]), branch=branch)
        of_ends = fourbar.solve(Scene(ends, motion))
        return abs(math.remainder(float(of_ends.theta_4[0] - s.theta_2[0]), math.tau))

    return min((1, -1), key=miss)


def shape(scene: Scene) -> float:
    """Longest over shortest bar, squared.

    How much a rounding of one bar's place turns another.
    """
    return (max(scene.linkage.lengths) / min(scene.linkage.lengths)) ** 2


@pytest.mark.parametrize("name", FORCES)
def test_a_wrong_force_would_be_seen(name: str) -> None:
    """The comparison itself: a part in 1e9 is noticed."""
    scene = Scene(
        fourbar.uniform(0.3, 0.1, 0.25, 0.22),
        Motion(1.0, 10.0, 1.0),
        effects=(Gravity(),),
    )
    s = fourbar.solve(scene)
    wrong = forces(s)
    wrong[name] = wrong[name] * (1.0 + 1e-9)
    with pytest.raises(AssertionError):
        same_forces(scene, s, wrong, float(s.torque[0]))
