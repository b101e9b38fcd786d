"""Commands of the harness, each imported from its own module when it is called."""

import sys
from collections.abc import Mapping
from importlib.util import find_spec
from pkgutil import resolve_name
from typing import NamedTuple

import click

from fourbar import __version__
from fourbar.errors import run
from fourbar_validation.places import HARNESS_PROGRAM


class LazyCommand(NamedTuple):
    """A command as the help lists it, which imports nothing."""

    target: str
    """Module and function, as "module:function"."""
    about: str
    """First sentence of the command's own help."""
    needs: str = ""
    """Library without which the module cannot be imported."""


COMMANDS = {
    "run": LazyCommand(
        "fourbar_validation.run.command:run_command",
        "Judge scenes and write a report.",
        "filelock",
    ),
    "collect": LazyCommand(
        "fourbar_validation.run.command:collect_command",
        "Put together the parts of a run.",
        "filelock",
    ),
    "accept": LazyCommand(
        "fourbar_validation.regression.accept:accept_command",
        "Record a run as the accepted state.",
    ),
    "compare": LazyCommand(
        "fourbar_validation.regression.accept:compare_command",
        "Say what changed from OLD to NEW.",
    ),
    "check": LazyCommand(
        "fourbar_validation.check:check_command",
        "Judge your own torques and forces.",
    ),
    "loops": LazyCommand(
        "fourbar_validation.robots.loops:loops_command",
        "List the closed loops of a robot's MJCF, SDF or URDF.",
    ),
    "check-mjcf": LazyCommand(
        "fourbar_validation.robots.check_mjcf:check_mjcf_command",
        "Measure the loops of a robot's file in MuJoCo, or judge one by a scene.",
        "mujoco",
    ),
    "published": LazyCommand(
        "fourbar_validation.published.comparison:published",
        "Compare the figures of the sources with ours.",
    ),
    "cost": LazyCommand(
        "fourbar_validation.cost.cost:cost",
        "Measure what accuracy costs in time.",
        "mujoco",
    ),
    "advise": LazyCommand(
        "fourbar_validation.advise.advise:advise_command",
        "Find the cheapest MuJoCo settings.",
        "mujoco",
    ),
}
"""Commands by name, in the order in which a newcomer needs them."""


class LazyGroup(click.Group):
    """A group that imports a command only when it is called."""

    def __init__(
        self, name: str, about: str, listed: Mapping[str, LazyCommand]
    ) -> None:
        super().__init__(
            help=about,
            callback=click.pass_context(_show_help),
            invoke_without_command=True,
            context_settings={"help_option_names": ["-h", "--help"]},
        )
        click.version_option(__version__, "-V", "--version", prog_name=name)(self)
        self.listed = listed

    def list_commands(self, ctx: click.Context) -> list[str]:
        """List the commands in their order."""
        return list(self.listed)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command."""
        if cmd_name not in self.listed:
            return None
        command: click.Command = resolve_name(self.listed[cmd_name].target)
        return command

    def format_commands(
        self,
        ctx: click.Context,
        formatter: click.HelpFormatter,
    ) -> None:
        """Write a line for each command."""
        with formatter.section("Commands"):
            formatter.write_dl(
                [
                    (name, _say_missing(command.needs) or command.about)
                    for name, command in self.listed.items()
                ]
            )


def _say_missing(library: str) -> str:
    """Say that a library is not installed, or return an empty string if it is."""
    if not library or find_spec(library) is not None:
        return ""
    return f"Not available: {library} is not installed."


def _show_help(context: click.Context) -> None:
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


group = LazyGroup(
    "fourbar-validation",
    """Check the closed formulas of the planar four-bar against independent engines.

    Exit status: 0 all holds, 1 a comparison fails or nothing was compared, 2 the input
    is bad, 3 the environment or the program failed, 130 interrupted.
    """,
    COMMANDS,
)


def main(arguments: list[str] | None = None) -> None:
    """Run a command and leave with the exit status."""
    sys.exit(status(arguments))


def status(arguments: list[str] | None = None) -> int:
    """Run a command and return its exit status.

    An error becomes one line on standard error.
    """
    return run(group, HARNESS_PROGRAM, arguments, "validation")
