"""Printed answers of public test cases, and of a Maple worksheet, against ours.

The test cases are listed in `textbook.toml`.
"""

import json
import math
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import fourbar
from fourbar_validation.places import MODELS
from fourbar_validation.published.figures import PublishedFigure

TEXTBOOK_FOLDER = MODELS / "textbook"
PRINTED_ANSWERS = Path(__file__).parent / "textbook.toml"
_SHEET = Path(__file__).parent / "data" / "maple.json"
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
    return [
        _TextbookAnswer(**entry)
        for entry in tomllib.loads(PRINTED_ANSWERS.read_text(encoding="utf-8"))[
            "answer"
        ]
    ]


def compare_textbooks() -> Iterator[PublishedFigure]:
    """Compare each answer with ours."""
    for answer in list_answers():
        ours = compute_value(
            _solve_book_scene(answer.scene),
            answer.quantity,
            answer.position,
        )
        yield PublishedFigure(
            "public test cases",
            f"{answer.scene} {answer.quantity}",
            answer.printed,
            ours,
        )


def compute_value(
    solution: fourbar.Solution,
    quantity: str,
    position: int,
) -> float:
    """Compute a result, its negative, or the difference of two, at one position."""
    first, minus, second = quantity.partition(" - ")
    if minus:
        return compute_value(solution, first, position) - compute_value(
            solution,
            second,
            position,
        )
    if quantity.startswith("-"):
        return -compute_value(solution, quantity[1:], position)
    name, axis = (
        (quantity[:-2], COMPONENT_AXES[quantity[-2:]])
        if quantity[-2:] in COMPONENT_AXES
        else (quantity, None)
    )
    values = getattr(solution, name)
    return float(values[position] if axis is None else values[position, axis])


@cache
def _solve_book_scene(scene: str) -> fourbar.Solution:
    return fourbar.solve(fourbar.load(TEXTBOOK_FOLDER / f"{scene}.toml"))


def compare_maple() -> Iterator[PublishedFigure]:
    """Compute the worksheet's two solutions of positions, theta_1 = 0, rad.

    The constant of its real equation is computed too.
    """
    sheet = json.loads(_SHEET.read_text(encoding="utf-8"))
    a, b, c, d = (float(sheet["inputs"][name]) for name in "abcd")
    theta_2 = math.pi / 3.0
    linkage = fourbar.FourBar(
        d,
        fourbar.Bar(a),
        fourbar.Bar(b),
        fourbar.Bar(c),
    )
    real = sheet["reduced_equations"]["real_constant"]
    yield PublishedFigure(
        "Maple",
        "real constant",
        real,
        a * math.cos(theta_2) - d,
    )
    for branch, solution in zip((1, -1), sheet["solutions"], strict=True):
        s = fourbar.solve(
            fourbar.Scene(linkage, fourbar.Motion(theta_2, branch=branch))
        )
        for name, angle in (("theta3", s.theta_3), ("theta4", s.theta_4)):
            key = f"{solution['configuration']} {name}"
            yield PublishedFigure(
                "Maple",
                key,
                solution[f"{name}_printed_rad"],
                float(angle[0]),
            )
