"""Printed answers of public test cases, listed in `textbook.toml`, against ours."""

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

    @cache
    def solve_scene(name: str) -> fourbar.Solution:
        return fourbar.solve(fourbar.load(TEXTBOOK_FOLDER / f"{name}.toml"))

    for answer in list_answers():
        solution = solve_scene(answer.scene)
        ours = _compute_value(solution, answer.quantity, answer.position)
        name = f"{answer.scene} {answer.quantity}"
        yield PublishedFigure("public test cases", name, answer.printed, ours)


def _compute_value(solution: fourbar.Solution, quantity: str, position: int) -> float:
    """Compute a result, its negative, or the difference of two, at one position."""
    total = -0.0  # leaves a single term as it is, a zero with its sign too
    for term in quantity.replace("- ", "-").split():
        name = term.removeprefix("-")
        axis = COMPONENT_AXES.get(name[-2:])
        if axis is None:
            value = float(solution[name][position])
        else:
            value = float(solution[name[:-2]][position, axis])
        total += value if name == term else -value
    return total
