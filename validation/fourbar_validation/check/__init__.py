"""Judge other people's numbers: a table of torques and forces.

Each row is compared with the formulas.
"""

from fourbar_validation.check.check import check_command as check_command
