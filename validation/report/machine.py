"""Where a run was made: versions and machine, printed on top of every report."""

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGES = {"fourbar": "fourbar", "numpy": "numpy", "mujoco": "mujoco", "pinocchio": "pin", "scipy": "scipy"}
"""Name in the report and name of the distribution."""
WHERE_INSTALLED = ("drake", "exudyn", "opensim")
"""Distributions that need not be there."""


def versions() -> dict[str, str]:
    """Version of Python and of every library that decides a number; "not installed" where missing."""
    found = {"python": platform.python_version()}
    for name, distribution in (PACKAGES | {name: name for name in WHERE_INSTALLED}).items():
        try:
            found[name] = version(distribution)
        except PackageNotFoundError:
            if name in PACKAGES:
                found[name] = "not installed"
    return found


def machine() -> str:
    """Processor, number of cores and system, in one line."""
    return f"{_processor()}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}"


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or "unknown processor"
