"""The errata of the sources, as data: `errata.toml` says what each field is."""

import tomllib
from pathlib import Path
from typing import NamedTuple


class Erratum(NamedTuple):
    """One error of a source."""

    id: str
    where: str
    title: str
    printed: str
    right: str
    derivation: str
    effect: str
    reproduced: bool = True
    """Whether making the error gives the printed digits."""
    transcription: bool = False
    """Whether it may be a slip of the transcription that was read."""


DATA = tomllib.loads((Path(__file__).parent / "errata.toml").read_text(encoding="utf-8"))
ERRATA = {entry["id"]: Erratum(**entry) for entry in DATA["erratum"]}
