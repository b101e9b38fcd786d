"""Make a failing scene smaller while it still fails, and keep it as a scene file that a test reads."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fourbar.errors import FourBarError
from fourbar.files import save
from fourbar.linkage import Bar
from fourbar.scene import Scene

KEPT = Path(__file__).parents[3] / "tests" / "counterexamples"
DIGITS = (1, 2, 3, 6, 10)
ROUNDS = 4
BARS = ("input", "coupler", "output")


def shrunk(scene: Scene, fails: Callable[[Scene], bool]) -> Scene:
    """The simplest scene found by one change at a time that still fails."""
    for _ in range(ROUNDS):
        before = scene
        for change in _changes(scene):
            try:
                smaller = change(scene)
                if smaller is not None and fails(smaller):
                    scene = smaller
            except FourBarError:
                continue
        if scene is before:
            break
    return scene


def _changes(scene: Scene) -> Iterator[Callable[[Scene], Scene | None]]:
    yield from (partial(_at, k=k) for k in (0, 1))
    for part in ("loads", "effects"):
        yield from (partial(_without, part=part, k=k) for k in range(len(getattr(scene, part))))
    for plain in ({"alpha_2": 0.0}, {"omega_2": 1.0}, {"branch": 1}):
        yield partial(_motion, plain=plain)
    yield lambda s: replace(s, drive_bar=2)
    yield _without_ground_angle
    simpler: list[Callable[[Bar], Bar]] = [lambda bar: Bar(bar.length), lambda bar: Bar(bar.length, 1.0)]
    yield from (partial(_bar, name=name, change=change) for name in BARS for change in simpler)
    for digits in DIGITS:
        short = partial(_rounded, digits=digits)
        yield from (partial(_bar, name=name, change=partial(_shorter, short=short)) for name in BARS)
        yield lambda s, short=short: replace(s, linkage=replace(s.linkage, ground=short(s.linkage.ground)))  # type: ignore[misc]
        yield partial(_angle, short=short)


def _without(scene: Scene, part: str, k: int) -> Scene | None:
    terms = getattr(scene, part)
    fewer: dict[str, Any] = {part: (*terms[:k], *terms[k + 1 :])}
    return replace(scene, **fewer) if k < len(terms) else None


def _motion(scene: Scene, plain: dict[str, Any]) -> Scene:
    return replace(scene, motion=replace(scene.motion, **plain))


def _shorter(bar: Bar, short: Callable[[float], float]) -> Bar:
    return replace(bar, length=short(bar.length))


def _bar(scene: Scene, name: str, change: Callable[[Bar], Bar]) -> Scene:
    return replace(scene, linkage=replace(scene.linkage, **{name: change(getattr(scene.linkage, name))}))  # type: ignore[arg-type]


def _angles(scene: Scene) -> Any:
    return np.atleast_1d(np.asarray(scene.motion.theta_2))


def _at(scene: Scene, k: int) -> Scene | None:
    angles = _angles(scene)
    return _motion(scene, {"theta_2": float(angles[k])}) if len(angles) > max(k, 1) else None


def _angle(scene: Scene, short: Callable[[float], float]) -> Scene | None:
    angles = _angles(scene)
    return _motion(scene, {"theta_2": short(float(angles[0]))}) if len(angles) == 1 else None


def _without_ground_angle(scene: Scene) -> Scene:
    turned = _motion(scene, {"theta_2": _angles(scene) - scene.linkage.ground_angle})
    return replace(turned, linkage=replace(scene.linkage, ground_angle=0.0))


def _rounded(value: float, digits: int) -> float:
    return float(f"{value:.{digits}g}")


def keep(scene: Scene, name: str, folder: Path = KEPT) -> Path:
    """Write a counter-example where the tests find it."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.toml"
    save(scene, path)
    return path
