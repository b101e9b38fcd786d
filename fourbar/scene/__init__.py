"""The problem as stated: linkage, motion, drive, loads and effects."""

from fourbar.scene.scene import Command as Command
from fourbar.scene.scene import LimitOrigin as LimitOrigin
from fourbar.scene.scene import ReleaseOrigin as ReleaseOrigin
from fourbar.scene.scene import Scene as Scene
from fourbar.scene.scene import StrokeOrigin as StrokeOrigin
from fourbar.scene.scene import command as command
from fourbar.scene.scene import command_at as command_at
from fourbar.scene.scene import default_places as default_places
from fourbar.scene.scene import find_signs as find_signs
from fourbar.scene.scene import require_input as require_input
from fourbar.scene.scene import with_signs as with_signs
