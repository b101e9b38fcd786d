"""Words that several parts of a report share."""

import re
from collections import Counter

_NUMBER = r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
NUMBERS_IN_A_REASON = re.compile(rf"{_NUMBER}(?:\W+{_NUMBER})*")
"""Pattern of a number in a reason, or of a list. Reasons that differ in numbers alone
count as one.
"""


class AlikeTexts:
    """Texts counted by their words: those that differ in numbers alone count as one."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self._first: dict[str, str] = {}
        self._differing: set[str] = set()

    def add(self, text: str) -> None:
        """Take in a text."""
        words = NUMBERS_IN_A_REASON.sub("#", text)
        self._counts[words] += 1
        if self._first.setdefault(words, text) != text:
            self._differing.add(words)

    def list_all(self) -> list[tuple[str, int]]:
        """List the first of each kind of texts, and their count, the commonest first.

        A text says if the others have other numbers.
        """
        listed = []
        for words, count in self._counts.most_common():
            others = ", with other numbers in the others" * (words in self._differing)
            listed.append((self._first[words] + others, count))
        return listed
