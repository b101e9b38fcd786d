"""The figures that others printed, against ours, and why they differ."""

from validation.published.ladder import LadderRow as LadderRow
from validation.published.ladder import ladder_rows as ladder_rows
from validation.published.ladder import published as published
