"""Summaries of motions that pass a pole, a change point or a gap between two positions
of the sweep.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

import fourbar
from fourbar.effects import Place, PointDrive
from fourbar.show.block import write_block, write_motor
from fourbar.show.motion_curves import describe_motion
from fourbar.show.summary import Facts, summarize
from tests.support.scenes import CYLINDER, crank_rocker

LEVER = 0.09
"""Distance of the end of CYLINDER from O2, m: the largest lever about O2."""
PEAK = 1e-6
"""Relative; five calls locate a peak to 1.6e-6 degrees, and its value to the square of
that.
"""
AT_A_LIMIT = 1e-6
"""rad; near a limit an angle changes as the root of the distance, whose last digits are
some 1e-16.
"""


def sweep(
    lengths: tuple[float, float, float, float], *degrees: float, **motion: object
) -> fourbar.Scene:
    """Make a scene of bars of 1 kg/m under gravity, swept in so many steps.

    The sweep is between two angles of bar 2.
    """
    start, stop, steps = degrees
    angle = fourbar.Sweep(math.radians(start), math.radians(stop), int(steps))
    command = fourbar.Motion(angle, 10.0, **motion)  # type: ignore[arg-type]
    linkage = fourbar.uniform(*lengths)
    return fourbar.Scene(linkage, command, effects=(fourbar.Gravity(9.81),))


def find_facts(scene: fourbar.Scene) -> Facts:
    return summarize(scene, fourbar.solve(scene))


def write(scene: fourbar.Scene, **options: object) -> str:
    lines = write_block(scene, fourbar.solve(scene, "error"), **options)  # type: ignore[arg-type]
    return " ".join(" ".join(lines).split())


@pytest.mark.slow
@pytest.mark.parametrize("steps", (20, 37, 72, 360))
def test_a_force_with_a_pole_is_no_number_anywhere(steps: int) -> None:
    """A cylinder that passes its dead points, where it has no lever."""
    motion = fourbar.Motion(fourbar.Sweep(0.1, 0.1 + math.tau, steps), 10.0)
    scene = crank_rocker(motion=motion, drive=CYLINDER)
    facts = find_facts(scene)
    assert facts.peak is None and facts.pins["O2"].peak is None
    text = write(scene, pressure=1e6)
    dead = [
        math.degrees(pole) for pole in facts.motion.panels.list_poles("drive_force")
    ]
    places = " deg and ".join(f"{angle:.4g}" for angle in dead)
    assert len(dead) == 2
    assert f"force grows without bound at theta_2 = {places} deg" in text
    assert "bore none is enough, as the force grows without bound" in text
    entry = write_motor(scene, facts.solution, {})
    assert entry is not None and entry["pins"]["O2"]["peak"] is None
    for key in ("peak_force", "rms_force"):
        assert entry[key] is None
    speeds = fourbar.solve(
        scene, at=describe_motion(facts.solution).solve_at(np.radians(dead)).at
    ).stroke_speed
    assert np.abs(speeds).max() < 1e-6


def test_a_listed_position_without_a_lever_is_one_at_which_the_force_grows() -> None:
    """Ends of the cylinder and O2 are in line; another position has a force."""
    on_ground, on_bar = (place.from_pin[1] for _, place in CYLINDER.ends)
    dead = crank_rocker().linkage.ground_angle + on_ground - on_bar
    motion = fourbar.Motion(np.array([1.0, dead]), 10.0)
    scene = crank_rocker(motion=motion, drive=CYLINDER)
    assert list(fourbar.solve(scene).status) == ["ok", "no_lever"]
    facts = find_facts(scene)
    assert facts.peak is None and facts.pins["O2"].peak is None
    assert facts.pins["B"].peak is not None
    text = write(scene, pressure=1e6)
    assert f"grows without bound at theta_2 = {math.degrees(dead):.4g} deg" in text
    assert "bore none is enough" in text and "peak unbounded" in text


def test_speed_and_power_beside_a_pole_of_the_force_are_located() -> None:
    """The largest speed of the stroke is omega times the largest lever.

    No position of this sweep has it.
    """
    motion = fourbar.Motion(fourbar.Sweep(0.1, 0.1 + math.tau, 20), 10.0)
    scene = crank_rocker(motion=motion, drive=CYLINDER)
    solution = fourbar.solve(scene)
    duty = write_motor(scene, solution, {})
    assert duty is not None and solution.stroke_speed is not None
    assert duty["peak_speed"] == pytest.approx(10.0 * LEVER, rel=PEAK)
    largest = np.abs(solution.stroke_speed).max()
    assert duty["peak_speed"] > (1.0 + 100.0 * PEAK) * largest
    assert "speed peak 0.9 m/s power" in write(scene)
    fine = scene.motion.replace(angle=fourbar.Sweep(0.1, 0.1 + math.tau, 36_000))
    power = fourbar.solve(replace(scene, motion=fine)).power
    assert power is not None
    assert duty["peak_power"] == pytest.approx(np.abs(power).max(), rel=PEAK)


@pytest.mark.slow
@pytest.mark.parametrize("steps", (36, 360))
@pytest.mark.parametrize("start", (5.0, 6.3))
def test_pin_forces_at_a_change_point_grow_and_the_torque_has_its_largest_value(
    start: float,
    steps: int,
) -> None:
    """Bars of 0.1, 0.3 and 0.1 kg.

    T2 = (0.05 + 0.3 + 0.05) kg g 0.1 m cos(theta_2), largest at the change points.
    """
    scene = sweep((0.3, 0.1, 0.3, 0.1), start, start + 360.0, steps)
    facts = find_facts(scene)
    assert facts.motion.panels.growing == {"F12", "F32", "F43", "F14"}
    assert facts.duty is not None and facts.peak is not None
    weight = 0.4 * 9.81 * 0.1
    assert facts.duty.peak_torque == pytest.approx(weight, rel=PEAK)
    assert abs(facts.peak.value) == pytest.approx(weight, rel=PEAK)


def test_a_search_that_hits_a_pole_still_finds_that_it_grows() -> None:
    """The third call passes the change point at a distance of 4e-9 rad.

    After it no value is larger.
    """
    a, b = 0.36419445229114195, 0.3900709389998438
    angle = fourbar.Sweep(0.09096220141585265, 4.489191916441563, 36)
    scene = fourbar.Scene(
        fourbar.uniform(a, b, a, b),
        fourbar.Motion(theta_4=angle, omega_4=0.0),
        effects=(fourbar.Gravity(),),
    )
    between = describe_motion(fourbar.solve(scene))
    assert between.panels.growing == {"F12", "F32", "F43", "F14"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "lengths", ((0.37, 0.09, 0.09, 0.37), (0.4, 0.1, 0.3, 0.2), (0.3, 0.1, 0.25, 0.22))
)
def test_ranges_of_a_backward_sweep_are_those_of_its_angles(
    lengths: tuple[float, float, float, float],
) -> None:
    scene = sweep(lengths, 160.0, -200.0, 90)
    solution = fourbar.solve(scene)
    facts = summarize(scene, solution)
    for bar in (2, 3, 4):
        angles = getattr(solution, f"theta_{bar}")
        low, high = facts.angles[bar]
        assert low.value <= angles.min() <= low.value + 0.1
        assert high.value - 0.1 <= angles.max() <= high.value


@pytest.mark.slow
def test_the_swing_of_an_output_is_not_counted_over_a_gap() -> None:
    """Both circuits are one for these lengths.

    Over the gap the output goes on from the other end of its range.
    """
    lengths = (0.2, 0.25, 0.21, 0.22)
    widths = []
    for start, stop in ((-170.0, 190.0), (40.0, 400.0), (400.0, 40.0)):
        facts = find_facts(sweep(lengths, start, stop, 90))
        low, high = facts.angles[4]
        widths.append(high.value - low.value)
        solution = facts.solution
        first = solution.theta_4[np.flatnonzero(solution.assembled)[0]]
        assert low.value - AT_A_LIMIT <= first <= high.value + AT_A_LIMIT
    assert widths == pytest.approx([widths[0]] * 3, abs=AT_A_LIMIT)
    assert widths[0] <= fourbar.swing(fourbar.uniform(*lengths)) + AT_A_LIMIT


def test_a_gap_within_a_step_is_no_full_turn() -> None:
    """The longest bar exceeds what lets bar 2 turn by 1 um.

    No position of the sweep lies in the gap.
    """
    lengths = (0.3, 0.1, 0.25, 0.15 - 1e-6)
    scene = sweep(lengths, 5.0, 365.0, 36)
    assert fourbar.solve(scene).assembled.all()
    text = write(scene)
    assert "assembles up to theta_2 = " in text
    assert "input turns fully" not in text and "per turn" not in text


@pytest.mark.slow
@pytest.mark.parametrize("speed", (0.0, 5.0))
def test_a_pole_between_two_positions_that_rise_past_it_is_found(speed: float) -> None:
    """The output stands still where bars 2 and 3 are in line.

    The torque on it grows there.
    """
    d, a, b, c = 0.3, 0.1, 0.25, 0.22
    dead = math.acos(((a + b) ** 2 + d**2 - c**2) / (2.0 * (a + b) * d))
    hidden = 0
    for first in np.linspace(0.01, 0.4, 14):
        angle = fourbar.Sweep(dead - first, dead - first + 0.8, 2)
        scene = fourbar.Scene(
            fourbar.uniform(d, a, b, c),
            fourbar.Motion(angle, speed),
            4,
            effects=(fourbar.Gravity(9.81),),
        )
        size = np.abs(np.asarray(fourbar.solve(scene).torque))
        hidden += int(size[0] < size[1] < size[2] or size[0] > size[1] > size[2])
        assert "torque" in find_facts(scene).motion.panels.growing
    assert hidden > 3


@pytest.mark.slow
@pytest.mark.parametrize(("last", "grows"), [(0.0, False), (-2.0, True)])
def test_a_pole_just_beyond_the_last_position_is_none_between(
    last: float,
    grows: bool,
) -> None:
    """A toggle clamp whose bars 2 and 3 would be in line at -6e-5 deg.

    The force on bar 4 is then large at 0 deg, and bounded.
    """
    scene = fourbar.from_pins((0.0, 0.0), (0.04, 0.002), (0.08, 0.0), (0.08, -0.06))
    motion = fourbar.Motion(
        fourbar.Sweep(math.atan2(2.0, 40.0), math.radians(last), 4),
        0.0,
        branch=scene.motion.branch,
    )
    pad = Place(4, (0.1, 0.0))
    loads = (fourbar.Load(2, (100.0, -0.5 * math.pi), from_pin=(0.16, 0.4)),)
    drive = PointDrive(pad, 0.0)
    scene = replace(scene, motion=motion, loads=loads, drive=drive, drive_bar=None)
    facts = find_facts(scene)
    assert (facts.bending[4].peak is None) == grows
    assert ("drive_force" in facts.motion.panels.growing) == grows
    said = "without bound" in write(scene)
    assert said == grows


@pytest.mark.slow
@pytest.mark.parametrize("steps", (36, 97, 360))
@pytest.mark.parametrize("start", (0.0, -math.pi, 0.3))
@pytest.mark.parametrize("pins", (("B",), ("O2", "A", "B", "O4")))
def test_a_jump_where_pin_friction_reverses_is_no_pole(
    pins: tuple[str, ...], start: float, steps: int
) -> None:
    """Coupler and output turn alike where the diagonal is shortest and longest.

    Pin B reverses there, at positions of some sweeps and at the ends of some turns.
    """
    friction = fourbar.PinFriction.at(**dict.fromkeys(pins, (0.15, 0.005)))
    scene = fourbar.Scene(
        fourbar.FourBar(0.3, fourbar.Bar(0.04), fourbar.Bar(0.29), fourbar.Bar(0.065)),
        fourbar.Motion(fourbar.Sweep(start, start + math.tau, steps), math.tau),
        loads=(fourbar.Load(4, moment=-20.0),),
        effects=(friction,),
    )
    between = describe_motion(fourbar.solve(scene))
    assert not between.panels.growing
    at_B = [
        math.remainder(place, math.tau)
        for place, pin in between.reversals
        if pin == "B"
    ]
    assert np.abs(np.sin(at_B)).max() < 1e-8 and len(at_B) == 2
    sides = np.concatenate(
        [base + np.linspace(-1e-9, 1e-9, 2) for base in (0.0, math.pi)]
    )
    fine = np.concatenate([np.linspace(0.0, math.tau, 7201) + 0.01, sides])
    everywhere = fourbar.solve(replace(scene, motion=fourbar.Motion(fine, math.tau)))
    for name in ("F12", "F14"):
        most = np.hypot(*getattr(everywhere, name).T).max()
        located = np.hypot(*getattr(between.solve_with_peaks(), name).T).max()
        assert located == pytest.approx(most, rel=1e-5)
