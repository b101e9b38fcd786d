"""`python -m validation accept` and `compare`."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from fourbar.errors import InputError
from fourbar.writing import write_text
from validation.regression import render
from validation.regression.changes import Differences, differences
from validation.regression.record import ACCEPTED, accept, baseline, read_run

FORMS: dict[str, Callable[[Differences], str]] = {
    "markdown": render.markdown,
    "html": render.html,
    "junit": render.junit,
}
"""Forms in which the differences can be written, besides the text that is printed."""


def output_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options --markdown, --html and --junit."""
    for form in reversed(FORMS):
        path = click.Path(path_type=Path, dir_okay=False)
        command = click.option(f"--{form}", type=path, help=f"Write the differences as {form} too.")(command)
    return command


def report_differences(old: Path, new: Path, forms: dict[str, Path | None]) -> int:
    """Print the differences, write the forms wanted; 1 on a regression, or where nothing was compared."""
    found = differences(read_run(old), read_run(new))
    for form, path in forms.items():
        if path is not None:
            write_text(path, FORMS[form](found))
    click.echo(render.text(found), nl=False)
    return found.status


@click.command()
@click.argument("old")
@click.argument("new", type=click.Path(path_type=Path))
@output_options
def compare(old: str, new: Path, **forms: Path | None) -> int:
    """Say what changed from OLD (a run's folder, its results.csv, or an accepted name) to NEW.

    Exit status 1 on a regression: a verdict that got worse, an error that grew beyond round-off,
    a row that is gone, a new row that fails; and where nothing was compared.
    """
    return report_differences(baseline(old), new, forms)


@click.command(name="accept")
@click.argument("results", type=click.Path(path_type=Path))
@click.option("--as", "name", default=ACCEPTED, show_default=True, help="Name of the accepted state.")
def accept_command(results: Path, name: str) -> None:
    """Record RESULTS (a run's folder) as the accepted state that later runs are compared with."""
    if not name or name in (".", "..") or not all(c.isalnum() or c in "-_." for c in name):
        raise InputError("--as", name, "must be letters, digits, '-', '_' or '.'")
    click.echo(f"accepted as {name}: {accept(results, name)}")
