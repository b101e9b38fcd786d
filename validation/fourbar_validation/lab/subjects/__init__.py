"""Subjects: simulators that are examined by the formulas, each in an environment of its own; none is believed."""
