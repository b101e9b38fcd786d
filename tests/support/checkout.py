"""The files of the checkout, and Python in a process of its own."""

import os
import re
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
LOAD = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
BUSY = max(1.0, LOAD / (os.cpu_count() or 1))
"""Factor of time on cores that others use too."""


def read(name):
    """Return the text of a file, by its path or its name in the checkout."""
    return (ROOT / name).read_text("utf-8")


def find_lines(pattern, text):
    """Return what a pattern matches in a text, ^ and $ at the ends of its lines."""
    return re.findall(pattern, text, re.MULTILINE)


def read_table(page, name):
    """Return the cells of each row of a table of data in the text of a page."""
    table = page.partition(f"<!-- data {name} -->")[2].partition("<!-- end -->")[0]
    lines = table.strip().splitlines()[2:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def read_complaint(capsys):
    """Return the one line that a command complained with."""
    (line,) = capsys.readouterr().err.splitlines()
    return line


def wait_until(ready, seconds):
    """Wait until something is so, and fail if it takes longer."""
    latest = time.monotonic() + seconds
    while not ready():
        assert time.monotonic() < latest
        time.sleep(0.01)


def run_line(line, folder=ROOT, **how):
    """Run a program, and return how it ended."""
    return subprocess.run(
        line, cwd=folder, capture_output=True, text=True, check=False, **how
    )


def run_python(*words, folder=ROOT, **variables):
    """Run Python with further variables in its environment, and return how it ended."""
    line = [sys.executable, *map(str, words)]
    return run_line(line, folder, env=os.environ | variables)


def join_paths(*folders):
    """Return a PYTHONPATH of some folders and those of the packages."""
    return os.pathsep.join(map(str, (*folders, ROOT, ROOT / "validation")))
