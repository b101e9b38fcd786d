"""Jumps and peaks between the steps of a sweep, against geometry and finer steps."""

import math
import resource
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import ellipk

import fourbar
from fourbar.files import loads
from fourbar.quantities import PIN_FORCES
from fourbar.scene import Command, command_at
from fourbar.scene.motion import Law
from fourbar.show.motion_curves import MotionCurves, describe_motion
from fourbar.show.summary import Facts, summarize
from tests.support.scenes import CYLINDER, crank_rocker, thesis

LOCATED = 1e-7
"""rad: one of the five steps in which the tests cut a turn, cut down five times by 40,
with room.
"""
PEAK = 1e-6
"""Relative, of a largest value against that of steps of 0.01 degrees: (0.01 deg)^2
times its curvature.
"""
SIX_DIGITS = 5e-6
"""Relative, half a unit of the last of six digits."""
EXACT = 1e-12
"""Relative, of one position that is solved twice."""
BARS = """
[lengths]
ground = "300 mm"
input = "100 mm"
coupler = "250 mm"
output = "220 mm"
[bars.input]
mass = "0.2 kg"
[bars.coupler]
mass = "0.5 kg"
[bars.output]
mass = "0.4 kg"
inertia = "20 kg cm^2"
"""
WIPER = fourbar.load(Path(__file__).parents[3] / "models" / "gallery" / "wiper.toml")
BUCKET = """
[lengths]
ground = "16.5 in"
input = "23.6 in"
coupler = "22 in"
output = "17.7 in"
ground_angle = "-65 deg"
[bars.input]
mass = "130 lb"
[bars.output]
mass = "1650 lb"
centre = ["26 in", "-75 deg"]
[motion]
stroke = { from = "44 in", to = "90.6 in", steps = 120 }
stroke_speed = "3 in/s"
side = "left"
[drive]
from = { bar = 1, from_pin = ["67 in", "172 deg"] }
to = { bar = 2, from_pin = ["23.6 in", "0 deg"] }
[effects]
gravity = ["1 g_0", "-90 deg"]
"""
PIN = '{ coefficient = 0.15, radius = "2 in" }'
FRICTION = f"pin_friction = {{ O2 = {PIN}, A = {PIN}, B = {PIN} }}\n"
FINE = fourbar.Sweep(0.0, math.tau, 36000)


def list_sizes(solution: fourbar.Solution) -> dict[str, np.ndarray]:
    """Sizes of drive, power and pin forces at the positions."""
    drive = "torque" if solution.drive is None else "drive_force"
    sizes = {name: np.abs(getattr(solution, name)) for name in (drive, "power")}
    forces = {name: np.hypot(*getattr(solution, name).T) for name in PIN_FORCES}
    return sizes | forces


def locate_between(_: fourbar.Scene, solution: fourbar.Solution) -> MotionCurves:
    return describe_motion(solution)


def swept(scene: fourbar.Scene, steps: int) -> fourbar.Scene:
    return replace(
        scene,
        motion=scene.motion.replace(angle=fourbar.Sweep(0.0, math.tau, steps)),
    )


@pytest.mark.parametrize("steps", (72, 97, 360))
def test_dry_friction_reverses_at_the_dead_centres_whatever_the_steps(
    steps: int,
) -> None:
    """The output turns back where bars 2 and 3 are in line.

    Cosine rule for O2, B, O4.
    """
    d, a, b, c = WIPER.linkage.lengths
    stretched, folded = (
        math.acos((r * r + d * d - c * c) / (2.0 * r * d)) for r in (b + a, b - a)
    )
    scene = swept(WIPER, steps)
    between = locate_between(scene, fourbar.solve(scene))
    assert [pin for _, pin in between.reversals] == ["O4", "O4"]
    assert (
        np.abs(
            np.subtract(
                [angle for angle, _ in between.reversals], [stretched, folded + math.pi]
            )
        ).max()
        < LOCATED
    )
    located = list_sizes(between.solve_with_peaks())
    for name in (
        "F12",
        "F32",
        "F43",
        "F14",
    ):  # each is largest on one side of the first jump
        most = max(_beside(scene, stretched, step)[name] for step in (-1, 1))
        assert located[name].max() == pytest.approx(most, rel=PEAK)
    assert located["F14"].max() == pytest.approx(22.464, abs=5e-4)


