"""Scenes that several tests share, built in code."""

from dataclasses import replace
from math import acos, pi, radians, tau

import numpy as np

import fourbar
from fourbar import (
    Bar,
    FourBar,
    Friction,
    Gravity,
    LinearDrive,
    Load,
    Motion,
    Place,
    Point,
    Scene,
    Spring,
    Springs,
    Sweep,
    uniform,
)
from tests.support.checkout import ROOT

EPS = 2.0**-52
CRANK_ROCKER_LENGTHS = (0.3, 0.1, 0.25, 0.22)
PARALLELOGRAM = (0.3, 0.1, 0.3, 0.1)
UNIFORM = uniform(*CRANK_ROCKER_LENGTHS)
UNIFORM_PARALLELOGRAM = uniform(*PARALLELOGRAM)
WEIGHT = (Gravity(),)
"""What acts, alone."""
ON_COUPLER = LinearDrive(Place(1, (0.25, -2.8)), Place(3, (0.09, 0.17)))
"""A cylinder from the ground to the coupler."""
CYLINDER = LinearDrive(Place(1, (0.25, radians(-160.0))), Place(2, (0.09, 0.17)))
"""From the ground to the input of the crank-rocker."""


A_TURN = Motion(Sweep(0.1, 0.1 + 2 * pi, 60), 10.0, 5.0)


def crank_rocker(motion=A_TURN, **changes):
    """A crank-rocker with gravity, an offset mass centre, a force and a couple."""
    linkage = FourBar(
        0.3,
        Bar(0.1, 0.2),
        Bar(0.25, 0.5, 0.004, (0.13, 0.3)),
        Bar(0.22, 0.4),
        ground_angle=0.2,
    )
    parts = {
        "linkage": linkage,
        "loads": (Load(4, (3.0, 0.7), arm=(0.05, 1.0)), Load(3, moment=-0.2)),
        "effects": WEIGHT,
        "title": "crank-rocker",
    }
    return Scene(motion=motion, **parts | changes)


RESTING = crank_rocker(
    Motion(radians(40.0), 0.0),
    effects=(Gravity(), Friction.at(O2=0.2)),
)
"""Held by the drive and by dry friction, whose couple at O2 is up to 0.2 N m."""


def cis(angle):
    """Return the unit vector of an angle as a complex number."""
    return np.exp(1j * angle)


def find_angle(side, first, second):
    """Return the angle between two sides of a triangle, opposite to the third."""
    return acos((first**2 + second**2 - side**2) / (2.0 * first * second))


def meet_circles(near, far, r_near, r_far, side=1.0):
    """Return the point at two distances from two points, to the left of their line.

    `side`: -1 to the right.
    """
    apart = abs(far - near)
    along = (r_near**2 - r_far**2 + apart**2) / (2.0 * apart)
    across = side * np.sqrt(r_near**2 - along**2)
    return near + (far - near) / apart * (along + 1j * across)


def bare(d, a, b, c, theta_1=0.0):
    """Make a linkage of bars without mass."""
    return FourBar(d, *(Bar(length) for length in (a, b, c)), ground_angle=theta_1)


MASSLESS = bare(*CRANK_ROCKER_LENGTHS)


def draw_linkage(rng, integers=False):
    """Draw lengths that can close, of 0.1 to 1 or of whole numbers, and theta_1."""
    while True:
        lengths = rng.integers(1, 7, 4) if integers else rng.uniform(0.1, 1.0, 4)
        if 2.0 * lengths.max() < lengths.sum() - (0.0 if integers else 0.01):
            return bare(*map(float, lengths), float(rng.uniform(-pi, pi)))


def balance(left, omega_2=0.01):
    """Make a crank whose counterweight leaves a part of its weight's moment."""
    linkage = FourBar(
        0.3,
        Bar(0.1, 0.5, 0.001, (0.1 * (1.0 - left), pi)),
        Bar(0.25, 0.5, 0.004, (0.0, 0.0)),
        Bar(0.22, 0.4, 0.002, (0.0, 0.0)),
    )
    return Scene(linkage, Motion(Sweep(0.1, 0.1 + tau, 36), omega_2), effects=WEIGHT)


