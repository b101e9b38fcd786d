"""Printed answers of public test cases against ours; `textbook.toml` lists them with their addresses."""

import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import fourbar
from validation.published.figures import Figure

SCENES = Path(__file__).parent.parent.parent / "models" / "textbook"
ANSWERS = Path(__file__).parent / "textbook.toml"
AXES = {"_x": 0, "_y": 1}


class Answer(NamedTuple):
    """A printed answer."""

    scene: str
    quantity: str
    position: int
    printed: str
    where: str
    note: str = ""


def answers() -> list[Answer]:
    """All of them."""
    return [Answer(**entry) for entry in tomllib.loads(ANSWERS.read_text(encoding="utf-8"))["answer"]]


def textbook_figures() -> Iterator[Figure]:
    """Each answer and ours."""
    for answer in answers():
        ours = value(_solved(answer.scene), answer.quantity, answer.position)
        yield Figure("public test cases", f"{answer.scene} {answer.quantity}", answer.printed, ours)


def value(solution: fourbar.Solution, quantity: str, position: int) -> float:
    """A result, its negative, or the difference of two, at one position."""
    first, minus, second = quantity.partition(" - ")
    if minus:
        return value(solution, first, position) - value(solution, second, position)
    if quantity.startswith("-"):
        return -value(solution, quantity[1:], position)
    name, axis = (quantity[:-2], AXES[quantity[-2:]]) if quantity[-2:] in AXES else (quantity, None)
    found: Any
    if name == "v_A":
        assert solution.omega_2 is not None
        found = solution.omega_2[:, None] * np.stack([-solution.A[:, 1], solution.A[:, 0]], axis=1)
    else:
        found = getattr(solution, name)
    return float(found[position] if axis is None else found[position, axis])


@cache
def _solved(scene: str) -> fourbar.Solution:
    return fourbar.solve(fourbar.load(SCENES / f"{scene}.toml"))
