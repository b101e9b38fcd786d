"""What a number depends on besides its scene: this code, the libraries, and the build of each engine."""

import hashlib
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from validation.report.machine import PACKAGES, WHERE_INSTALLED, versions

CHECKOUT = Path(__file__).parent.parent.parent
CODE = (".py", ".toml")
"""Endings of the files that numbers come from; templates and accepted states change none."""
BUILT = (".so", ".pyd", ".dylib", ".py")
"""Endings of the files of an engine that decide its numbers; others hold where and when it was installed."""


@cache
def code() -> dict[str, str]:
    """Name and version or hash of everything that decides a number; one run, and all its machines, have one."""
    builds = {name: build(package) for name, package in (*PACKAGES.items(), *zip(*[WHERE_INSTALLED] * 2, strict=True))}
    known = {f"build of {name}": found for name, found in builds.items() if found and name != "fourbar"}
    return {"code": checkout(), **versions(), **known}


def checkout(root: Path = CHECKOUT) -> str:
    """Hash of the modules of `fourbar` and `validation`, wherever they lie."""
    digest = hashlib.sha256()
    for folder in ("fourbar", "validation"):
        for path in sorted((root / folder).rglob("*")):
            if path.suffix in CODE and path.is_file():
                data = path.read_bytes()
                digest.update(f"{path.relative_to(root).as_posix()} {len(data)}\n".encode() + data)
    return digest.hexdigest()[:16]


def build(package: str) -> str:
    """Hash of what an installer wrote down of the files of a package: two builds of one version differ in it."""
    try:
        lines = (distribution(package).read_text("RECORD") or "").splitlines()
    except PackageNotFoundError:
        return ""
    files = sorted(line for line in lines if line.partition(",")[0].endswith(BUILT))
    return hashlib.sha256("\n".join(files).encode()).hexdigest()[:16] if files else ""


def differing(here: dict[str, str], there: dict[str, str]) -> str:
    """The first entry in which two differ, in words; nothing where they are the same."""
    for name in [*here, *there]:
        one, other = here.get(name, "none"), there.get(name, "none")
        if one != other:
            return f"{name} is {other} there and {one} here"
    return ""
