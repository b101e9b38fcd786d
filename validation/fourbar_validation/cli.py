"""Commands of the harness.

Each lives in its own module and is imported when it is called.
"""

import sys
from collections.abc import Mapping
from pkgutil import resolve_name
from typing import Any

import click

from fourbar import __version__
from fourbar.errors import run
from fourbar_validation.places import HARNESS_PROGRAM

COMMANDS = {
    "run": "fourbar_validation.run.command:run_command",
    "collect": "fourbar_validation.run.parts:collect_command",
    "accept": "fourbar_validation.regression.accept:accept_command",
    "compare": "fourbar_validation.regression.accept:compare_command",
    "check": "fourbar_validation.check:check_command",
    "loops": "fourbar_validation.robots.command:robot_command",
    "check-mjcf": "fourbar_validation.check.mjcf:check_mjcf_command",
    "published": "fourbar_validation.published.comparison:published",
    "cost": "fourbar_validation.cost.cost:cost",
    "advise": "fourbar_validation.advise.advise:advise_command",
}


class LazyGroup(click.Group):
    """A group whose commands are imported on demand."""

    def __init__(self, *, modules: Mapping[str, str], **settings: Any) -> None:
        super().__init__(**settings)
        self.modules = modules
        """Module and function of each subcommand, by name. They are in the order in
        which a newcomer needs them.
        """

    def list_commands(self, ctx: click.Context) -> list[str]:
        """List the commands in their order."""
        return list(self.modules)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command."""
        if cmd_name not in self.modules:
            return None
        try:
            command: click.Command = resolve_name(self.modules[cmd_name])
        except ModuleNotFoundError as error:
            return _stand_in(cmd_name, error)
        return command


def _stand_in(name: str, missing: ModuleNotFoundError) -> click.Command:
    """Stand in for a command whose library is not installed.

    It is listed, and says so when it is called.
    """

    @click.command(name, help=f"Not available: {missing.name} is not installed.")
    @click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
    def unavailable(arguments: tuple[str, ...]) -> None:
        del arguments
        raise missing

    unavailable.context_settings["ignore_unknown_options"] = True
    return unavailable


@click.group(
    cls=LazyGroup,
    modules=COMMANDS,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(__version__, "-V", "--version", prog_name="fourbar-validation")
@click.pass_context
def group(context: click.Context) -> None:
    """Check the closed formulas of the planar four-bar against independent engines.

    Exit status: 0 all holds, 1 a comparison fails or nothing was compared, 2 the input
    is bad, 3 the environment or the program failed, 130 interrupted.
    """
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


def main(arguments: list[str] | None = None) -> None:
    """Run a command and leave with the exit status."""
    sys.exit(status(arguments))


def status(arguments: list[str] | None = None) -> int:
    """Run a command and return its exit status.

    An error becomes one line on standard error.
    """
    return run(group, HARNESS_PROGRAM, arguments, "validation")
