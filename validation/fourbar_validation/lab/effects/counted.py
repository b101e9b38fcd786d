"""Instructions of one workload: valgrind, of the work alone.

Wall clock on a busy machine scatters by a third; instructions repeat to some 0.01 % where hashing
and addresses are fixed (PYTHONHASHSEED, setarch -R) and one thread runs.
"""

import platform
import re
import shutil
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from fourbar.errors import DependencyError, FourBarError
from fourbar_validation.lab.effects.work import POSITIONS
from fourbar_validation.lab.stress.against import ONE_THREAD
from fourbar_validation.run.elsewhere import ended, of_the_harness

AMOUNTS = {"formulas": (1, 5), "mujoco-simulated": (10, 210), "mujoco-inverse": (5, 45), "pinocchio-inverse": (5, 45)}
"""Two amounts of work, in steps or positions, of the formulas in thousands of positions: their difference counts."""
BRACKET = "ffi_call"
"""The function of libffi within which a workload runs."""
REPEATS = 1e-3
"""Counts of the same work differ by this part at least, whatever the machine."""


def available() -> bool:
    """Whether instructions can be counted here."""
    return shutil.which("valgrind") is not None and shutil.which("setarch") is not None


def counts(engine: str, effects: Sequence[str], root: Path | None = None) -> dict[str, float]:
    """Instructions of each effect per step or position, from another checkout where one is given."""
    if not available():
        raise DependencyError("valgrind and setarch are needed to count instructions")
    few, many = AMOUNTS[engine]
    settings = dict.fromkeys(ONE_THREAD, "1") | {"PYTHONHASHSEED": "0", "PYTHONDONTWRITEBYTECODE": "1"}
    with tempfile.TemporaryDirectory() as folder:  # MuJoCo writes its log where it runs
        command = ["setarch", platform.machine(), "-R", "valgrind", "--tool=callgrind", "--callgrind-out-file=counted"]
        command += ["--collect-atstart=no", f"--toggle-collect={BRACKET}", f"--dump-after={BRACKET}"]
        command += [sys.executable, "-m", "fourbar_validation.lab.effects.work", engine, str(few), str(many), *effects]
        if root is None:
            done = of_the_harness(command, folder=Path(folder), variables=settings)
        else:
            done = ended(command, folder=Path(folder), variables=settings | {"PYTHONPATH": str(root)})
        dumps = sorted(Path(folder).glob("counted.*"), key=lambda path: int(path.suffix[1:]))
        totals = [re.findall(r"^totals: (\d+)", dump.read_text(), re.MULTILINE) for dump in dumps[-2 * len(effects) :]]
    if done.why or len(totals) < 2 * len(effects) or not all(totals):
        raise FourBarError(f"{engine} with {', '.join(effects)} did not run under valgrind: {done.why}")
    each = iter(int(total[-1]) for total in totals)
    units = (many - few) * (POSITIONS if engine == "formulas" else 1)
    return {effect: (more - less) / units for effect, less, more in zip(effects, each, each, strict=False)}