def _beside(scene: fourbar.Scene, theta_2: float, step: int) -> dict[str, float]:
    """Sizes next to an angle."""
    command = Command(
        np.array([theta_2 + step * 1e-8]),
        np.array([1], dtype=np.int8),
        scene.motion.omega_2,
        0.0,
    )
    return {
        name: float(size[0])
        for name, size in list_sizes(fourbar.solve(scene, at=command)).items()
    }


def test_the_largest_of_coarse_steps_is_that_of_fine_ones() -> None:
    coarse = swept(crank_rocker(), 24)
    between = locate_between(coarse, fourbar.solve(coarse))
    assert not between.panels.growing and not between.reversals
    fine = list_sizes(
        fourbar.solve(replace(coarse, motion=coarse.motion.replace(angle=FINE)))
    )
    for name, size in list_sizes(between.solve_with_peaks()).items():
        assert size.max() == pytest.approx(fine[name].max(), rel=PEAK), name
        peak = between.panels.find_peak(name)
        assert abs(peak.value) == pytest.approx(fine[name].max(), rel=PEAK), name
    of_coarse = np.isin(
        between.solve_with_peaks().theta_2, fourbar.solve(coarse).theta_2
    )
    assert of_coarse.sum() == 25 and np.all(
        np.diff(between.solve_with_peaks().theta_2) > 0.0
    )


def read_cam(fall: str, steps: int) -> fourbar.Scene:
    return loads(
        f"""{BARS}
        [motion.law]
        kind = "cycloidal"
        theta_2 = "20 deg"
        rise = ["60 deg", "0.5 s"]
        dwell = "0.2 s"
        fall = "{fall}"
        rest = "0.1 s"
        steps = {steps}
        """
    )


@pytest.mark.parametrize(
    ("fall", "steps", "torque", "time", "power"),
    [
        ("5 ms", 360, -1299.52, 0.701065, 281811.0),
        ("5 ms", 12, -1299.52, 0.701065, 281811.0),
        ("100 ms", 22, -3.24880, 0.721295, 35.2264),
        ("100 ms", 28, -3.24880, 0.721295, 35.2264),
    ],
)
def test_the_peak_of_a_short_fall_does_not_depend_on_the_steps(
    fall: str,
    steps: int,
    torque: float,
    time: float,
    power: float,
) -> None:
    """Right are the free bodies at 20 000 instants of each piece of the law."""
    scene = read_cam(fall, steps)
    facts = summarize(scene, fourbar.solve(scene))
    assert facts.peak is not None and facts.duty is not None
    assert facts.peak.value == pytest.approx(torque, rel=SIX_DIGITS)
    assert facts.peak.place == pytest.approx(time, rel=SIX_DIGITS)
    assert facts.duty.peak_power == pytest.approx(power, rel=SIX_DIGITS)


@pytest.mark.parametrize("steps", (7, 36, 361))
def test_a_corner_of_a_load_between_two_positions_is_a_peak(steps: int) -> None:
    """The load is fifty times larger at 101.3 degrees than at any position."""
    scene = loads(
        f"""{BARS}
        [motion]
        theta_2 = {{ from = "5 deg", to = "365 deg", steps = {steps} }}
        omega_2 = "10 rad/s"
        alpha_2 = "5 rad/s^2"
        [[loads]]
        bar = 2
        moment = "-0.05 N m"
        force = ["-1 N", "17 deg"]
        arm = ["2 cm", "-40 deg"]
        [loads.table]
        theta_2 = ["0 deg", "98.3 deg", "101.3 deg", "104.3 deg", "360 deg"]
        factor = [0.5, 0.5, 50.0, 0.5, 0.5]
        """
    )
    corner = math.radians(101.3)
    facts = summarize(scene, fourbar.solve(scene))
    at_corner = fourbar.solve(scene, at=command_at(scene, np.array([corner])))
    assert facts.peak is not None and facts.pins["O2"].peak is not None
    assert at_corner.torque is not None and at_corner.F12 is not None
    assert facts.peak.place == pytest.approx(corner, rel=SIX_DIGITS)
    assert facts.peak.value == pytest.approx(at_corner.torque[0], rel=EXACT)
    load = float(np.hypot(*at_corner.F12[0]))
    assert facts.pins["O2"].peak.value == pytest.approx(load, rel=EXACT)


