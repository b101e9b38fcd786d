"""Processor time of commands as a ratio of `import numpy`, measured in turns."""

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from fourbar_validation.places import MODELS

SCENE = MODELS / "crank_rocker.toml"
_ROW_STEP = 10
"""Rows of the sweep's table of which `check` gets one: 37 rows, as a table by hand."""


def measure_starts(rounds: int = 7) -> dict[str, float]:
    """Return the processor time of each command over that of `import numpy`.

    The medians of `rounds` ratios, each of two processes that follow one another.
    """
    with TemporaryDirectory() as folder:
        table = Path(folder) / "table.csv"
        csv = [sys.executable, "-m", "fourbar", "analyze", str(SCENE), "--csv"]
        written = subprocess.run(csv, capture_output=True, check=True, text=True)
        head, *rows = written.stdout.splitlines()
        table.write_text("\n".join([head, *rows[::_ROW_STEP]]), encoding="utf-8")
        commands = {
            "fourbar --help": ("fourbar", "--help"),
            "fourbar-validation --help": ("fourbar_validation", "--help"),
            "analyze": ("fourbar", "analyze", str(SCENE)),
            "check": ("fourbar_validation", "check", str(SCENE), str(table)),
        }
        ratios: dict[str, list[float]] = {name: [] for name in commands}
        for words in commands.values():
            _spend(("-m", *words))  # compiles what is not compiled yet
        for _ in range(rounds):
            for name, words in commands.items():
                numpy = _spend(("-c", "import numpy"))
                ratios[name].append(_spend(("-m", *words)) / numpy)
    return {f"{name} / import numpy": median(of) for name, of in ratios.items()}


def _spend(words: Sequence[str]) -> float:
    """Run Python and return its processor time, s."""
    environment = dict(os.environ)
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    before = os.times()
    subprocess.run(
        [sys.executable, *words],
        capture_output=True,
        check=True,
        env=environment,
    )
    after = os.times()
    return (
        after.children_user
        - before.children_user
        + after.children_system
        - before.children_system
    )
