"""The command `fourbar`; what a command needs is imported when it is called."""

import sys

import click

from fourbar import __version__
from fourbar.cli.analyze import (
    analyze,
    classify_command,
    equilibrium_command,
    new,
    tolerance,
)
from fourbar.cli.export import (
    animate,
    edit_command,
    mjcf,
    plot,
    sdf_command,
    usd_command,
)
from fourbar.errors import run

SECTIONS = {
    "Begin": (new, edit_command),
    "Look": (classify_command, analyze, plot, animate),
    "Export": (mjcf, sdf_command, usd_command),
    "Study": (tolerance, equilibrium_command),
}
"""Commands by what they are for, in the order of the help."""


class SectionedGroup(click.Group):
    """A group whose help lists its commands in sections, each description whole."""

    def format_commands(
        self,
        ctx: click.Context,
        formatter: click.HelpFormatter,
    ) -> None:
        """Write the sections."""
        for title, commands in SECTIONS.items():
            with formatter.section(title):
                rows = [
                    (str(command.name), command.get_short_help_str(limit=200))
                    for command in commands
                ]
                formatter.write_dl([(f"{name:<11}", text) for name, text in rows])


@click.group(
    cls=SectionedGroup,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Begin with: fourbar new first.toml --lengths 300mm 100mm 250mm 220mm",
)
@click.version_option(__version__, "-V", "--version", prog_name="fourbar")
@click.option(
    "--traceback",
    is_flag=True,
    help="Show where an internal error happened.",
)
@click.pass_context
def group(context: click.Context, traceback: bool) -> None:
    """Evaluate the closed formulas of a scene: torque and pin forces of a four-bar.

    The checks against MuJoCo and Pinocchio are fourbar-validation, with the extra
    "validation".

    Exit status: 0 all well (also when some positions do not assemble), 2 the input is
    bad, 3 the environment or the program failed, 130 interrupted.
    """
    del traceback  # looked at where errors are reported
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


for commands in SECTIONS.values():
    for command in commands:
        group.add_command(command)


def main(arguments: list[str] | None = None) -> None:
    """Run a command and leave with its exit status."""
    sys.exit(status(arguments))


def status(arguments: list[str] | None = None) -> int:
    """Run a command and return its exit status.

    An error becomes one line on standard error.
    """
    return run(group, "fourbar", arguments)
