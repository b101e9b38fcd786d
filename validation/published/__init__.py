"""The figures that others printed, against ours, and why they differ."""

from validation.published.command import published as published
