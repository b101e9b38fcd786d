"""The moving bars of a scene by name, and a scene with other bars."""

from dataclasses import replace

from fourbar.linkage import BAR_NAMES, MOVING_BARS, Bar
from fourbar.scene import Scene


def list_moving(scene: Scene) -> list[tuple[str, Bar]]:
    """Return the moving bars by their names."""
    return [(BAR_NAMES[number], scene.linkage.bar(number)) for number in MOVING_BARS]


def replace_bars(scene: Scene, **bars: Bar) -> Scene:
    """Give the scene other bars."""
    return replace(scene, linkage=replace(scene.linkage, **bars))  # type: ignore[arg-type]
