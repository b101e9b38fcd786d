"""Make a failing scene smaller while it still fails, and keep it as a scene file that a test reads."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fourbar.errors import FourBarError
from fourbar.files import save
from fourbar.linkage import Bar, FourBar
from fourbar.scene import Scene
from fourbar.scene.motion import Motion

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
    yield partial(_at, k=0)
    yield partial(_at, k=1)
    for k in range(len(scene.loads)):
        yield partial(_without, part="loads", k=k)
    for k in range(len(scene.effects)):
        yield partial(_without, part="effects", k=k)
    for plain in ({"alpha_2": 0.0}, {"omega_2": 1.0}, {"branch": 1}):
        yield partial(_motion, plain=plain)
    yield lambda s: replace(s, drive_bar=2)
    yield _without_ground_angle
    for name in BARS:
        yield partial(_bar, name=name, change=_massless)
        yield partial(_bar, name=name, change=_uniform)
    for digits in DIGITS:
        for name in BARS:
            yield partial(_bar, name=name, change=partial(_shorter, digits=digits))
        yield partial(_ground, digits=digits)
        yield partial(_angle, digits=digits)


def _without(scene: Scene, part: str, k: int) -> Scene | None:
    terms = getattr(scene, part)
    fewer: dict[str, Any] = {part: (*terms[:k], *terms[k + 1 :])}
    return replace(scene, **fewer) if k < len(terms) else None


def _motion(scene: Scene, plain: dict[str, Any]) -> Scene:
    return replace(scene, motion=replace(scene.motion, **plain))


def _massless(bar: Bar) -> Bar:
    return Bar(bar.length)


def _uniform(bar: Bar) -> Bar:
    return Bar(bar.length, 1.0)


def _shorter(bar: Bar, digits: int) -> Bar:
    return replace(bar, length=_rounded(bar.length, digits))


def _ground(scene: Scene, digits: int) -> Scene:
    return replace(scene, linkage=replace(scene.linkage, ground=_rounded(scene.linkage.ground, digits)))


def _bar(scene: Scene, name: str, change: Callable[[Bar], Bar]) -> Scene:
    return replace(scene, linkage=replace(scene.linkage, **{name: change(getattr(scene.linkage, name))}))  # type: ignore[arg-type]


def _at(scene: Scene, k: int) -> Scene | None:
    angles = np.atleast_1d(np.asarray(scene.motion.theta_2))
    return _moved(scene, float(angles[k])) if len(angles) > k > -len(angles) and len(angles) > 1 else None


def _moved(scene: Scene, theta_2: float) -> Scene:
    motion: Motion = replace(scene.motion, theta_2=theta_2)
    return replace(scene, motion=motion)


def _without_ground_angle(scene: Scene) -> Scene:
    turn = scene.linkage.ground_angle
    linkage: FourBar = replace(scene.linkage, ground_angle=0.0)
    motion = replace(scene.motion, theta_2=np.atleast_1d(np.asarray(scene.motion.theta_2)) - turn)
    return replace(scene, linkage=linkage, motion=motion)


def _angle(scene: Scene, digits: int) -> Scene | None:
    angles = np.atleast_1d(np.asarray(scene.motion.theta_2))
    return _moved(scene, _rounded(float(angles[0]), digits)) if len(angles) == 1 else None


def _rounded(value: float, digits: int) -> float:
    return float(f"{value:.{digits}g}")


def keep(scene: Scene, name: str, folder: Path = KEPT) -> Path:
    """Write a counter-example where the tests find it."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.toml"
    save(scene, path)
    return path
