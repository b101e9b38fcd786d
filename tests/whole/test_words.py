"""Words that need decoding stay out: each has a better one."""

import re
from collections.abc import Collection, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BETTER = {
    "told": "given, set, reported, distinguished",
    "asked": "requested, stated, required",
    "way": "direction, sense, method, reading",
    "ways": "directions, methods",
    "beside": "near, next to",
    "room": "space, margin, layer",
    "rooms": "layers",
    "leaning": "inclined",
    "begun": "started",
    "rounded_anew": "rounded again",
    "unsettled": "undecided",
    "said": "stated, named, reported",
}
"""Words of this project alone, and words that a mechanical engineer uses for the same."""
STORED = ("asked: float", "self.asked", '"asked", "error"')
"""A column that `advise-study` stores."""
KINDS = {".py", ".md", ".toml", ".js", ".css", ".html", ".j2", ".yml"}
GENERATED = {"docs/examples"}
WORDS = re.compile(rf"(?<![a-z])({'|'.join(BETTER)})(?![a-z])", re.IGNORECASE)


def texts() -> Iterator[tuple[str, str]]:
    """Name and text of every file whose words a reader meets."""
    for top in ("fourbar", "validation", "tests", "docs", "README.md", "CHANGELOG.md"):
        for path in sorted((ROOT / top).rglob("*")) or [ROOT / top]:
            name = path.relative_to(ROOT).as_posix()
            if path.suffix in KINDS and path != Path(__file__) and not within(name, GENERATED):
                yield name, path.read_text(encoding="utf-8")


def within(name: str, folders: Collection[str]) -> bool:
    return any(name == folder or name.startswith(f"{folder}/") for folder in folders)


def found(text: str) -> list[str]:
    """Each line that holds a banned word, with the better ones."""
    for stored in STORED:
        text = text.replace(stored, re.sub(r"\S", "-", stored))
    lines = enumerate(text.splitlines(), 1)
    hits = ((number, line, match) for number, line in lines for match in WORDS.finditer(line))
    return [
        f"{number}: {match[0]} (better: {BETTER[match[0].lower()]}): {line.strip()}" for number, line, match in hits
    ]


def test_words_that_need_decoding_stay_out() -> None:
    wrong = [f"{name}:{line}" for name, text in texts() for line in found(text)]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize(
    ("line", "count"),
    [("x = asked_for + BESIDE", 2), ("half-way, always away", 1), ("class Told: ...", 1), ('row["asked", "error"]', 0)],
)
def test_a_banned_word_is_found_in_names_and_sentences(line: str, count: int) -> None:
    assert len(found(line)) == count
