"""The cross-check of the formulas against engines that know nothing of them."""

from fourbar.errors import (
    FourBarError as FourBarError,
)  # before the libraries: an interruption meanwhile is one line
from fourbar_validation.compare.answer import Answer as Answer
