"""Printed answers of public test cases, listed in `textbook.toml`, against ours."""

import re
import tomllib
from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import fourbar
from fourbar_validation.places import MODELS
from fourbar_validation.published.printed_figures import FOLDER, PublishedFigure

TEXTBOOK_FOLDER = MODELS / "textbook"
_TERM = re.compile(r"(-?) ?(\w+?)(?:_([xy]))?(?: |$)")
"""Term of a quantity: its sign, the name of a result, and its component."""


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
    """Compare each answer with ours: a result, its negative, or a difference of two."""

    @cache
    def solve_scene(name: str) -> fourbar.Solution:
        return fourbar.solve(fourbar.load(TEXTBOOK_FOLDER / f"{name}.toml"))

    for answer in list_answers():
        ours = 0.0
        for minus, result, axis in _TERM.findall(answer.quantity):
            value = solve_scene(answer.scene)[result][answer.position]
            if axis:
                value = value["xy".index(axis)]
            ours += -value if minus else value
        name = f"{answer.scene} {answer.quantity}"
        yield PublishedFigure("public test cases", name, answer.printed, float(ours))
