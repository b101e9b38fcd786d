"""The summary of `analyze`: its numbers by geometry and finer steps, and its words."""

import re
import tomllib
from dataclasses import replace
from math import degrees, floor, isnan, log10, pi, radians, sqrt, tau

import numpy as np
from pytest import approx, mark

from fourbar import (
    Bar,
    Flywheel,
    FourBar,
    Free,
    Friction,
    Law,
    LinearDrive,
    Load,
    Motion,
    PinFriction,
    Place,
    PointDrive,
    Rise,
    Scene,
    Sine,
    Spring,
    Springs,
    Sweep,
    Table,
    command,
    dump,
    equilibrium,
    limit_positions,
    solve,
    uniform,
    units,
)
from fourbar.files.scene_file import read_tables
from fourbar.formulas.mobility import find_intervals
from fourbar.quantities import PIN_FORCES
from fourbar.scene import command_at
from fourbar.show.block import SceneBlock
from fourbar.show.motion_curves import describe_motion
from fourbar.show.plot.figures import draw_figure
from fourbar.show.studies import write_equilibria
from fourbar.show.summary import Facts
from fourbar.show.tables import write_cells
from fourbar.solving import find_last_stage
from tests.support.block import read_block
from tests.support.rows import slow_but
from tests.support.scenes import (
    CRANK_ROCKER_LENGTHS,
    CYLINDER,
    MASSLESS,
    PARALLELOGRAM,
    WEIGHT,
    balanced_lamp,
    bare,
    cis,
    crank_rocker,
    find_angle,
    relink,
    thesis,
)


def block(scene, **options):
    return read_block(solve(scene, find_last_stage(scene)), **options)


def move(lengths, effects=(), **motion):
    return Scene(uniform(*lengths), Motion(**motion), effects=effects)


def turn(steps=36, turns=1, **motion):
    return Motion(Sweep(0.0, turns * tau, steps), 10.0, **motion)


def write(angle):
    return f"{degrees(angle):.4g} deg"


