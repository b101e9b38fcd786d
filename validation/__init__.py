"""The cross-check of the formulas against engines that know nothing of them."""

from validation.compare.answer import Answer as Answer
