"""Slider-cranks served by the protocol.

`python -m fourbar_lab.simulators.slider_engines mujoco | pinocchio` starts the program.
The loop is cut at B: crank and rod in series, the slider on its guide. Each engine
finds its own position, speeds and accelerations, and the closing force and the torque
by its inverse dynamics; what each bar bears it reads itself.
"""

import json
import math
import os
import sys
from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import IO, Any, NamedTuple, Protocol

import numpy as np

from fourbar.errors import LimitError
from fourbar.quantities import Array
from fourbar_lab.simulators.slider_crank import SLIDER_CRANK_UNITS
from fourbar_validation.compare.rows import say_error

GAP_AT_THE_END = 1e-15
"""Gap at which Newton's method ends, in parts of the rod's length."""
NEWTON_STEPS_OF_A_POSITION = 50
ANSWERED_QUANTITIES = tuple(SLIDER_CRANK_UNITS)


class SliderBar(NamedTuple):
    """One bar: mass, kg; inertia about its mass centre, kg m^2; and the centre.

    The mass centre is from its first pin, along and across, m.
    """

    mass: float
    inertia: float
    centre: list[float]


class SliderCrank(NamedTuple):
    """The description, SI units."""

    crank: float
    rod: float
    offset: float
    bars: list[SliderBar]
    """Crank, rod and slider."""
    gravity: Array
    """(2,), m/s^2."""
    push: Array
    """Force on the slider, (2,), N."""


class CutLoop(Protocol):
    """The slider-crank as the tree of an engine, cut at the rod's end.

    Three joints turn the crank and the rod and move the slider. Ends of the cut are the
    rod's (0) and the slider's (1).
    """

    def set(self, q: Array, v: Array) -> None:
        """Set joint positions and speeds."""

    def follow(self, end: int) -> tuple[Array, Array, Array]:
        """Return place (2,), Jacobian (2, 3) and drift (2,) of an end of the cut.

        The drift is the acceleration while all of q have none.
        """

    def inverse(self, a: Array) -> Array:
        """Return the joint forces (3,) of accelerations a, with no force at the cut."""

    def borne(self, a: Array, on_ends: tuple[Array, Array]) -> list[Array]:
        """Return the force of each body on the next, (2,), N, with forces at the ends.

        Forces are of ground on the crank, the crank on the rod, and the guide on the
        slider.
        """


def describe(scene: dict[str, Any]) -> SliderCrank:
    """Return what a scene of the protocol states."""
    lengths = scene["lengths"]
    bars = []
    for name in ("crank", "rod", "slider"):
        bar = scene.get("bars", {}).get(name, {})
        length = lengths.get(name, 0.0)
        mass = bar.get("mass", 0.0)
        centre = _direct(*bar.get("centre", (0.5 * length, 0.0)))
        inertia = bar.get("inertia", mass * length**2 / 12.0)
        bars.append(SliderBar(mass, inertia, centre.tolist()))
    loads = scene.get("loads", ())
    if any(load["bar"] != 4 or "table" in load or load.get("moment") for load in loads):
        raise LimitError("a force on the slider is the only load here")
    return SliderCrank(
        lengths["crank"],
        lengths["rod"],
        lengths.get("offset", 0.0),
        bars,
        _direct(*scene.get("effects", {}).get("gravity", (0.0, 0.0))),
        sum((_direct(*load["force"]) for load in loads), np.zeros(2)),
    )


def _direct(size: float, angle: float) -> Array:
    return size * np.array([math.cos(angle), math.sin(angle)])