OF_THESIS = limit_positions(thesis().linkage)
FIRST, SECOND = (write(x) for x in sorted(x.theta_2 % tau for x in OF_THESIS))
FILES = tomllib.loads("""
["positions alone"]
motion.theta_2 = { from = "0 deg", to = "360 deg", steps = 36 }
says = ['omega_2 = "0 rad/s" gives the static']
never = "drive|pins|rounding"
["one position"]
motion = { theta_2 = "1 rad", omega_2 = "10 rad/s" }
says = [" 47.3346 ", "F12 at O2 "]
never = "peak|RMS|motor"
["a list"]
motion = { theta_2 = ["10 deg", "50 deg", "200 deg"], omega_2 = "10 rad/s" }
says = [
    "3 positions from theta_2 = 10 deg to 200 deg",
    "(of these positions)",
    "peak and RMS are those of these positions",
]
never = "given|mean torque"
["a part"]
motion.theta_2 = { from = "0.5 rad", to = "2 rad", steps = 50 }
motion.omega_2 = "10 rad/s"
says = ["over the sweep given", "input from 28.65 deg to 114.6 deg"]
never = "turn "
["an acceleration"]
motion.theta_2 = { from = "0.5 rad", to = "2 rad", steps = 5 }
motion.omega_2 = "10 rad/s"
motion.alpha_2 = "1 rad/s^2"
says = ["the positions are passed at no one speed: no RMS values, no energies"]
never = "RMS (?!values)"
["two turns"]
motion.theta_2 = { from = "0 deg", to = "720 deg", steps = 72 }
motion.omega_2 = "10 rad/s"
says = ["in 2 turns given"]
never = "of these positions"
["a law"]
motion.law.time = ["0 s", "1 s", "2 s"]
motion.law.theta_2 = ["0.3 rad", "2 rad", "1 rad"]
motion.law.ends = "rest"
motion.law.steps = 20
says = ["by a law over 2 s", "over the motion given", " at t = "]
never = "turns"
["a release"]
motion = { theta_2 = "0.5 rad", free = { duration = "0.5 s", steps = 50 } }
says = ["released for 0.5 s, without a drive", " at 0.29 s "]
never = "torque|power|motor"
["a torque and its mean, of one prefix"]
motion.theta_2 = { from = "0 deg", to = "360 deg", steps = 90 }
motion.omega_2 = "12.5 rad/s"
says = ["torque peak"]
never = 'torque peak \\S+ mN m|RMS \\S+ mN m'
["a parallelogram"]
lengths = { ground = "3 m", input = "1 m", coupler = "3 m", output = "1 m" }
says = ["Parallelogram, open", "change point"]
never = "no theta_3 moves"
["an antiparallelogram"]
lengths = { ground = "3 m", input = "1 m", coupler = "3 m", output = "1 m" }
motion.branch = "crossed"
says = ["Antiparallelogram, crossed", "change point"]
never = "no theta_3 moves"
["a parallelogram by bar 4"]
lengths = { ground = "3 m", input = "1 m", coupler = "3 m", output = "1 m" }
motion.theta_4 = "3.5 rad"
says = ["Parallelogram, open"]
never = "Anti"
["an antiparallelogram by bar 3"]
lengths = { ground = "3 m", input = "1 m", coupler = "3 m", output = "1 m" }
motion.theta_3 = "0.2 rad"
says = ["Antiparallelogram, open", "no theta_3 moves the parallelogram"]
never = "Kite"
["a kite"]
lengths = { ground = "3 m", input = "3 m", coupler = "2 m", output = "2 m" }
says = ["Kite (equal: ground and input; coupler and output)", "change point"]
never = "no theta_3 moves"
["a kite over its change points"]
lengths = { ground = "0.1 m", input = "0.1 m", coupler = "0.3 m", output = "0.3 m" }
motion.omega_2 = "1 rad/s"
says = ["Kite"]
never = 'e-[0-9]+ (?:deg|mm|m|N)\\b'
["a rhombus"]
lengths = { ground = "2 m", input = "2 m", coupler = "2 m", output = "2 m" }
says = ["Rhombus", "change point"]
never = "Kite"
["one change point"]
lengths = { ground = "4 m", input = "1 m", coupler = "2 m", output = "3 m" }
motion.theta_2 = { from = "0 deg", to = "360 deg", steps = 72 }
motion.omega_2 = "1 rad/s"
says = ["the assembly repeats after two turns"]
never = "turns given"
["both turns of one change point"]
lengths = { ground = "0.4 m", input = "0.2 m", coupler = "0.3 m", output = "0.3 m" }
bars.input.mass = "0.2 kg"
bars.coupler.mass = "0.3 kg"
bars.output.mass = "0.3 kg"
motion.omega_2 = "6 rad/s"
effects.gravity = ["9.81 m/s^2", "-90 deg"]
says = ["in 2 turns given", "3.405 J taken back", "mean torque 0 N m"]
never = "of these positions"
["a gripper of CAD"]
pins.O2 = ["38 mm", "69 mm"]
pins.A = ["77.824 mm", "89.953 mm"]
pins.B = ["99.824 mm", "85.954 mm"]
pins.O4 = ["60 mm", "65 mm"]
says = [
    "lengths read as equal within the last decimals of what is stated: ground and",
    "coupler, which differ by 178.9 nm; input and output, which differ by 465.6 nm",
]
never = "misses"
["one pair to the fourth decimal"]
lengths = { ground = "44.7214 mm", input = "22.3607 mm", coupler = "44.7213 mm", \
output = "22.3607 mm" }
says = ["stated: ground and coupler, which differ by 100 nm"]
never = "misses"
["a sum"]
lengths = { ground = "3.333 m", input = "1.3333 m", coupler = "3.0 m", \
output = "1.6667 m" }
says = ["stated: ground + input and coupler + output, which differ by 400 µm"]
never = "misses"
["four"]
lengths = { ground = "10.001 mm", input = "10.0013 mm", coupler = "10.0009 mm", \
output = "10.0011 mm" }
says = [
    "stated: ground and input, which differ by 300 nm; ground and coupler, which",
    "which differ by 100 nm; ground and output, which differ by 100 nm",
]
never = "misses"
["equal in two units"]
lengths = { ground = "3 in", input = "1 in", coupler = "76.2 mm", output = "25.4 mm" }
says = ["Parallelogram"]
never = "read as equal"
["apart"]
lengths = { ground = "300 mm", input = "101 mm", coupler = "0.3 m", output = "10 cm" }
says = ["Rocker-crank"]
never = "read as equal"
["missed"]
lengths = { ground = "22.3607 mm", input = "44.9998 mm", coupler = "22.3605 mm", \
output = "45.0002 mm" }
says = [
    "misses a parallelogram by 600 nm: it has one change point, not two",
    "not two change point at theta_2 = 180 deg",
]
never = "Parallelogram"
["on change points"]
lengths = { ground = "3 m", input = "1 m", coupler = "3 m", output = "1 m" }
motion = { theta_2 = ["0 rad", "1 rad", "180 deg"], omega_2 = "1 rad/s" }
says = ["3 positions: 1 ok, 2 at a change point"]
never = " within "
["a change point to its decimals"]
lengths = { ground = "3 m", input = "1 m", coupler = "3 m", output = "1 m" }
motion = { theta_2 = ["0 rad", "1 rad", "3.14159265359 rad"], omega_2 = "1 rad/s" }
says = ["1 ok, 1 at a change point, 1 within 1.186e-11"]
never = "2 at a change point"
["two to their decimals"]
lengths = { ground = "3 m", input = "1 m", coupler = "3 m", output = "1 m" }
motion = { theta_2 = ["2e-11 rad", "1 rad", "9.42477796077 rad"], omega_2 = "1 rad/s" }
says = ["3 positions: 1 ok, 2 within 1.146e-09 deg"]
never = "at a change point"
["a change point missed"]
lengths = { ground = "3 m", input = "1 m", coupler = "3 m", output = "1 m" }
motion = { theta_2 = ["1 rad", "3.1416 rad"], omega_2 = "1 rad/s" }
says = ["Parallelogram"]
never = " within "
["a release over change points"]
lengths = { ground = "0.3 m", input = "0.1 m", coupler = "0.3 m", output = "0.1 m" }
bars.input.mass = "0.1 kg"
bars.coupler.mass = "0.3 kg"
bars.output.mass = "0.1 kg"
motion.theta_2 = "0.5 rad"
motion.omega_2 = "25 rad/s"
motion.free = { duration = "0.4 s", steps = 50 }
loads = [{ bar = 2, moment = "0.05 N m" }]
effects.gravity = ["9.81 m/s^2", "-90 deg"]
says = ["at a change point pin forces grow without bound"]
never = "motor"
["a release of equal halves, each of which its arm carries"]
lengths = { ground = "0.3 m", input = "0.1 m", coupler = "0.3 m", output = "0.1 m" }
bars.input.mass = "0.1 kg"
bars.coupler.mass = "0.3 kg"
bars.output.mass = "0.1 kg"
motion.theta_2 = "0.5 rad"
motion.omega_2 = "6 rad/s"
motion.free = { duration = "0.5 s", steps = 100 }
effects.gravity = ["9.81 m/s^2", "-90 deg"]
says = ["released"]
never = "without bound"
["strokes"]
motion.stroke = { from = "0.17 m", to = "0.33 m", steps = 40 }
motion.stroke_speed = "0.2 m/s"
motion.side = "left"
drive.from = { bar = 1, from_pin = ["0.25 m", "-160 deg"] }
drive.to = { bar = 2, from_pin = ["0.09 m", "0.17 rad"] }
says = [
    "stroke 170 mm to 330 mm; assembles from 160 mm to 340 mm",
    " N at stroke = 330 mm, RMS",
    "cylinder from bar 1 (ground) to bar 2 (input), 0.2 m/s",
]
never = "motor"
["a cylinder whose sweep begins before the linkage assembles"]
lengths = { ground = "24 in", input = "14 in", coupler = "20 in", output = "16 in" }
bars.output = { mass = "300 lb", centre = ["30 in", "20 deg"] }
motion.theta_4 = { from = "60 deg", to = "110 deg", steps = 50 }
motion.omega_4 = "0.2 rad/s"
drive.from = { bar = 1, from_pin = ["40 in", "-30 deg"] }
drive.to = { bar = 4, from_pin = ["12 in", "-10 deg"] }
effects.gravity = ["1 g_0", "-90 deg"]
# by cosines at 65.05 deg and 110 deg: the weight of 300 lbf 30 in from O4
says = ["stroke 763.8 mm to 870.4 mm", "peak 0.04091 m/s", "W braking, 17.56 W driving"]
never = "745.2"
["a law that goes on where the linkage does not assemble"]
lengths = { ground = "0.6 m", input = "0.3 m", coupler = "0.35 m", output = "0.25 m" }
motion.law = { time = ["0 s", "1 s"], theta_2 = ["20 deg", "140 deg"], ends = "rest" }
says = ["omega 29.93 rpm"]
never = "30 rpm"
["a list of which the linkage does not assemble at the fastest"]
lengths = { ground = "0.6 m", input = "0.3 m", coupler = "0.35 m", output = "0.25 m" }
bars.input.mass = "1 kg"
motion.theta_2 = ["30 deg", "60 deg", "90 deg"]
motion.omega_2 = ["1 rad/s", "1 rad/s", "5 rad/s"]
effects.gravity = ["10 m/s^2", "-90 deg"]
says = [" at 9.549 rpm "]
never = "N m at 47"
["a start, and a position with the rounding of an acceleration"]
motion.theta_2 = ["10 deg", "50 deg"]
motion.omega_2 = ["0 rad/s", "0 rad/s"]
motion.alpha_2 = ["9 rad/s^2", "-1e-14 rad/s^2"]
effects.friction.O2 = "9 N m"
says = ["N m at theta_2 = 10 deg, against", "N m at theta_2 = 50 deg: dry friction"]
never = "without bound"
["at rest beyond a limit"]
lengths = { ground = "0.3 m", input = "0.4 m", coupler = "0.2 m", output = "0.25 m" }
motion.theta_2 = { from = "10 deg", to = "170 deg", steps = 9 }
motion.omega_2 = "0 rad/s"
effects.friction.O4 = "1 N m"
says = ["rest grows without bound at theta_2 = 78.58 deg: dry friction holds"]
never = "stop or start|[kMG]N"
["held across a pole that friction alone has"]
lengths = { ground = "0.3 m", input = "0.1 m", coupler = "0.25 m", output = "0.22 m" }
motion.theta_2 = { from = "0 deg", to = "90 deg", steps = 90 }
motion.omega_2 = "0 rad/s"
drive.bar = 4
effects.friction.O2 = "0.5 N m"
# bars 2 and 3 are in line: cos psi = (d^2 + (a + b)^2 - c^2)/(2 d (a + b))
says = ["rest grows without bound at theta_2 = 38.61 deg: dry", "to move unbounded"]
never = "[kMG]N"
["a start across such a pole"]
lengths = { ground = "0.3 m", input = "0.1 m", coupler = "0.25 m", output = "0.22 m" }
motion.theta_2 = { from = "0 deg", to = "90 deg", steps = 90 }
motion.omega_2 = "0 rad/s"
motion.alpha_2 = "1 rad/s^2"
drive.bar = 4
effects.friction.O2 = "0.5 N m"
says = ["to start grows without bound at theta_2 = 38.61 deg, against"]
never = "holds"
["a law that stands still"]
lengths = { ground = "0.3 m", input = "0.1 m", coupler = "0.25 m", output = "0.22 m" }
motion.law = { time = ["0 s", "1 s"], theta_2 = ["50 deg", "50 deg"], ends = "rest" }
effects.friction.O2 = "0.5 N m"
says = ["at rest -500 mN m to 500 mN m"]
never = "to start"
["at rest at the limit of a stroke"]
lengths = { ground = "0.3 m", input = "0.1 m", coupler = "0.25 m", output = "0.22 m" }
motion.stroke = ["0.34 m", "0.2 m"]
motion.side = "left"
motion.stroke_speed = "0 m/s"
drive.from = { bar = 1, from_pin = ["0.25 m", "-160 deg"] }
drive.to = { bar = 2, from_pin = ["0.09 m", "0.17 rad"] }
effects.friction.O2 = "0.5 N m"
says = ["holds"]
never = "to start"
["a drive that brakes more than it drives"]
lengths = { ground = "0.3 m", input = "0.1 m", coupler = "0.25 m", output = "0.22 m" }
bars.input = { mass = "2 kg", centre = ["0.1 m", "0 deg"] }
motion.theta_2 = { from = "60 deg", to = "180 deg", steps = 5 }
motion.omega_2 = "1 rad/s"
effects.gravity = ["10 m/s^2", "-90 deg"]
says = ["power peak 2 W braking, 1 W driving;", "), 2 W braking, 1 W driving"]
never = "unbounded"
["strokes that nothing loads"]
lengths = { ground = "0.3 m", input = "0.1 m", coupler = "0.25 m", output = "0.22 m" }
motion.stroke = { from = "0.17 m", to = "0.33 m", steps = 40 }
motion.side = "left"
drive.from = { bar = 1, from_pin = ["0.25 m", "-160 deg"] }
drive.to = { bar = 2, from_pin = ["0.09 m", "0.17 rad"] }
says = ["stroke 170 mm to 330 mm; assembles from 160 mm to 340 mm"]
never = "motor"
["nothing acts"]
lengths = { ground = "0.3 m", input = "0.1 m", coupler = "0.25 m", output = "0.22 m" }
motion.theta_2 = { from = "0 deg", to = "360 deg", steps = 36 }
motion.omega_2 = "10 rad/s"
says = ["rates", "omega"]
never = "pins O2|drive on"
["a wheel acts"]
lengths = { ground = "0.3 m", input = "0.1 m", coupler = "0.25 m", output = "0.22 m" }
bars.output.inertia = "0.01 kg m^2"
motion.theta_2 = { from = "0 deg", to = "360 deg", steps = 36 }
motion.omega_2 = "10 rad/s"
says = ["pins", "drive"]
never = "rates"
["a two-force bar"]
lengths = { ground = "2 m", input = "1 m", coupler = "3 m", output = "3 m" }
bars.coupler.mass = "1 kg"
motion.theta_2 = { from = "0 deg", to = "360 deg", steps = 36 }
motion.omega_2 = "10 rad/s"
effects.gravity = ["9.81 m/s^2", "-90 deg"]
says = ["0 N m at x"]
never = "growing without bound"
["a kite on its change point"]
lengths = { ground = "0.3 m", input = "0.3 m", coupler = "0.2 m", output = "0.2 m" }
bars.coupler.mass = "1 kg"
motion = { theta_2 = "0 rad", omega_2 = "1 rad/s" }
says = ["transmission angle 0 deg", "torque 0 N m"]
never = 'e-|-0\\.0000'
""")
"""Scene files, words of their blocks, and a pattern of what must not be said. What
states no linkage is of the crank-rocker.
"""
CRANK_ROCKER_FILE = tomllib.loads(dump(crank_rocker()))
SAID = {
    "three rockers": (
        thesis(Sweep(0.0, tau, 90)),
        [
            f"assembles up to theta_2 = {FIRST}, and from theta_2 = {SECOND}",
            "torque grows without bound at theta_2 = ",
            "transmission angle: at least 0 deg",
            "91 positions: ",
        ],
        "of these positions",
    ),
    "a lamp that a spring balances": (
        balanced_lamp(0.0),
        [" torque peak 0 N m at ", "RMS 0 N m", "the torque is zero within rounding"],
        "without bound|motor|some digits|nN",
    ),
    "a lamp that a spring balances, upheld at its end": (
        replace(
            balanced_lamp(0.0),
            drive_bar=None,
            drive=PointDrive(Place(2, (0.3, 0.0)), 0.5 * pi),
            motion=Motion(Sweep(radians(10.0), radians(150.0), 10), 0.0),
        ),
        ["force peak 0 N at theta_2 = ", ", RMS 0 N "],
        "nN",
    ),
}
"""The same of scenes built in code."""
QUICK = {*FILES, *SAID} - {
    "a law",
    "a release",
    "three rockers",
    "both turns of one change point",
    "a release over change points",
    "a release of equal halves, each of which its arm carries",
}


