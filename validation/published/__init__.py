"""The figures that others printed, against ours, and why they differ."""

from validation.published.command import LadderRow as LadderRow
from validation.published.command import ladder_rows as ladder_rows
from validation.published.command import published as published
