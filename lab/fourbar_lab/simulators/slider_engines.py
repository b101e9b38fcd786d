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
from fourbar_validation.compare.rows import say_error

GAP_AT_THE_END = 1e-15
"""Gap at which Newton's method ends, in parts of the rod's length."""
NEWTON_STEPS_OF_A_POSITION = 50
ANSWERED_QUANTITIES = (
    "theta_3",
    "stroke",
    "torque",
    "F12",
    "F32",
    "F43",
    "guide_force",
)


class SliderBar(NamedTuple):
    """One bar: mass, kg; inertia about its mass centre, kg m^2; and the centre.

    The mass centre is from its first pin, along and across, m.
    """

    mass: float
    inertia: float
    centre: tuple[float, float]


class _CutLoop(Protocol):
    """Interface of an engine to the slider-crank's tree, cut at the rod's end.

    Three joints turn the crank and the rod and move the slider.
    """

    def set(self, q: Array, v: Array) -> None:
        """Set joint positions and speeds."""

    def gap(self) -> tuple[Array, Array, Array]:
        """Return the rod's end less the slider (2,), its Jacobian and its drift.

        The Jacobian is (2, 3); the drift (2,) is the acceleration while all of q have
        none.
        """

    def inverse(self, a: Array) -> Array:
        """Return the joint forces of accelerations a, without the closing force."""

    def borne(self, a: Array, closing: Array) -> tuple[Array, Array, Array]:
        """Return the force of each body on the next, (2,) each, in N.

        Forces are of ground on the crank, the crank on the rod, and the guide on the
        slider.
        """


def describe_bodies(
    scene: dict[str, Any],
) -> tuple[list[SliderBar], tuple[float, float, float], Array, Array]:
    """Return the bodies, (crank, rod, offset) in m, gravity and the slider's force.

    Gravity (2,) is in m/s^2 and the force (2,) in N.
    """
    lengths = scene["lengths"]
    bodies = []
    for name in ("crank", "rod", "slider"):
        bar = scene.get("bars", {}).get(name, {})
        length = lengths.get(name, 0.0)
        mass = bar.get("mass", 0.0)
        r, phi = bar.get("centre", (0.5 * length, 0.0))
        bodies.append(
            SliderBar(
                mass,
                bar.get("inertia", mass * length**2 / 12.0),
                (r * math.cos(phi), r * math.sin(phi)),
            )
        )
    field = _direct(*scene.get("effects", {}).get("gravity", (0.0, 0.0)))
    loads = scene.get("loads", ())
    if any(load["bar"] != 4 or "table" in load or load.get("moment") for load in loads):
        raise LimitError("a force on the slider is the only load here")
    push = sum((_direct(*load["force"]) for load in loads), np.zeros(2))
    return (
        bodies,
        (lengths["crank"], lengths["rod"], lengths.get("offset", 0.0)),
        field,
        push,
    )


def _direct(size: float, angle: float) -> Array:
    return size * np.array([math.cos(angle), math.sin(angle)])


def answer_slider_positions(
    make: Callable[..., _CutLoop],
    question: dict[str, Any],
) -> dict[str, Any]:
    """Answer the positions of a question."""
    scene = question["scene"]
    command = question["command"]
    bodies, lengths, field, push = describe_bodies(scene)
    tree = make(bodies, lengths, field, push)
    crank, rod, _ = lengths
    rows: dict[str, list[Any]] = {name: [] for name in ANSWERED_QUANTITIES}
    n = len(command["theta_2"])
    omegas = np.broadcast_to(command.get("omega_2", 0.0), n)
    alphas = np.broadcast_to(command.get("alpha_2", 0.0), n)
    branches = np.broadcast_to(command.get("branch", 1), n)
    for theta, omega, alpha, branch in zip(
        command["theta_2"],
        omegas,
        alphas,
        branches,
        strict=True,
    ):
        rod_angle = 0.0 if branch > 0 else math.pi
        q = np.array(
            [
                theta,
                rod_angle - theta,
                crank * math.cos(theta) + branch * rod,
            ]
        )
        _close_slider(tree, q, GAP_AT_THE_END * rod)
        tree.set(q, np.zeros(3))
        _, J, _ = tree.gap()
        following = np.linalg.solve(J[:, 1:], -J[:, 0] * omega)
        v = np.array([omega, *following])
        tree.set(q, v)
        _, J, drift = tree.gap()
        following = np.linalg.solve(J[:, 1:], -J[:, 0] * alpha - drift)
        a = np.array([alpha, *following])
        matrix = np.column_stack([J.T, [1.0, 0.0, 0.0]])
        *closing, torque = np.linalg.solve(matrix, tree.inverse(a))
        F12, F23, guide = tree.borne(a, np.array(closing))
        values = (
            math.remainder(q[0] + q[1], math.tau),
            q[2],
            torque,
            F12.tolist(),
            (-F23).tolist(),
            closing,
            guide[1],
        )
        for name, value in zip(ANSWERED_QUANTITIES, values, strict=True):
            rows[name].append(value)
    answers = {name: np.array(values).tolist() for name, values in rows.items()}
    return {"answers": answers}


def _close_slider(tree: _CutLoop, q: Array, least: float) -> None:
    """Close the gap by the rod and the slider, in place."""
    for _ in range(NEWTON_STEPS_OF_A_POSITION):
        tree.set(q, np.zeros(3))
        apart, J, _ = tree.gap()
        step = np.linalg.solve(J[:, 1:], -apart)
        q[1:] += step
        if np.abs(step).max() <= least:
            break


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