@mark.parametrize("name", slow_but(QUICK, [*FILES, *SAID]))
def test_the_block_says(name):
    if name in SAID:
        scene, said, unsaid = SAID[name]
    else:
        document = dict(FILES[name])
        said = document.pop("says")
        unsaid = document.pop("never")
        if not {"lengths", "pins"} & document.keys():
            document = CRANK_ROCKER_FILE | document
        scene = read_tables(document)
    text = block(scene)
    for words in said:
        assert words in text, text
    assert not re.search(unsaid, text), text


def test_the_head_of_one_listed_position_has_its_own_rates():
    scene = crank_rocker(Motion([0.2, 1.4], [0.0, 9.0], [3.0, -1.0]))
    text = read_block(solve(scene, at=command(scene).part([0])))
    assert "drive on the input, at rest, alpha_2 = 3 rad/s²" in text
    assert "at rest" not in block(scene) and "-1 rad/s² to 3" in block(scene)


def test_the_block_has_the_numbers_of_the_facts():
    facts = Facts(solve(crank_rocker(turn(360)), "error"))
    text = "\n".join(SceneBlock(facts.solution).write())
    duty = facts.duty
    peak = facts.peak
    torque, rms, most = 1e3 * np.array([peak.value, duty.rms_torque, duty.peak_torque])
    rms, power = f"RMS {rms:.4g} mN m", f"{duty.peak_power:.4g} W"
    swings = f"energy swings by {duty.energy_swing:.4g} J about"
    for words in (
        f"  torque   peak {torque:.4g} mN m at theta_2 = {write(peak.place)}, {rms}\n",
        f"peak {power}; {duty.energy_in:.4g} J per turn given",
        f"{duty.energy_out:.4g} J taken back",
        f"\nmotor: at least {most:.4g} mN m at 95.49 rpm ({rms}), {power}\n",
        # weights and constant couples give back all that they take
        f"cycle    mean torque 0 mN m; {swings}",
        "rounding changes none of these digits",
    ):
        assert words in text
    rows = {line[2:11].strip(): line[11:].split("  ") for line in text.splitlines()}
    peaks = [facts.motion.find_peak(name) for name in PIN_FORCES]
    means = [facts.motion.find_rms(name) for name in PIN_FORCES]
    for label, numbers in (
        ("peak", [f"{load.value:.4g} N" for load in peaks]),
        ("at", [write(load.place) for load in peaks]),
        ("RMS", [f"{mean:.4g} N" for mean in means]),
    ):
        assert [*filter(None, map(str.strip, rows[label]))] == numbers


