"""The same suite under another Python: what does upgrading an engine change for my linkages?"""

import subprocess
from collections.abc import Sequence
from pathlib import Path

from fourbar.errors import DependencyError, InputError

CHECKOUT = Path(__file__).parent.parent.parent
NEEDS = "numpy, pint, click, rich, jinja2, pebble, filelock, pyarrow and the engines"


class ElsewhereError(DependencyError):
    """The other environment could not run the suite."""


def run_elsewhere(python: Path, arguments: Sequence[str], out: Path) -> Path:
    """Run `python -m validation run` of this checkout under another interpreter; the folder of its results.

    Raises InputError where there is no such interpreter, ElsewhereError where it does not get
    through the suite (comparisons that fail are results, not an error).
    """
    if not python.is_file():
        raise InputError("--python", str(python), "must be a Python interpreter, such as .venv-old/bin/python")
    results = out / "results.csv"
    results.unlink(missing_ok=True)  # of an earlier run; what is there afterwards is of this one
    command = [str(python.absolute()), "-m", "validation", "run", *arguments, "--out", str(out.absolute())]
    try:
        done = subprocess.run(command, cwd=CHECKOUT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, check=False)
    except OSError as error:
        raise InputError("--python", str(python), f"cannot be run: {error.strerror}") from None
    if done.returncode not in (0, 1) or not results.is_file():
        words = done.stderr.decode(errors="replace").strip().splitlines()
        reason = words[-1].removeprefix("error: ") if words else f"exit status {done.returncode}"
        raise ElsewhereError(f"{python}: the suite did not run there: {reason} (it needs {NEEDS})")
    return out
