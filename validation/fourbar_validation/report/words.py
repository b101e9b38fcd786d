"""Words that several parts of a report share."""

import re

NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
"""Pattern of a number in a reason. Reasons that differ in numbers alone count as one.
"""