def test_the_rates_are_the_largest_of_the_bars_that_follow():
    text = block(Scene(MASSLESS, turn()))
    dense = solve(Scene(MASSLESS, turn(20_000)))
    for name, factor, unit in (("omega", 30.0 / pi, "rpm"), ("alpha", 1.0, "rad/s²")):
        rates = factor * np.array([dense[f"{name}_3"], dense[f"{name}_4"]])
        first, second = (rate[abs(rate).argmax()] for rate in rates)
        assert f"{name} {first:.4g} {unit} {second:.4g} {unit} at" in text


@mark.parametrize("steps", [1, 6])
def test_the_range_at_rest_reaches_from_the_least_to_the_greatest_that_is_held(steps):
    """A friction couple of 0.5 N m at O2 holds the static torque within as much."""
    sweep = Motion(Sweep(0.2, 1.4, steps) if steps > 1 else 0.2, 0.0)
    fine = Motion(Sweep(0.2, 1.4, 1000) if steps > 1 else 0.2, 0.0)
    static = solve(crank_rocker(fine, effects=WEIGHT)).torque
    held = crank_rocker(sweep, effects=(*WEIGHT, Friction.at(O2=0.5)))
    digits = 6
    where = ": dry friction holds"
    if steps > 1:
        digits = 4
        where = ", a part of it at each position: dry friction holds"
        assert np.ptp(static) > 0.1
    low, high = 1e3 * (static.min() - 0.5), 1e3 * (static.max() + 0.5)
    said = f"at rest {low:.{digits}g} mN m to {high:.{digits}g} mN m{where}"
    assert said in block(held)