def balanced_lamp(omega_2=None):
    """Make a lamp that a spring of no free length balances: k = m g l/(r h)."""
    arms = Bar(0.3), Bar(0.06, 2.0), Bar(0.3)
    linkage = FourBar(0.06, *arms, 0.5 * pi)
    ends = Place(1, (0.1, 0.0)), Place(2, (0.08, 0.0))
    spring = Spring(*ends, 2.0 * 9.81 * 0.3 / (0.08 * 0.1))
    swept = Sweep(radians(-40.0), radians(60.0), 10)
    effects = (Gravity(), Springs((spring,)))
    return Scene(linkage, Motion(swept, omega_2), effects=effects)


TURN = crank_rocker(
    Motion(Sweep(0.1, 0.1 + tau, 24), 10.0),
    points=(Point("P", 3, (0.1, 0.7)), Point("J", 4, (0.05, 0.2))),
)
"""A turn of the crank-rocker with points on coupler and output."""


def recommand(scene, **changes):
    """Return a scene with the fields of its motion changed."""
    return replace(scene, motion=scene.motion.replace(**changes))


def relink(scene, **changes):
    """Return a scene with parts of its linkage changed."""
    return replace(scene, linkage=replace(scene.linkage, **changes))


def low_parallelogram():
    """Return a parallelogram below its ground's line, beyond a change point.

    The assembly is "open", and the sine between bars 3 and 4 is negative all the way:
    told the name of the assembly in place of that sign, an engine answers the
    antiparallelogram.
    """
    ground_angle = 0.2
    linkage = replace(UNIFORM_PARALLELOGRAM, ground_angle=ground_angle)
    start, stop = np.radians([200.0, 340.0]) + ground_angle
    return Scene(
        linkage,
        Motion(Sweep(start, stop, 8), 6.0),
        effects=WEIGHT,
        title="parallelogram below its ground",
    )


def thesis(theta_2=None):
    """Return the thesis's model mechanism at these positions, or at one."""
    scene = fourbar.load(ROOT / "models" / "thesis.toml")
    angles = np.radians([135.0]) if theta_2 is None else theta_2
    motion = scene.motion.replace(angle=angles)
    return replace(scene, motion=motion, title="thesis", source="")


def change_place(load, change):
    """Return the place of a load changed, in the form in which it is stated."""
    stated = {form: getattr(load, form) for form in ("from_pin", "from_centre", "arm")}
    return {form: change(*place) for form, place in stated.items() if place}


def mirrored(scene):
    """Return the scene with y to -y.

    Angles, couples, speeds and the branch change sign. Effects other than gravity stay:
    they must have no side.
    """
    linkage, motion = scene.linkage, scene.motion
    bars = {}
    for name in ("input", "coupler", "output"):
        bar = getattr(linkage, name)
        r, phi = bar.mass_centre
        bars[name] = replace(bar, centre=(r, -phi))
    loads = []
    for load in scene.loads:
        place = change_place(load, lambda r, phi: (r, -phi))
        force = load.force and (load.force[0], -load.force[1])
        loads.append(replace(load, force=force, moment=-load.moment, **place))
    effects = []
    for effect in scene.effects:
        turned = isinstance(effect, Gravity)
        effects.append(replace(effect, angle=-effect.angle) if turned else effect)
    return replace(
        scene,
        linkage=replace(linkage, ground_angle=-linkage.ground_angle, **bars),
        motion=motion.replace(
            angle=-fourbar.command(scene).theta_2,
            speed=-motion.omega_2,
            acceleration=-motion.alpha_2,
            branch=-motion.branch,
        ),
        loads=tuple(loads),
        effects=tuple(effects),
    )
