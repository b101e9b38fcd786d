"""Printed answers of public test cases, and of a Maple worksheet, against ours.

The test cases are listed in `textbook.toml`.
"""

import math
import tomllib
from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import fourbar
from fourbar_validation.places import MODELS
from fourbar_validation.published.printed_figures import FOLDER, PublishedFigure

TEXTBOOK_FOLDER = MODELS / "textbook"
COMPONENT_AXES = {"_x": 0, "_y": 1}


class _TextbookAnswer(NamedTuple):
    """A printed answer."""

    scene: str
    quantity: str
    position: int
    printed: str
    where: str
    note: str = ""


def list_answers() -> list[_TextbookAnswer]:
    """List all of them."""
    text = (FOLDER / "textbook.toml").read_text(encoding="utf-8")
    return [_TextbookAnswer(**entry) for entry in tomllib.loads(text)["answer"]]


def compare_textbooks() -> Iterator[PublishedFigure]:
    """Compare each answer with ours."""
    for answer in list_answers():
        solution = _solve_book_scene(answer.scene)
        ours = compute_value(solution, answer.quantity, answer.position)
        name = f"{answer.scene} {answer.quantity}"
        yield PublishedFigure("public test cases", name, answer.printed, ours)


def compute_value(solution: fourbar.Solution, quantity: str, position: int) -> float:
    """Compute a result, its negative, or the difference of two, at one position."""
    first, minus, second = quantity.partition(" - ")
    value = _compute_term(solution, first, position)
    return value - _compute_term(solution, second, position) if minus else value


def _compute_term(solution: fourbar.Solution, term: str, position: int) -> float:
    name = term.removeprefix("-")
    axis = COMPONENT_AXES.get(name[-2:])
    if axis is None:
        value = float(getattr(solution, name)[position])
    else:
        value = float(getattr(solution, name[:-2])[position, axis])
    return value if name == term else -value


@cache
def _solve_book_scene(scene: str) -> fourbar.Solution:
    return fourbar.solve(fourbar.load(TEXTBOOK_FOLDER / f"{scene}.toml"))


def compute_worksheet() -> dict[str, float]:
    """Compute the worksheet's two solutions of positions, theta_1 = 0, rad.

    The constant of its real equation is computed too.
    """
    d = 3.0
    a = 0.8
    b = 2.5
    c = 2.0
    theta_2 = math.pi / 3.0
    linkage = fourbar.FourBar(d, fourbar.Bar(a), fourbar.Bar(b), fourbar.Bar(c))
    ours = {"real constant": a * math.cos(theta_2) - d}
    for name, branch in (("open", 1), ("crossed", -1)):
        motion = fourbar.Motion(theta_2, branch=branch)
        s = fourbar.solve(fourbar.Scene(linkage, motion))
        ours[f"{name} theta3"] = float(s.theta_3[0])
        ours[f"{name} theta4"] = float(s.theta_4[0])
    return ours