@mark.parametrize("alpha", [30.0, -0.1])
@mark.parametrize("angle", [0.2, [0.2, 1.4]])
def test_a_start_from_rest_works_against_the_whole_of_dry_friction(alpha, angle):
    """Nothing holds it there: 0.2 N m at O2 act against the acceleration."""
    still = Motion(angle, 0.0 * np.array(angle), np.full_like(angle, alpha))
    starts = solve(crank_rocker(still, effects=WEIGHT)).torque
    starts = starts + np.copysign(0.2, alpha)
    largest = starts[abs(starts).argmax()]
    scene = crank_rocker(still, effects=(*WEIGHT, Friction.at(O2=0.2)))
    facts = Facts(solve(scene))
    start = facts.motion.start.value
    assert start == approx(largest, rel=1e-12)
    # a brake is helped by friction
    assert len(starts) == 1 or facts.duty.peak_torque == abs(start)
    text = block(scene)
    assert "to start" in text and "holds" not in text


@mark.slow
def test_each_position_at_rest_has_its_own_range():
    """Pin B stands against the coupler at 0 and 180 deg, pin O4 between positions.

    The torque jumps by each range while B reverses.
    """
    pins = dict.fromkeys(("O2", "A", "B", "O4"), (0.15, 0.005))
    scene = Scene(
        FourBar(0.3, Bar(0.04), Bar(0.29), Bar(0.065)),
        Motion(Sweep(0.0, tau, 72), tau),
        effects=(Friction.at(O4=20.0), PinFriction.at(**pins)),
    )
    ranges = []
    for place, name in ((0.0, "0"), (pi, "180")):
        beside = Motion(place + np.array([-1e-9, 1e-9]), tau)
        low, high = sorted(solve(replace(scene, motion=beside)).torque)
        ranges.append(f"{low:.4g} N m to {high:.4g} N m at theta_2 = {name} deg")
    text = block(scene)
    assert f"range {', '.join(ranges)}: a pin with dry friction rests" in text
    assert "at theta_2 = 0 deg (B), 10.52 deg (O4), 180 deg (B), 188.7 deg (O4)" in text
    assert "of these positions" not in text and "without bound" not in text


