"""Two slider-cranks of the set of problems, as data, and their answers.

Free bodies in fifty digits give the answers.

Crank O2-A of length a, rod A-B of length b, slider with its pin and mass centre at B on
the line y = offset. The product knows four-bars alone: these answers share nothing with
its formulas.
"""

import math
from typing import Any

import numpy as np

REFERENCE_DIGITS = 50
SLIDER_CRANK_CONVENTIONS = (
    "SI units, radians, world axes x and y, angles counter-clockwise from x. Pins: O2"
    " at the origin, A, B; bars: 1 the ground with the guide y = offset, 2 crank O2-A,"
    " 3 rod A-B, 4 slider, whose pin and mass centre are B; theta_3 points from A to B."
    " branch 1: B right of A, -1: left. stroke: x of B. What a bar leaves out is as in"
    " a four-bar's scene: inertia m L^2/12 about the mass centre, centre [r, angle]"
    " from the first pin and line mid-bar. Loads act at the mass centre. Fij: force of"
    " bar i on bar j. torque: the couple that the ground exerts on the crank."
    " guide_force: of the guide on the slider, along y; the guide has no friction."
    " error: how far off the value may be; of a vector, its Euclidean norm."
)
CRANK_ANGLES = [math.radians(15.0 * step) for step in range(25)]
SLIDER_CRANKS: dict[str, dict[str, Any]] = {
    "slider_crank": {
        "title": "A slider-crank in line",
        "source": (
            "this project, after public questions about loops with a slider: Genesis"
            " issues 1911 and 1993, PMKSWeb issue 42, mujoco_warp issue 1487, newton"
            " issue 3745."
        ),
        "scene": {
            "lengths": {"crank": 0.05, "rod": 0.2, "offset": 0.0},
            "bars": {
                "crank": {"mass": 0.3},
                "rod": {"mass": 0.5, "centre": [0.08, 0.0]},
                "slider": {"mass": 0.4},
            },
            "effects": {"gravity": [9.81, -0.5 * math.pi]},
        },
        "command": {
            "theta_2": CRANK_ANGLES,
            "omega_2": 20.0,
            "alpha_2": 0.0,
            "branch": 1,
        },
    },
    "slider_crank_offset": {
        "title": "A slider-crank with an offset and a load on the slider",
        "source": (
            "this project: slider_crank with its guide 20 mm above the crank's pin, a"
            " rod whose mass centre lies off its line, an accelerating crank and a"
            " force of 100 N on the slider."
        ),
        "scene": {
            "lengths": {"crank": 0.05, "rod": 0.2, "offset": 0.02},
            "bars": {
                "crank": {"mass": 0.3, "inertia": 1e-4, "centre": [0.01, 0.5]},
                "rod": {"mass": 0.5, "inertia": 2e-3, "centre": [0.08, 0.2]},
                "slider": {"mass": 0.4},
            },
            "loads": [{"bar": 4, "force": [100.0, math.pi]}],
            "effects": {"gravity": [9.81, -0.5 * math.pi]},
        },
        "command": {
            "theta_2": CRANK_ANGLES,
            "omega_2": 20.0,
            "alpha_2": 50.0,
            "branch": 1,
        },
    },
}
SLIDER_CRANK_UNITS = {
    "theta_3": "rad",
    "stroke": "m",
    "torque": "N m",
    "F12": "N",
    "F32": "N",
    "F43": "N",
    "guide_force": "N",
}


def make_problem(name: str) -> dict[str, Any]:
    """Make the problem: what is stated, and its answers, each rounded once."""
    stated = SLIDER_CRANKS[name]
    command = stated["command"]
    rates = command["omega_2"], command["alpha_2"], command["branch"]
    rows = [
        solve_free_bodies(stated["scene"], theta, *rates)
        for theta in command["theta_2"]
    ]
    answers = {
        quantity: [row[quantity] for row in rows] for quantity in SLIDER_CRANK_UNITS
    }
    errors = {
        quantity: [math.ulp(max(map(abs, np.atleast_1d(value)))) for value in values]
        for quantity, values in answers.items()
    }
    return {
        "conventions": SLIDER_CRANK_CONVENTIONS,
        "mechanism": "slider-crank",
        "ask": "answer",
        **stated,
        "answers": answers,
        "errors": errors,
        "units": SLIDER_CRANK_UNITS,
    }


