"""Processor time of commands as a ratio of `import numpy`, measured in turns."""

import os
import subprocess
import sys
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from fourbar_validation.places import MODELS

SCENE = str(MODELS / "crank_rocker.toml")
_ROW_STEP = 10
"""Rows of the sweep's table of which `check` gets one: 37 rows, as a table by hand."""
_IMPORT = """
import time
a = time.process_time()
import numpy
b = time.process_time()
from fourbar import Motion, Scene, solve, uniform
print((time.process_time() - b) / (b - a))
"""
"""Program that prints the time of `import fourbar` beyond NumPy's, over NumPy's."""


def measure_starts(rounds: int = 7) -> dict[str, float]:
    """Return the processor time of an import and of each command over that of NumPy.

    The medians of `rounds` ratios, each of two processes that follow one another.
    """
    with TemporaryDirectory() as folder:
        table = Path(folder) / "table.csv"
        head, *rows = _run("-m", "fourbar", "analyze", SCENE, "--csv").splitlines()
        table.write_text("\n".join([head, *rows[::_ROW_STEP]]), encoding="utf-8")
        commands = {
            "fourbar --help": ("fourbar", "--help"),
            "fourbar-validation --help": ("fourbar_validation", "--help"),
            "analyze": ("fourbar", "analyze", SCENE),
            "check": ("fourbar_validation", "check", SCENE, str(table)),
        }
        ratios: dict[str, list[float]] = {name: [] for name in commands}
        ratios["import fourbar"] = []
        for words in commands.values():
            _run("-m", *words)  # compiles what is not compiled yet
        for _ in range(rounds):
            ratios["import fourbar"].append(float(_run("-c", _IMPORT)))
            for name, words in commands.items():
                numpy = _spend("-c", "import numpy")
                ratios[name].append(_spend("-m", *words) / numpy)
    return {f"{name} / import numpy": median(of) for name, of in ratios.items()}


def _run(*words: str) -> str:
    """Run Python, which may write compiled modules, and return what it prints."""
    environment = dict(os.environ)
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    done = subprocess.run(
        [sys.executable, *words],
        capture_output=True,
        check=True,
        encoding="utf-8",
        env=environment,
    )
    return done.stdout


def _spend(*words: str) -> float:
    """Run Python and return its processor time, s.

    `os.times` counts it in ticks of 10 ms, a seventh of what an import of NumPy takes.
    """
    import resource  # Windows has none

    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    _run(*words)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