def test_forces_whose_squares_overflow_have_the_peaks_and_means_of_smaller_ones() -> (
    None
):
    """Nothing acts but one force, so that everything is in proportion to it."""
    motion = fourbar.Motion(fourbar.Sweep(0.0, math.tau, 12), 10.0)
    facts = []
    for force in (1.0, 1e300):
        loads = (fourbar.Load(3, (force, 0.4), from_pin=(0.05, 0.0)),)
        bars = map(fourbar.Bar, (0.1, 0.25, 0.22))
        scene = fourbar.Scene(fourbar.FourBar(0.3, *bars), motion, 2, loads)
        facts.append(summarize(scene, fourbar.solve(scene)))
    small, huge = facts
    assert small.peak is not None and huge.peak is not None
    assert huge.peak.value / 1e300 == pytest.approx(small.peak.value, rel=EXACT)
    assert small.duty is not None and huge.duty is not None
    for name in ("rms_torque", "peak_power", "rms_power", "energy_in"):
        ratio = getattr(huge.duty, name) / 1e300
        assert ratio == pytest.approx(getattr(small.duty, name), rel=EXACT)
    for pin, load in small.pins.items():
        rms = huge.pins[pin].rms
        assert load.rms is not None and rms is not None
        assert rms / 1e300 == pytest.approx(load.rms, rel=EXACT)


@pytest.mark.slow
def test_towards_a_limit_within_the_last_step_it_grows_too() -> None:
    """A sweep that ends where the loop no longer closes.

    Nothing beyond its last position was looked at.
    """
    scene = crank_rocker()
    for steps in (9, 20):
        swept = replace(
            scene,
            motion=fourbar.Motion(theta_4=fourbar.Sweep(1.5, 3.5, steps), omega_4=2.0),
        )
        solution = fourbar.solve(swept)
        assert 0 < solution.assembled.sum() < steps + 1
        assert {"speed", "power", "F12", "F32", "F43"} <= locate_between(
            swept, solution
        ).panels.growing


def test_towards_a_pole_no_largest_value_is_made_up() -> None:
    scene = swept(thesis(), 360)
    solution = fourbar.solve(scene)
    between = locate_between(scene, solution)
    assert "torque" in between.panels.growing
    assert summarize(scene, solution).peak is None


def test_a_motion_law_is_looked_at_between_its_instants_and_listed_angles_are_not() -> (
    None
):
    law = Law((0.0, 1.0, 2.0), (0.3, 2.0, 1.0), steps=20, ends="rest")
    scene = crank_rocker(
        motion=fourbar.Motion(law=law),
        effects=(fourbar.Friction.at(O2=0.05),),
    )
    between = locate_between(scene, fourbar.solve(scene))
    fine = list_sizes(
        fourbar.solve(
            replace(scene, motion=fourbar.Motion(law=replace(law, steps=20000)))
        )
    )
    assert [pin for _, pin in between.reversals] == ["O2"]
    assert np.max(list_sizes(between.solve_with_peaks())["power"]) == pytest.approx(
        fine["power"].max(),
        rel=PEAK,
    )
    assert np.all(np.diff(between.solve_with_peaks().time) > 0.0)
    listed = crank_rocker(motion=fourbar.Motion(np.linspace(0.0, 6.0, 9), 10.0))
    assert (
        describe_motion(solution := fourbar.solve(listed)).solve_with_peaks()
        is solution
    )