def solve_free_bodies(
    scene: dict[str, Any],
    theta_2: float,
    omega_2: float,
    alpha_2: float,
    branch: int,
) -> dict[str, Any]:
    """Solve the free bodies of slider, rod and crank in turn at one position.

    The slider gives the force at B along the guide, the moment of the rod about A that
    across it, and the sums of forces and moments the others.
    """
    from mpmath import mp, mpc, mpf

    with mp.workdps(REFERENCE_DIGITS):
        lengths = scene["lengths"]
        a = mpf(lengths["crank"])
        b = mpf(lengths["rod"])
        offset = mpf(lengths["offset"])
        g = _resolve_force(*scene.get("effects", {}).get("gravity", (0.0, 0.0)))
        theta = mpf(theta_2)
        omega = mpf(omega_2)
        alpha = mpf(alpha_2)
        sine = (offset - a * mp.sin(theta)) / b
        cosine = branch * mp.sqrt(1 - sine * sine)
        crank = a * mp.expj(theta)
        rod = b * mpc(cosine, sine)
        omega_3 = -omega * crank.real / rod.real
        sideways = omega**2 * crank.imag - alpha * crank.real
        alpha_3 = (sideways + omega_3**2 * rod.imag) / rod.real
        at_A = (1j * alpha - omega**2) * crank
        at_B = at_A + (1j * alpha_3 - omega_3**2) * rod
        forces = []
        moments = []
        arms = []
        for name, line, rate, growth, start in (
            ("crank", crank, omega, alpha, 0),
            ("rod", rod, omega_3, alpha_3, at_A),
            ("slider", 0, 0, 0, at_B),
        ):
            bar = scene["bars"].get(name, {})
            mass = mpf(bar.get("mass", 0.0))
            length = abs(line)
            r, phi = bar.get("centre", (0.5 * length, 0.0))
            arm = mpc(0)
            if length:
                arm = r * mp.expj(phi) * line / length
            acceleration = start + (1j * growth - rate**2) * arm
            inertia = mpf(bar.get("inertia", mass * length**2 / 12))
            forces.append(mass * (acceleration - g))
            moments.append(inertia * growth)
            arms.append(arm)
        for load in scene.get("loads", ()):  # at the mass centre
            forces[load["bar"] - 2] -= _resolve_force(*load["force"])
        of_crank, of_rod, of_slider = forces
        along = -of_slider.real
        about_A = moments[1] + _cross(arms[1], of_rod)
        F43 = mpc(along, (about_A + rod.imag * along) / rod.real)
        F32 = F43 - of_rod
        F12 = of_crank - F32
        torque = moments[0] + _cross(arms[0], of_crank) - _cross(crank, F32)
        angle = mp.atan2(sine, cosine)
        stroke = (crank + rod).real
        pins = [[float(F.real), float(F.imag)] for F in (F12, F32, F43)]
        guide = of_slider.imag + F43.imag
    values = float(angle), float(stroke), float(torque), *pins, float(guide)
    return dict(zip(SLIDER_CRANK_UNITS, values, strict=True))


def _cross(arm: Any, force: Any) -> Any:
    """Return the moment of a force at the end of an arm."""
    return arm.real * force.imag - arm.imag * force.real


def _resolve_force(size: float, direction: float) -> Any:
    """Resolve a force into components.

    One that the direction as a double cannot tell from zero is zero.
    """
    from mpmath import mp, mpf

    return size * mp.chop(mp.expj(direction), mpf(2) ** -53)
