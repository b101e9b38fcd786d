"""The effects' formulas against other derivations.

Potentials, exact arithmetic, limiting cases.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

import fourbar
from fourbar.effects import (
    Flywheel,
    Friction,
    Gravity,
    Load,
    PinFriction,
    Place,
    Spring,
    Springs,
    Table,
    Torsion,
)
from fourbar.effects.pin_friction import MANY, NO_SOLUTION, ONE_SOLUTION, solve_sliding
from fourbar.errors import InputError, LimitError
from fourbar.evaluation.case import compute_shown_state
from fourbar.scene import Command, Scene
from fourbar.scene.motion import Law, Motion, Rise, Sweep
from fourbar.solving import solve
from fourbar_validation.engines.effects import look_up
from tests.support.scenes import crank_rocker

SECOND_ORDER = 1e-8
"""A central difference with a step of 1e-5 rad: 1e-10 from its third derivative, 1e-11
from rounding, times the
derivatives of these springs, which are some tens of N m.
"""
STEP = 1e-5
LAST_DIGITS = 64 * 2.0**-52
"""The roundings of one evaluation."""


def alone(
    *effects: object,
    omega_2: float = 0.0,
    theta_2: object = None,
    **changes: object,
) -> Scene:
    """Massless in effect: static, so that only the effects act."""
    angles = np.linspace(0.2, 6.0, 9) if theta_2 is None else theta_2
    return crank_rocker(
        motion=Motion(angles, omega_2),
        loads=(),
        effects=effects,
        **changes,
    )  # type: ignore[arg-type]


def potential_torque(scene: Scene, energy: object) -> np.ndarray:
    """T2 = dV/dtheta_2 of a static linkage, by central differences.

    V is its potential.
    """
    theta_2 = np.asarray(scene.motion.theta_2)
    ends = [
        solve(replace(scene, motion=Motion(theta_2 + step, 0.0)), "position")
        for step in (STEP, -STEP)
    ]
    values = [energy(end) for end in ends]  # type: ignore[operator]
    return (values[0] - values[1]) / (2.0 * STEP)


def test_a_spring_is_the_slope_of_its_energy() -> None:
    spring = Spring(Place(1, (0.1, -1.5)), Place(3, (0.08, 0.2)), 200.0, 0.05, 3.0)

    def energy(s: fourbar.Solution) -> np.ndarray:
        theta_1 = scene.linkage.ground_angle
        ground = 0.1 * np.exp(1j * (theta_1 - 1.5))
        end = s.A @ [1, 1j] + 0.08 * np.exp(1j * (s.theta_3 + 0.2))
        distance = np.abs(end - ground)
        return 3.0 * distance + 100.0 * (distance - 0.05) ** 2

    scene = alone(Springs((spring,)))
    torque = solve(scene).torque
    assert torque is not None and np.abs(torque).max() > 1.0
    assert torque == pytest.approx(
        potential_torque(scene, energy),
        abs=SECOND_ORDER * 10,
        rel=0,
    )


def test_the_work_that_compresses_a_gas_spring_is_that_of_its_two_forces() -> None:
    """Pushed in by s it has taken F1 s + (F2 - F1) s^2/(2 stroke).

    F1 and F2 are its forces at no and at full stroke.
    """
    extended, stroke, first, last = 0.5, 0.3, 40.0, 70.0

    def energy(s: fourbar.Solution) -> np.ndarray:
        ground = 0.2 * np.exp(1j * (scene.linkage.ground_angle + 2.0))
        pushed = extended - np.abs(s.B @ [1, 1j] - ground)
        return first * pushed + (last - first) / (2.0 * stroke) * pushed**2

    ends = Place(1, (0.2, 2.0)), Place(4, (0.22, 0.0))
    scene = alone(Springs((Spring.gas(*ends, extended, stroke, first, last),)))
    torque = solve(scene).torque
    assert torque is not None and np.abs(torque).max() > 1.0
    assert torque == pytest.approx(
        potential_torque(scene, energy),
        abs=SECOND_ORDER * 10,
        rel=0,
    )
    assert Spring.gas(*ends, extended, stroke, first) == Spring(
        *ends, 0.0, extended, -first
    )


def test_a_spring_without_free_length_has_a_force_where_its_points_meet() -> None:
    """Force k times the distance vector.

    Zero, not NaN, where both ends lie on pin A.
    """
    ends = Place(2, (0.1, 0.0)), Place(3, (0.0, 0.0))
    torque = solve(alone(Springs((Spring(*ends, 100.0),)))).torque
    assert torque is not None and np.array_equal(torque, np.zeros(9))


def test_torsion_springs_are_the_slope_of_their_energy() -> None:
    springs = {
        "O2": (1.5, 0.3, 0.2),
        "A": (1.0, 0.4, 0.0),
        "B": (2.0, 0.5, -0.1),
        "O4": (0.5, 2.0, 0.3),
    }
    scene = alone(Torsion.at(**springs), theta_2=np.linspace(-1.0, 2.0, 7))

    def energy(s: fourbar.Solution) -> np.ndarray:
        theta = {
            1: scene.linkage.ground_angle,
            2: s.theta_2,
            3: s.theta_3,
            4: s.theta_4,
        }
        total = np.zeros(len(s))
        for pin, (k, rest, preload) in springs.items():
            i, j = fourbar.linkage.PINS[pin]
            beta = np.angle(np.exp(1j * (theta[j] - theta[i] - rest)))
            total += preload * beta + 0.5 * k * beta**2
        return total

    assert solve(scene).torque == pytest.approx(
        potential_torque(scene, energy),
        abs=SECOND_ORDER * 10,
        rel=0,
    )


@pytest.mark.parametrize(("bar", "name"), [(2, "input"), (4, "output")])
def test_a_flywheel_is_inertia_of_the_bar(bar: int, name: str) -> None:
    scene = crank_rocker(effects=(Gravity(), Flywheel(0.02, bar)), drive_bar=bar)
    plain = scene.linkage.bar(bar)
    heavier = replace(
        scene.linkage,
        **{name: replace(plain, inertia=plain.moment_of_inertia + 0.02)},
    )
    with_wheel, with_bar = (
        solve(scene),
        solve(replace(scene, linkage=heavier, effects=(Gravity(),))),
    )
    for quantity in ("torque", "F12", "F32", "F43", "F14"):
        by_wheel, by_bar = getattr(with_wheel, quantity), getattr(with_bar, quantity)
        assert np.abs(by_wheel - by_bar).max() <= LAST_DIGITS * np.abs(by_bar).max(), (
            quantity
        )


def test_one_cone_has_one_none_or_two_solutions() -> None:
    """On a line F = 1, C = c: x = k (1 + c x), x = k |1 - c x|. The distance from
    jamming is the slope 1 - k e.C of x - k |F + C x|, e along F + C x, at most 1.
    """
    cases = {  # (F, C): solutions of x = |F + C x| with k = 1, and how far from jamming
        ((1.0, 0.0), (0.5, 0.0)): (ONE_SOLUTION, 2.0, 0.5),
        ((1.0, 0.0), (-0.5, 0.0)): (ONE_SOLUTION, 2.0 / 3.0, 1.0),
        ((1.0, 0.0), (2.0, 0.0)): (NO_SOLUTION, math.nan, None),
        ((1.0, 0.0), (-2.0, 0.0)): (MANY, 1.0 / 3.0, 1.0),
        ((1.0, 0.0), (0.0, 2.0)): (NO_SOLUTION, math.nan, None),
        ((1.0, 0.0), (0.0, 0.6)): (ONE_SOLUTION, 1.25, 0.64),
        ((0.0, 0.0), (0.5, 0.3)): (ONE_SOLUTION, 0.0, 1.0),
        ((3.0, 4.0), (0.0, 0.0)): (ONE_SOLUTION, 5.0, 1.0),
        ((1.0, 0.0), (1.0 - 2.0**-20, 0.0)): (ONE_SOLUTION, 2.0**20, 2.0**-20),
    }
    for (F, C), (number, x, far) in cases.items():
        sliding = solve_sliding(np.array([[F]]), np.array([[[C]]]), np.array([[1.0]]))
        assert sliding.number[0] == number, (F, C)
        assert sliding.x[0, 0] == pytest.approx(x, rel=1e-15, nan_ok=True), (F, C)
        if far is not None:
            assert sliding.from_jamming[0] == pytest.approx(far, rel=LAST_DIGITS), (
                F,
                C,
            )


def test_several_cones_one_of_which_is_known() -> None:
    """Two pins that do not feel each other are two single ones in every outcome."""
    for c1, c2, number in (
        (0.5, 0.3, ONE_SOLUTION),
        (2.0, 0.3, NO_SOLUTION),
        (-2.0, 0.3, MANY),
        (-2.0, -3.0, MANY),
    ):
        F = np.array([[[1.0, 0.0], [2.0, 0.0]]] * 2)
        C = np.array([[[[c1, 0.0], [0.0, 0.0]], [[0.0, 0.0], [c2, 0.0]]]] * 2)
        sliding = solve_sliding(F, C, np.array([[1.0, 1.0], [0.25, 0.125]]))
        assert list(sliding.number) == [number, ONE_SOLUTION]
        if number != NO_SOLUTION:
            assert sliding.x[0] == pytest.approx(
                [1.0 / (1.0 - c1), 2.0 / (1.0 - c2)],
                rel=1e-12,
            )
            # both slopes are 1 - k c where F + C x keeps the sense of F
            assert sliding.from_jamming[0] == pytest.approx(
                min(1.0, 1.0 - c1, 1.0 - c2),
                rel=1e-12,
            )
        assert sliding.x[1] == pytest.approx(
            [0.25 / (1.0 - 0.25 * c1), 0.25 / (1.0 - 0.125 * c2)],
            rel=1e-12,
        )


def test_jamming_is_a_status_and_leaves_no_force() -> None:
    s = solve(crank_rocker(effects=(PinFriction.at(A=(50.0, 0.01)),)))
    assert {"jammed", "several"} == set(s.status)
    jammed = np.array([status == "jammed" for status in s.status])
    assert np.isnan(s.torque[jammed]).all() and np.isfinite(s.torque[~jammed]).all()
    assert np.isfinite(s.theta_3).all()


@pytest.mark.parametrize(
    "friction",
    [Friction.at(O2=0.02, B=0.03), PinFriction.at(O2=(0.2, 0.01), B=(0.3, 0.02))],
)
def test_at_rest_the_interval_is_that_of_beginning_to_move(friction: object) -> None:
    """Its ends are the limits of the torque for slow motions in either sense.

    At rest itself it is their inside.
    """
    scene = alone(Gravity(), friction)
    rest = solve(scene)
    slow = [
        solve(replace(scene, motion=scene.motion.replace(speed=speed))).torque
        for speed in (1e-9, -1e-9)
    ]
    # (1e-9 rad/s)^2 of inertia is nothing against these torques
    assert rest.torque_high == pytest.approx(np.maximum(*slow), rel=1e-13)
    assert rest.torque_low == pytest.approx(np.minimum(*slow), rel=1e-13)
    assert ((rest.torque_low < rest.torque) & (rest.torque < rest.torque_high)).all()
    for side, beginning in zip((1, -1), slow, strict=True):
        assert solve(scene, "force", side=side).torque == pytest.approx(
            beginning,
            rel=1e-13,
        )


def test_without_dry_friction_there_is_no_interval() -> None:
    s = solve(crank_rocker())
    assert s.torque_low is s.torque_high is s.friction_residual is None


def test_pin_load_friction_needs_the_pin_forces() -> None:
    free = crank_rocker(
        motion=Motion(1.0, 0.0, free=fourbar.Free(1.0, 10)),
        effects=(PinFriction.at(A=(0.1, 0.01)),),
    )
    with pytest.raises(LimitError, match="pin forces"):
        solve(free)


def test_a_table_is_linear_between_its_points_and_periodic() -> None:
    table = Table((1.0, 2.0, 1.0 + 2 * math.pi), (0.0, 4.0, 0.0))
    angles = np.array([1.0, 1.25, 2.0, 1.5 - 2 * math.pi, 1.25 + 6 * math.pi])
    assert table.at(angles) == pytest.approx([0.0, 1.0, 4.0, 2.0, 1.0], abs=1e-14)
    for theta_2, factor in zip(angles.tolist(), table.at(angles), strict=True):
        assert look_up(table, theta_2) == pytest.approx(factor, abs=1e-14)


def test_a_load_over_theta_2_is_the_load_times_its_factor() -> None:
    load = Load(4, (3.0, 0.7), arm=(0.05, 1.0), moment=0.2)
    table = Table((0.0, math.pi, 2 * math.pi), (1.0, 3.0, 1.0))
    angle = np.array([math.pi / 2])
    tabled = (
        solve(alone(theta_2=angle)),
        solve(replace(alone(theta_2=angle), loads=(replace(load, table=table),))),
    )
    twice = replace(
        alone(theta_2=angle),
        loads=(replace(load, force=(6.0, 0.7), moment=0.4),),
    )
    assert tabled[1].torque == pytest.approx(solve(twice).torque, rel=1e-14)


def test_breaks_change_their_sign_where_forces_jump_or_bend() -> None:
    """Corners of a table lie whole turns apart; the output turns back in line."""
    stated = Table((0.4, 1.0, 1.5), (1.0, 3.0, 2.0))
    load = fourbar.Load(2, moment=1.0, table=stated)
    places = {f"theta_2 = {corner!r}": [corner] for corner in stated.theta_2}
    lengths = 0.3, 0.1, 0.25, 0.22
    d, a, b, c = lengths
    places["O4"] = [
        turned + math.acos((r * r + d * d - c * c) / (2.0 * r * d))
        for r, turned in ((b + a, 0.0), (b - a, math.pi))
    ]
    friction = fourbar.Friction.at(O4=0.1)
    scene = fourbar.Scene(fourbar.uniform(*lengths), loads=(load,), effects=(friction,))
    angles = np.linspace(0.0, 2.0 * math.tau, 1009)
    branch = np.ones(len(angles), dtype=np.int8)
    for speed in (3.0, -3.0):
        state = compute_shown_state(scene, Command(angles, branch, speed, 0.0))
        breaks = load.breaks(state) | friction.breaks(state)
        assert breaks.keys() == places.keys()
        for name, values in breaks.items():
            crossed = np.flatnonzero(values[1:] * values[:-1] < 0.0)
            right = np.add.outer(places[name], [0.0, math.tau])
            assert crossed.tolist() == sorted(
                np.searchsorted(angles, right.ravel()) - 1
            ), name


def test_a_law_through_a_cubic_is_that_cubic() -> None:
    time = np.linspace(0.0, 2.0, 7)
    law = Law(tuple(time), tuple(0.3 + time - 2.0 * time**2 + 0.5 * time**3), 40)
    s = solve(crank_rocker(motion=Motion(law=law)))
    t = s.time
    assert t is not None and len(t) == 41
    assert s.theta_2 == pytest.approx(0.3 + t - 2.0 * t**2 + 0.5 * t**3, abs=1e-13)
    assert s.omega_2 == pytest.approx(1.0 - 4.0 * t + 1.5 * t**2, abs=1e-12)
    assert s.alpha_2 == pytest.approx(-4.0 + 3.0 * t, abs=1e-11)


def test_the_ends_of_a_law() -> None:
    points = (0.0, 0.2, 0.5, 1.0), (0.0, 1.0, 2.5, 2 * math.pi)
    rest, periodic = (
        Law(*points, 10, ends).at(np.array([0.0, 1.0])) for ends in ("rest", "periodic")
    )
    assert rest[1] == pytest.approx([0.0, 0.0], abs=1e-13)
    assert periodic[0] == pytest.approx([0.0, 2 * math.pi], abs=1e-13)
    assert periodic[1][0] == pytest.approx(periodic[1][1], rel=1e-12)
    assert periodic[2][0] == pytest.approx(periodic[2][1], rel=1e-11)


@pytest.mark.parametrize("ends", ["free", "rest", "periodic"])
def test_speed_and_acceleration_are_the_slopes_of_the_law(ends: str) -> None:
    law = Law((0.0, 0.2, 0.5, 1.0), (0.0, 1.0, 2.5, 2 * math.pi), 10, ends)
    inside, step = np.array([0.05, 0.33, 0.71, 0.93]), 1e-5
    before, here, after = (law.at(inside + shift) for shift in (-step, 0.0, step))
    # central differences: third derivative times step^2/6, and rounding over the step
    assert here[1] == pytest.approx((after[0] - before[0]) / (2 * step), rel=1e-7)
    assert here[2] == pytest.approx((after[1] - before[1]) / (2 * step), rel=1e-7)


CAM = {"rise": (1.0, 0.5), "dwell": 0.2, "fall": 0.4, "rest": 0.1}


@pytest.mark.parametrize(
    ("kind", "speed", "acceleration"),
    [("cycloidal", 2.0, 2.0 * math.pi), ("345", 1.875, 10.0 / math.sqrt(3.0))],
)
def test_a_standard_law_has_the_factors_of_the_books(
    kind: str,
    speed: float,
    acceleration: float,
) -> None:
    """C_v = 2, C_a = 2 pi of the cycloidal law.

    1.875 and 5.7735 of the 3-4-5 polynomial.
    """
    law = Rise(kind, (1.0, 0.5), theta_2=0.3)
    time = np.linspace(0.0, 0.5, 100_001)
    theta, omega, alpha = law.at(time)
    assert np.abs(omega).max() * 0.5 == pytest.approx(speed, rel=1e-8)
    assert np.abs(alpha).max() * 0.25 == pytest.approx(acceleration, rel=1e-8)
    assert theta[[0, 50_000, -1]] == pytest.approx([0.3, 0.8, 1.3], rel=1e-15)


@pytest.mark.parametrize("kind", ["cycloidal", "345"])
def test_rise_dwell_fall_and_rest_join_without_a_jump(kind: str) -> None:
    law = Rise(kind, theta_4=-0.4, **CAM)  # type: ignore[arg-type]
    assert law.bar == 4
    assert law.time == pytest.approx((0.0, 0.5, 0.7, 1.1, 1.2))
    theta, omega, alpha = law.at(np.array(law.time))
    assert theta == pytest.approx([-0.4, 0.6, 0.6, -0.4, -0.4], abs=1e-15)
    assert np.abs(omega).max() < 1e-15
    assert np.abs(alpha).max() < 1e-12
    inside, step = np.array([0.1, 0.3, 0.45, 0.6, 0.75, 0.9, 1.05, 1.15]), 1e-5
    before, here, after = (law.at(inside + shift) for shift in (-step, 0.0, step))
    for order in (1, 2):
        slope = (after[order - 1] - before[order - 1]) / (2.0 * step)
        assert here[order] == pytest.approx(slope, abs=1e-6)


def test_a_rise_that_does_not_fall_stays() -> None:
    theta, omega, alpha = Rise("345", (-1.0, 0.5), 2.0, dwell=0.3).at(
        np.array([0.5, 0.65, 0.8])
    )
    assert theta.tolist() == [1.0, 1.0, 1.0]
    assert [*omega, *alpha] == [0.0] * 6


@pytest.mark.parametrize(
    ("stated", "key"),
    [
        ({"kind": "harmonic", "rise": (1.0, 0.5), "theta_2": 0.0}, "kind"),
        ({"kind": "345", "rise": (1.0, 0.0), "theta_2": 0.0}, "rise"),
        ({"kind": "345", "rise": (1.0, 0.5)}, "theta_2"),
        ({"kind": "345", "rise": (1.0, 0.5), "theta_2": 0.0, "rest": 0.1}, "rest"),
        ({"kind": "345", "rise": (1.0, 0.5), "theta_2": 0.0, "dwell": -0.1}, "dwell"),
    ],
)
def test_a_rise_that_cannot_be_is_refused(stated: dict[str, object], key: str) -> None:
    with pytest.raises(InputError, match=f"law.{key}"):
        Rise(**stated)  # type: ignore[arg-type]


HERE = Place(2, (0.1, 0.0)), Place(4, (0.2, 0.0))


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda: Law((0.0, 1.0), (0.0, 1.0)), "motion.law"),
        (lambda: Law((0.0, 1.0, 1.0, 2.0), (0.0, 1.0, 2.0, 3.0)), "motion.law.time"),
        (lambda: Motion(1.0, law=Law((0.0, 1.0), (0.0, 1.0), 5, "rest")), "motion.law"),
        (lambda: Flywheel(1.0, 3), "effects.flywheel.bar"),
        (
            lambda: Spring(Place(2, (0.1, 0.0)), Place(2, (0.2, 0.0)), 1.0),
            "effects.springs.to.bar",
        ),
        (lambda: Spring.gas(*HERE, 0.3, 0.3, 1.0), "effects.springs.gas.stroke"),
        (
            lambda: Spring.gas(*HERE, 0.3, 0.1, 2.0, 1.0),
            "effects.springs.gas.compressed_force",
        ),
        (
            lambda: Spring.gas(*HERE, 0.3, 0.1, -2.0),
            "effects.springs.gas.extended_force",
        ),
        (lambda: Torsion.at(A=(0.0, 1.0, 0.0)), "effects.torsion.A.stiffness"),
        (lambda: PinFriction.at(C=(0.1, 0.1)), "effects.pin_friction.C"),
        (lambda: PinFriction.at(A=(-0.1, 0.1)), "effects.pin_friction.A.coefficient"),
        (lambda: Table((0.0, 1.0, 7.0), (1.0, 1.0, 1.0)), "loads.table.theta_2"),
    ],
)
def test_bad_input_names_its_key(make: object, key: str) -> None:
    with pytest.raises(InputError) as error:
        make()  # type: ignore[operator]
    assert error.value.key == key


def test_a_sweep_without_theta_2_still_runs_over_the_range() -> None:
    assert len(solve(crank_rocker(motion=Motion(None, 1.0)), "position")) == 361
    assert isinstance(crank_rocker().motion.theta_2, Sweep)


def test_a_table_says_in_degrees_what_it_covers_and_what_lies_outside() -> None:
    table = fourbar.effects.Table(("0 deg", "90 deg"), (0.0, 1.0))
    with pytest.raises(
        InputError,
        match="covers 0 to 90 deg; the position at 120 deg lies outside",
    ):
        table.at(np.radians([45.0, 120.0]))
