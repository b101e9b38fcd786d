"""Commands of the harness; each lives in its own module and is imported when it is called."""

import sys
from pkgutil import resolve_name

import click

from fourbar.errors import run
from fourbar_validation.places import PROGRAM

COMMANDS = {
    "run": "fourbar_validation.run.command:command",
    "accept": "fourbar_validation.regression.accept:accept_command",
    "compare": "fourbar_validation.regression.accept:compare",
    "history": "fourbar_validation.regression.accept:history",
    "check": "fourbar_validation.check:check",
    "check-mjcf": "fourbar_validation.check.model:command",
    "fuzz-files": "fourbar_validation.lab.stress.mutants:fuzz_files",
    "models": "fourbar_validation.lab.models:models",
    "published": "fourbar_validation.lab.ladder:published",
    "mutation": "fourbar_validation.lab.stress.mutation.mutation:mutation",
    "fuzz": "fourbar_validation.lab.stress.fuzz.fuzz:fuzz",
    "stability": "fourbar_validation.lab.stress.forward_error.stability:stability",
    "bench": "fourbar_validation.lab.stress.bench:bench",
    "cost": "fourbar_validation.lab.cost.cost:cost",
    "advise": "fourbar_validation.advise.advise:command",
    "advise-study": "fourbar_validation.lab.cost.measure:study",
    "standing": "fourbar_validation.lab.subjects.standing:command",
    "versions": "fourbar_validation.lab.subjects.versions:command",
    "problems": "fourbar_validation.lab.subjects.problems:command",
    "effects-cost": "fourbar_validation.lab.effects.cost:command",
}


class LazyGroup(click.Group):
    """A group whose commands are imported on demand."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Every command, in the order a newcomer needs them."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command of that name."""
        if cmd_name not in COMMANDS:
            return None
        try:
            command: click.Command = resolve_name(COMMANDS[cmd_name])
        except ModuleNotFoundError as error:
            return _unavailable(cmd_name, error)
        return command


def _unavailable(name: str, missing: ModuleNotFoundError) -> click.Command:
    """A command whose library is not installed: it is listed, and says so where it is called."""

    @click.command(name, help=f"Not available: {missing.name} is not installed.")
    @click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
    def unavailable(arguments: tuple[str, ...]) -> None:
        del arguments
        raise missing

    unavailable.context_settings["ignore_unknown_options"] = True
    return unavailable


@click.group(cls=LazyGroup, invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})
@click.pass_context
def group(context: click.Context) -> None:
    """Check the closed formulas of the planar four-bar linkage against independent engines.

    Exit status: 0 all holds, 1 a comparison fails or nothing was compared, 2 the input is bad,
    3 the environment or the program failed, 130 interrupted.
    """
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


def main(arguments: list[str] | None = None) -> None:
    """Run a command and leave with the exit status of the design."""
    sys.exit(status(arguments))


def status(arguments: list[str] | None = None) -> int:
    """Run a command; what goes wrong becomes one line on standard error and an exit status."""
    return run(group, PROGRAM, arguments)
