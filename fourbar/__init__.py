"""Closed formulas of the planar four-bar linkage: driving torque and pin forces.

`__init__.pyi` lists the public names.
"""

import lazy_loader as _lazy_loader

__version__ = "1.0.0"

__getattr__, __dir__, __all__ = _lazy_loader.attach_stub(__name__, __file__)
