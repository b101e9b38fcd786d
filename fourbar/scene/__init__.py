"""The problem as stated: linkage, motion, drive, loads and effects."""

from fourbar.scene.scene import (
    Command,
    LimitOrigin,
    ReleaseOrigin,
    Scene,
    StrokeOrigin,
    command,
    command_at,
    default_places,
    find_signs,
    require_input,
    with_signs,
)

__all__ = (
    "Command",
    "LimitOrigin",
    "ReleaseOrigin",
    "Scene",
    "StrokeOrigin",
    "command",
    "command_at",
    "default_places",
    "find_signs",
    "require_input",
    "with_signs",
)