def answer_slider_positions(
    make: Callable[[SliderCrank], CutLoop],
    question: dict[str, Any],
) -> dict[str, Any]:
    """Answer the positions of a question."""
    linkage = describe(question["scene"])
    tree = make(linkage)
    command = question["command"]
    positions = np.broadcast_arrays(
        command["theta_2"],
        command.get("omega_2", 0.0),
        command.get("alpha_2", 0.0),
        command.get("branch", 1),
    )
    rows = [
        answer_position(tree, linkage, *row) for row in zip(*positions, strict=True)
    ]
    columns = zip(*rows, strict=True)
    answers = zip(ANSWERED_QUANTITIES, map(np.array, columns), strict=True)
    return {"answers": {name: values.tolist() for name, values in answers}}


def answer_position(
    tree: CutLoop,
    linkage: SliderCrank,
    theta: float,
    omega: float,
    alpha: float,
    branch: int,
) -> tuple[Any, ...]:
    """Answer one position, in the order of `ANSWERED_QUANTITIES`."""
    rod_angle = 0.0 if branch > 0 else math.pi
    stroke = linkage.crank * math.cos(theta) + branch * linkage.rod
    q = np.array([theta, rod_angle - theta, stroke])
    for _ in range(NEWTON_STEPS_OF_A_POSITION):
        tree.set(q, np.zeros(3))
        apart, J, _ = _measure_gap(tree)
        step = np.linalg.solve(J[:, 1:], -apart)
        q[1:] += step
        if np.abs(step).max() <= GAP_AT_THE_END * linkage.rod:
            break
    tree.set(q, np.zeros(3))
    _, J, _ = _measure_gap(tree)
    v = np.array([omega, *np.linalg.solve(J[:, 1:], -J[:, 0] * omega)])
    tree.set(q, v)
    _, J, drift = _measure_gap(tree)
    a = np.array([alpha, *np.linalg.solve(J[:, 1:], -J[:, 0] * alpha - drift)])
    _, of_slider, _ = tree.follow(1)
    needed = tree.inverse(a) - of_slider.T @ linkage.push
    matrix = np.column_stack([J.T, [1.0, 0.0, 0.0]])
    *closing, torque = np.linalg.solve(matrix, needed)
    F43 = np.array(closing)
    F12, F23, guide = tree.borne(a, (F43, linkage.push - F43))
    theta_3 = math.remainder(q[0] + q[1], math.tau)
    return theta_3, q[2], torque, F12, -F23, F43, guide[1]


def _measure_gap(tree: CutLoop) -> list[Array]:
    """Return the rod's end less the slider (2,), its Jacobian and its drift."""
    ends = zip(tree.follow(0), tree.follow(1), strict=True)
    return [of_rod - of_slider for of_rod, of_slider in ends]


def serve_slider_crank(
    hello: dict[str, Any],
    answer: Callable[[dict[str, Any]], dict[str, Any]],
    questions: IO[bytes],
    replies: IO[bytes],
) -> None:
    """Answer line by line."""
    for line in questions:
        question = json.loads(line)
        reply = hello
        if question["ask"] == "answer":
            try:
                reply = answer(question)
            except LimitError as limit:
                reply = {"refusal": str(limit)}
            except Exception as error:
                reply = {"error": say_error(error)}
        elif question["ask"] != "hello":
            reply = {"refusal": f"{question['ask']} is not answered here"}
        text = json.dumps({"id": question["id"], **reply}, allow_nan=False)
        replies.write(text.encode() + b"\n")
        replies.flush()


if __name__ == "__main__":
    with os.fdopen(os.dup(1), "wb") as stdout:
        os.dup2(2, 1)  # an engine's prints are no answer
        module = import_module(f"fourbar_lab.simulators.slider_{sys.argv[1]}")
        loop = getattr(module, f"{sys.argv[1].capitalize()}Slider")
        hello = {
            "engine": sys.argv[1],
            "version": module.VERSION,
            "answers": list(ANSWERED_QUANTITIES),
            "mechanisms": ["slider-crank"],
            "effects": ["gravity", "loads"],
        }
        serve_slider_crank(
            hello,
            partial(answer_slider_positions, loop),
            sys.stdin.buffer,
            stdout,
        )
