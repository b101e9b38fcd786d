"""Model files of a scene for simulators (MJCF, SDF, USD), without any of them."""

from fourbar.mjcf.document import SIMULATORS as SIMULATORS
from fourbar.mjcf.document import WindowMotion as WindowMotion
from fourbar.mjcf.document import choose_run as choose_run
from fourbar.mjcf.document import list_defaults as list_defaults
from fourbar.mjcf.document import make_scene as make_scene
from fourbar.mjcf.document import size_flywheel as size_flywheel
from fourbar.mjcf.document import write_mjcf as write_mjcf
from fourbar.mjcf.document import write_mjcf_for as write_mjcf_for
from fourbar.mjcf.model import RECIPE as RECIPE
from fourbar.mjcf.model import Settings as Settings
from fourbar.mjcf.plane import LEVEL as LEVEL
from fourbar.mjcf.plane import Plane as Plane