def test_what_is_held_or_moved_across_a_pole_has_no_bound():
    """No couple on the output holds the linkage where bars 2 and 3 are in line."""
    still = Motion(Sweep(0.2, 1.4, 7), 0.0)
    held = crank_rocker(
        still, drive_bar=4, effects=(*WEIGHT, Friction.at(O2=0.5, O4=0.5))
    )
    text = block(held)
    assert "torque grows without bound" in text and "dry friction holds" not in text
    assert "to move" in text and " GN" not in text


def test_a_release_that_stops_says_when_and_where():
    """A flywheel of 0.5 kg m^2 under 2 N m: 1 rad/s lasts 0.25 s, over 1/8 rad."""
    stopped = Scene(
        bare(0.1, 0.25, 0.3, 0.28),
        Motion(0.3, 1.0, free=Free(1.0, 50)),
        effects=(Flywheel(0.5), Friction.at(O2=2.0)),
    )
    stop = f"at rest from t = 0.25 s on, at theta_2 = {np.degrees(0.425):.4g} deg;"
    assert stop in block(stopped)


def test_a_reversal_of_a_motion_law_is_named_by_its_time():
    """A sine of 0.5 Hz that begins at 30 deg of its turn turns back at 1/3 s."""
    law = Sine(1.0, 0.7, pi, 0.6, pi / 6.0, steps=30)
    scene = crank_rocker(Motion(law=law), effects=(Friction.at(O2=0.05),))
    said = "reverses, and torque or pin forces jump, at t = "
    assert f"{said}0.3333 s (O2)" in block(scene)
    figure = draw_figure(scene, "kinematics").figure
    assert f"{said}333.3 ms (O2)" in figure.subfigs[0].get_supxlabel()


def test_a_dwell_is_held_by_its_whole_range_and_energy_that_is_rounding_is_zero():
    """Friction of 5 N m at O2 holds; the law comes to rest at 0.3 and 0.8 rad."""
    torques = solve(crank_rocker(Motion([0.3, 0.8], 0.0))).torque
    law = Rise("345", (0.5, 0.2), theta_2=0.3, dwell=0.1, fall=0.1, steps=37)
    effects = (*WEIGHT, Friction.at(O2=5.0))
    text = block(crank_rocker(Motion(law=law), effects=effects))
    first, last = (f"{x - 5.0:.4g} N m to {x + 5.0:.4g} N m" for x in torques)
    at_rest = f"{first} at t = 0 s, {last} over t = 0.2 s to 0.3 s"
    assert f"at rest {at_rest}, {first} at t = 0.4 s: dry" in text
    said = "stop or start, and torque or pin forces jump, at t = "
    assert f"{said}0.2 s (O2), 0.3 s (O2)" in text and "reverses" not in text
    angles = (radians(10.0), radians(70.0))
    lifts = Motion(law=Law((0.0, 2.5), angles, omega_2=(0.0, 0.0)))
    assert "over the motion given, 0 mJ taken back" in block(crank_rocker(lifts))


def test_a_law_that_starts_and_stops_bears_what_stands_beside_these_instants():
    """The start alone is that of a position with its acceleration."""
    law = Law(
        (0.0, 0.2, 0.6, 0.65), (1.2, 1.4, 2.2, 2.25), omega_2=(0.0, 2.0, 2.0, 0.0)
    )
    effects = (*WEIGHT, Friction.at(O2=0.5, O4=0.5))
    scene = crank_rocker(Motion(law=law), effects=effects)
    inside = solve(scene, at=command_at(scene, np.linspace(1e-9, 0.65 - 1e-9, 4001)))
    for pin in PIN_FORCES:
        largest = np.hypot(*np.transpose(inside[pin])).max()
        peak = describe_motion(solve(scene)).find_peak(pin)
        assert peak.value == approx(largest, rel=1e-4)
    first = solve(scene, at=command_at(scene, np.zeros(1)))
    alone = Motion(1.2, 0.0, float(first.alpha_2[0]))
    starts = Facts(solve(crank_rocker(alone, effects=effects))).motion.start
    assert Facts(first).motion.start.value == approx(starts.value, rel=1e-12)
    last = Facts(solve(scene, at=command_at(scene, np.array([0.65])))).motion
    assert isnan(last.start.value)  # it stops there
    (way,) = last.started
    assert way.solution.torque[0] == approx(inside.torque[-1], rel=1e-6)


CORNERS = tuple(np.radians((0.0, 95.0, 101.3, 107.0, 360.0)))
SPIKE = Load(2, moment=-1.0, table=Table(CORNERS, (1.0, 1.0, 50.0, 1.0, 1.0)))
"""A couple on the crank that is largest between two positions."""


