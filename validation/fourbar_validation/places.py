"""Locate this package, the models, and the checkout that contains both.

CHECKOUT is None where the package is installed without one.
"""

import sys
from pathlib import Path

import fourbar
from fourbar.errors import FourBarError

PACKAGE = Path(__file__).resolve().parent
FORMULAS_FOLDER = Path(fourbar.__file__).resolve().parent
CHECKOUT = None if (PACKAGE / "models" / "problems").is_dir() else PACKAGE.parents[1]
"""The folder of pyproject.toml, models, tests and docs. None if the package is
installed, with the models in it.
"""
MODELS = PACKAGE / "models" if CHECKOUT is None else CHECKOUT / "models"


def find_program(started: str) -> str:
    """Return the command that starts the harness, for messages.

    The file that was started (`sys.argv[0]`) tells which of the two it is.
    """
    if Path(started).parts[-2:] == ("validation", "__main__.py"):
        return "python -m validation"
    return "fourbar-validation"


HARNESS_PROGRAM = find_program(sys.argv[0] if sys.argv else "")
"""Command that started the harness."""


def find_checkout(what: str) -> Path:
    """Return the checkout.

    Raises a FourBarError that says what needs one, if there is none.
    """
    if CHECKOUT is None:
        raise FourBarError(
            f"{what} needs a checkout of the repository; this is the installed package"
        )
    return CHECKOUT