def test_the_largest_force_of_a_stroke_is_that_of_fine_steps() -> None:
    def of(steps: int) -> fourbar.Scene:
        motion = fourbar.Motion(
            stroke=fourbar.Sweep(0.33, 0.17, steps),
            stroke_speed=-0.2,
            side="left",
        )
        return crank_rocker(
            motion=motion,
            drive=CYLINDER,
            effects=(fourbar.Friction((("O4", 0.01),)),),
        )

    between = locate_between(of(20), fourbar.solve(of(20)))
    assert (
        between.solve_with_peaks().at.stroke is not None
        and (np.diff(between.solve_with_peaks().at.stroke) < 0.0).all()
    )
    fine = fourbar.solve(of(20000))
    for name, size in list_sizes(fine).items():
        assert list_sizes(between.solve_with_peaks())[name].max() == pytest.approx(
            size.max(),
            rel=PEAK,
        ), name
    slips = np.flatnonzero(np.diff(np.sign(fine.omega_4)))
    assert [pin for _, pin in between.reversals] == ["O4"]
    for (place, _), i in zip(between.reversals, slips, strict=True):
        assert fine.at.stroke[i + 1] <= place <= fine.at.stroke[i]


@pytest.mark.slow
def test_the_summary_beside_a_dead_point_is_as_quick_with_pin_friction(
    tmp_path: Path,
) -> None:
    """From 44 in on the linkage does not assemble at first.

    Many couples jam beside the dead point where it begins.
    """
    seconds = []
    for name, text in (("without", BUCKET), ("with", BUCKET + FRICTION)):
        (scene := tmp_path / f"{name}.toml").write_text(text)
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        done = subprocess.run(
            [sys.executable, "-m", "fourbar", "analyze", str(scene)],
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0 and "cylinder from bar" in done.stdout, done.stderr
        seconds.append(resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before)
    assert seconds[1] < 5.0 * seconds[0]


EXTREME = 1e-9
"""rad and relative: the dense output of the integrator, and equal extremes."""
ARM, AWAY, CRANK, COUPLER = 0.5, math.radians(25.0), 2.0, 5.0
INERTIA = 2.0 * CRANK * ARM**2 / 3.0 + COUPLER * ARM**2
WEIGHT = 9.8 * (CRANK + COUPLER) * ARM


def release_pendulum(omega: float, *effects: fourbar.effects.Effect) -> Facts:
    """Release a parallelogram, which is one pendulum: its coupler does not turn.

    The seven instants that it states are never extreme.
    """
    crank = fourbar.Bar(ARM, CRANK)
    linkage = fourbar.FourBar(0.6, crank, fourbar.Bar(0.6, COUPLER), crank)
    motion = fourbar.Motion(1.5 * math.pi - AWAY, omega, free=fourbar.Free(3.0, 7))
    scene = fourbar.Scene(linkage, motion, effects=(fourbar.Gravity(9.8), *effects))
    return summarize(scene, fourbar.solve(scene))


def test_a_released_swing_has_its_period_and_the_first_of_equal_extremes() -> None:
    """The period of a pendulum is an elliptic integral."""
    facts = release_pendulum(0.0)
    slow = math.sqrt(INERTIA / WEIGHT)
    period = 4.0 * slow * float(ellipk(math.sin(0.5 * AWAY) ** 2))
    assert facts.period == pytest.approx(period, rel=EXTREME)
    low, high = facts.angles[2]
    assert low == pytest.approx((1.5 * math.pi - AWAY, 0.0), abs=EXTREME)
    highest = 1.5 * math.pi + AWAY
    assert high == pytest.approx((highest, 0.5 * period), abs=EXTREME)
    damped = release_pendulum(0.0, fourbar.Viscous((("O2", 1e-6),)))
    assert damped.period is None


def test_a_released_turn_has_its_period() -> None:
    """The time of a turn is the integral of 1/omega, by the energy."""
    energy = 0.5 * INERTIA * 30.0**2 - WEIGHT * math.cos(AWAY)

    def compute_slowness(theta: float) -> float:
        return math.sqrt(0.5 * INERTIA / (energy + WEIGHT * math.cos(theta)))

    period, _ = quad(compute_slowness, 0.0, 2.0 * math.pi, epsabs=1e-13)
    assert release_pendulum(30.0).period == pytest.approx(period, rel=EXTREME)