@mark.parametrize("senses, alpha", [((-1, 1), 0.0), ((-1,), -1.0), ((1,), 1.0)])
def test_a_bore_at_rest_moves_the_linkage_against_its_friction(senses, alpha):
    """An acceleration says which way it starts."""
    motion = Motion(Sweep(1.0, 2.6, 8), 0.0, alpha)
    rubbing = {"loads": (SPIKE,), "effects": (Friction.at(O2=5.0),), "drive": CYLINDER}
    speed = 1e-9 * np.array(senses)
    creeping = crank_rocker(Motion(0.0 * speed + CORNERS[2], speed, alpha), **rubbing)
    creeps = solve(creeping)
    force = abs(creeps.drive_force).max()
    pin = np.hypot(*creeps.F12.T).max()
    bore = 1e3 * sqrt(4.0 * force / (pi * 210e5))
    text = block(crank_rocker(motion, **rubbing), pressure=210e5)
    assert f"to move {pin:.4g} N" in text
    assert re.search(rf"{bore:.4g} mm\b[^;]* to pull {force:.4g} N", text)


def test_a_bore_pushes_and_pulls_the_most_of_a_motion():
    coarse, fine = (
        crank_rocker(Motion(Sweep(1.0, 2.6, steps), 10.0), drive=CYLINDER)
        for steps in (8, 4000)
    )
    force = solve(fine).drive_force
    text = block(coarse, pressure=1e5)
    for does, most in (("push", force.max()), ("pull", -force.min())):
        bore = 1e3 * sqrt(4.0 * most / (pi * 1e5))
        assert re.search(rf"{bore:.4g} mm\b[^;]* to {does} {most:.4g} N", text)


@mark.parametrize("angle", (Sweep(1.0, 2.6, 8), 1.7))
def test_pins_and_bars_at_rest_bear_what_moves_them_against_friction(angle):
    """The peaks of the motion either way, slow enough for its inertia not to show."""
    effects = (*WEIGHT, PinFriction.at(A=(0.3, 0.02), B=(0.2, 0.03)))
    rubbing = {"loads": (SPIKE,), "effects": effects, "drive": CYLINDER}
    coupler = replace(crank_rocker().linkage.coupler, section=(0.02, 0.01))
    at_rest, *ways = (
        solve(relink(crank_rocker(Motion(angle, speed), **rubbing), coupler=coupler))
        for speed in (0.0, 1e-9, -1e-9)
    )
    lines = SceneBlock(at_rest, units("N N.m Pa")).write()
    rows = [line for line in lines if line.startswith("  to move")]
    names = [*PIN_FORCES], ["bending_2", "bending_3", "bending_4"]
    motions = [Facts(way).motion for way in ways]
    for row, group in zip(rows, names, strict=True):
        sizes = [[motion.find_peak(name).value for motion in motions] for name in group]
        printed = [float(size) for size in re.findall(r"\d[\d.]*", row)]
        assert printed == approx(np.max(sizes, axis=1), rel=2e-4)
    *_, stress = (line for line in lines if line.startswith("  stress"))
    largest = np.max(sizes[1]) / (0.01 * 0.02**2 / 6.0)
    assert float(stress.split()[2]) == approx(largest, rel=2e-4)
    assert "to move" not in block(crank_rocker(Motion(angle, 0.0)))


@mark.parametrize(
    "speeds, alpha, senses",
    [
        ([0.0, 2.0], [30.0, 0.0], [1.0]),
        ([2.0, 0.0], [0.0, -30.0], [1.0]),
        ([2.0, 0.0, -2.0], [0.0, -30.0, 0.0], [1.0, -1.0]),
    ],
)
def test_a_list_bears_the_friction_of_its_start_and_stop(speeds, alpha, senses):
    angles = np.linspace(0.2, 1.4, len(speeds))
    rubs = {"effects": (*WEIGHT, PinFriction.at(A=(0.3, 0.02)))}
    rests = Motion(angles, speeds, alpha)
    facts = Facts(solve(crank_rocker(rests, **rubs)))
    creeps = [np.where(rests.omega_2, speeds, 1e-9 * sense) for sense in senses]
    ways = [solve(crank_rocker(rests.replace(omega_2=way), **rubs)) for way in creeps]
    lines = SceneBlock(facts.solution, units("N")).write()
    row = next(line for line in lines if line.startswith("  to move"))
    pins = [np.max([np.hypot(*way[name].T) for way in ways]) for name in PIN_FORCES]
    assert [float(size) for size in re.findall(r"\d[\d.]*", row)] == approx(pins, 2e-4)
    torque = np.max(np.abs([way.torque for way in ways]))
    assert facts.duty.peak_torque == approx(torque, rel=1e-6)
    assert ("to start" in "".join(lines)) == (speeds[-1] != 0.0)


def test_a_torque_that_friction_just_holds_is_zero_within_rounding():
    load = Load(2, (100.0, 0.0), from_pin=(0.0, 0.0), moment=-0.3)
    held = Friction.at(O2=0.1 + 0.2)
    scene = Scene(MASSLESS, Motion(1.0, 0.0), loads=(load,), effects=(held,))
    assert "at rest 0 mN m to 600 mN m" in block(scene)


