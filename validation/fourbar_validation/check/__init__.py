"""Other people's numbers: a table of torques and forces judged row by row against the formulas."""

from fourbar_validation.check.check import check as check
