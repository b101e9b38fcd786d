"""Remarks on loads and effects whose meaning the reader of a result may miss."""

from fourbar.linkage import FIRST_PIN
from fourbar.scene import Scene


def list_couple_notes(scene: Scene) -> list[str]:
    """Name where couples without a place enter their bars, in one line or none."""
    entries = [
        f"load {number} enters bar {load.bar} at"
        f" {'G' if load.bar == 3 else FIRST_PIN[load.bar]}"
        for number, load in enumerate(scene.loads, 1)
        if load.moment != 0.0 and load.force is None and load.place is None
    ]
    if not entries:
        return []
    return [
        f"  a moment alone: {', '.join(entries)}; its from_pin states another place"
    ]