@mark.slow
@mark.parametrize("bar", (2, 3))
def test_a_cylinder_assembles_from_where_its_ends_meet(bar):
    """The ends lie as far from O2, or the ground's end is on the path of the other,
    which passes it at theta_2 = 40 deg.
    """
    scene = move(CRANK_ROCKER_LENGTHS, WEIGHT, theta_2=Sweep(1.0, 2.0, 10), omega_2=0.0)
    ground = Place(1, (0.1, -1.5))
    if bar == 3:
        met = solve(replace(scene, motion=Motion(radians(40.0))))
        z = 0.1 * cis(met.theta_2[0]) + 0.1 * cis(met.theta_3[0])
        ground = Place(1, (abs(z), np.angle(z)))
    drive = LinearDrive(ground, Place(bar, (0.1, 0.0)))
    pushed = replace(scene, drive_bar=None, drive=drive)
    low, high = Facts(solve(pushed)).stroke_limits
    assert low == 0.0 and "assembles from 0 mm to" in block(pushed)
    assert bar == 3 or high == approx(0.2, rel=1e-12)


@mark.parametrize("number, branch", [(0, -1), (1, 1)])
@mark.parametrize("bar", (3, 4))
def test_a_cylinder_assembles_over_the_circuit_of_its_motion(bar, number, branch):
    """The rocker has two ranges, which the crank's line mirrors, each a branch of the
    crank, whose whole turn passes both of the rocker's.
    """
    low, high = find_intervals(MASSLESS, 4)[number]
    drive = LinearDrive(Place(1, (0.5, 0.3)), Place(bar, (0.1, 0.0)))

    def move(**motion):
        return Facts(solve(Scene(MASSLESS, Motion(**motion), drive=drive)))

    turned = move(theta_2=Sweep(0.0, tau, 4000), branch=branch)
    stroke = turned.solution.stroke
    ends = approx((stroke.min(), stroke.max()), rel=1e-6)
    assert turned.stroke_limits == ends
    starts = 0.5 * (low + high), low, np.nextafter(low, -tau)
    for start, of_rocker in zip(starts, (1, -1, 1), strict=True):
        swept = move(theta_4=Sweep(start, high - 1e-9, 3), branch=of_rocker)
        assert swept.stroke_limits == ends


def test_a_cylinder_assembles_over_two_turns_beside_a_change_point():
    """A turn of the crank leads to the mirror image, a second one back."""
    linkage = uniform(0.3, 0.1, 0.35, 0.15)
    drive = LinearDrive(Place(1, (0.5, 0.3)), Place(4, (0.1, 0.0)))
    facts = Facts(solve(Scene(linkage, Motion(Sweep(0.0, 2 * tau, 8000)), drive=drive)))
    stroke = facts.solution.stroke
    assert facts.stroke_limits == approx((stroke.min(), stroke.max()), rel=1e-6)


@mark.parametrize("away", (1e-6, 1e-9, 1e-10, 1e-11))
def test_digits_left_are_those_that_the_error_bar_leaves(away):
    """A torque on bar 4 beside its dead centre, where bars 2 and 3 are in line."""
    motion = {"theta_2": find_angle(0.22, 0.3, 0.35) + away, "omega_2": 3.0}
    scene = replace(move(CRANK_ROCKER_LENGTHS, WEIGHT, **motion), drive_bar=4)
    s = solve(scene, "error")
    digits = floor(log10(abs(s.torque[0]) / s.torque_error[0]))
    assert (digits < 8) == (away < 1e-8)
    said = f"{digits} digits left of T4 at" in block(scene)
    assert said == (digits < 8)


def test_a_spring_that_the_cylinder_holds_end_to_end_loads_no_pin():
    """Massless bars, and both ends in common: what is left at the pins is rounding."""
    effects = (Springs((Spring(CYLINDER.start, CYLINDER.end, 1e5, 0.5),)),)
    scene = Scene(
        MASSLESS, Motion([0.1, 0.4, 0.7], 1.0), drive=CYLINDER, effects=effects
    )
    s = solve(scene)
    assert s.drive_force == approx(1e5 * (s.stroke - 0.5), rel=1e-12)
    text = block(scene)
    assert text.count("0 N ") > 4 and "e-1" not in text.split("rounding")[0]
    assert "bending" not in text and "rounding changes none" in text


def test_a_cell_that_is_rounding_of_its_column_is_zero_without_a_sign():
    values = np.array([0.0392, -1.7e-16, -0.0, np.nan, 0.02])
    assert write_cells(values) == ["0.0392", "0", "0", "-", "0.02"]
    assert write_cells(np.array([12.0, -1e-5, 30.0]), ".4f")[1] == "0.0000"
    assert write_cells(np.array([10.0] * 99 + [1e15]))[0] == "10"


@mark.parametrize("name, branch", (("open", 1), ("crossed", -1)))
def test_equilibria_are_named_as_a_scene_states_their_assembly(name, branch):
    """On either side of a change point, where the sine of mu has another sign."""
    scene = move(PARALLELOGRAM, WEIGHT, branch=branch)
    rows = write_equilibria("", equilibrium(scene)).splitlines()
    named = [row.split()[2] for row in rows if re.search(r" (un)?stable ", row)]
    assert len(named) > 1 and {*named} == {name}
