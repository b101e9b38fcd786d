"""Model files of a scene for simulators (MJCF, SDF, USD), without any of them."""

from fourbar.mjcf.defaults import defaults_used as defaults_used
from fourbar.mjcf.defaults import scene_from_lengths as scene_from_lengths
from fourbar.mjcf.document import flywheel as flywheel
from fourbar.mjcf.document import mjcf as mjcf
from fourbar.mjcf.document import run_through as run_through
from fourbar.mjcf.mimic import with_mimic as with_mimic
from fourbar.mjcf.settings import RECIPE as RECIPE
from fourbar.mjcf.settings import Settings as Settings
from fourbar.mjcf.settings import WindowMotion as WindowMotion
from fourbar.mjcf.simulators import SIMULATORS as SIMULATORS
from fourbar.mjcf.simulators import mjcf_for as mjcf_for
