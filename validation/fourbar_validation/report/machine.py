"""Describe where and with what a run was made.

Stated are versions, machine, and this code.
"""

import ctypes
import hashlib
import os
import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from fourbar_validation.places import FORMULAS_FOLDER, PACKAGE

REPORTED_DISTRIBUTIONS = {
    "fourbar": "fourbar",
    "numpy": "numpy",
    "mujoco": "mujoco",
    "pinocchio": "pin",
    "scipy": "scipy",
}
"""Name in the report and name of the distribution."""
DISTRIBUTIONS = REPORTED_DISTRIBUTIONS | {
    name: name for name in ("drake", "exudyn", "opensim")
}
"""Distribution of each package, including those that need not be installed."""


def list_versions() -> dict[str, str]:
    """List the versions of Python and of every library that decides a number.

    A missing one is "not installed".
    """
    versions = {"python": platform.python_version()}
    for name, package in DISTRIBUTIONS.items():
        try:
            versions[name] = version(package)
        except PackageNotFoundError:
            if name in REPORTED_DISTRIBUTIONS:
                versions[name] = "not installed"
    return versions


def name_machine() -> str:
    """Name processor, number of cores and system in one line."""
    return (
        f"{_find_processor()}, {os.cpu_count()} cores, {platform.system()}"
        f" {platform.machine()}"
    )


def describe_setup() -> str:
    """Name versions and machine, for the foot of a page."""
    return (
        ", ".join(f"{name} {version}" for name, version in list_versions().items())
        + f"; {name_machine()}"
    )


def _find_processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or "unknown processor"


def find_kernels() -> dict[str, str]:
    """Return the BLAS kernel and vector instructions that NumPy uses, by name.

    Other kernels give other last digits.
    """
    import numpy as np

    config: dict[str, Any] = np.show_config(mode="dicts")  # type: ignore[assignment]
    simd = config["SIMD Extensions"]
    kernels = {
        "cpu_features": " ".join((*simd.get("baseline", ()), *simd.get("found", ())))
    }
    kernel = find_blas()
    return kernels | ({"blas_kernel": kernel} if kernel else {})


def find_blas() -> str:
    """Return the kernel of NumPy's OpenBLAS, such as "openblas SkylakeX", or ""."""
    import numpy as np

    folder = (
        Path(np.__file__).parents[1] / "numpy.libs"
    )  # Windows looks for no symbol in what a library loads
    for file in (
        *folder.glob("*openblas*.dll"),
        Path(np._core._multiarray_umath.__file__),  # type: ignore[attr-defined]
    ):
        library = ctypes.CDLL(str(file))
        for name in (
            f"{prefix}openblas_get_corename{ending}"
            for prefix in ("scipy_", "")
            for ending in ("64_", "")
        ):
            if (get_name := getattr(library, name, None)) is not None:
                get_name.restype = ctypes.c_char_p
                return f"openblas {get_name().decode()}"
    return ""


@cache
def name_code(*further: Path) -> dict[str, str]:
    """Name everything that decides a number, with version or hash, for a run.

    `further`: packages among it.
    """
    return {"code": hash_modules(FORMULAS_FOLDER, PACKAGE, *further), **list_versions()}


def hash_modules(*packages: Path) -> str:
    """Hash the files of packages that numbers come from, wherever they lie.

    Templates, accepted states and the scenes that come with a wheel change none.
    """
    digest = hashlib.sha256()
    for package in packages:
        for path in sorted(package.rglob("*")):
            if (
                path.suffix in (".py", ".toml")
                and path.is_file()
                and package / "models" not in path.parents
            ):
                data = path.read_bytes()
                place = path.relative_to(package.parent).as_posix()
                digest.update(f"{place} {len(data)}\n".encode() + data)
    return digest.hexdigest()[:16]
