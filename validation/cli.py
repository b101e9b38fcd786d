"""Commands of the harness; each lives in its own module and is imported when it is called."""

import sys
from pkgutil import resolve_name

import click

from fourbar.errors import run

COMMANDS = {
    "run": "validation.run.command:command",
    "accept": "validation.regression.accept:accept_command",
    "compare": "validation.regression.accept:compare",
    "history": "validation.regression.accept:history",
    "check": "validation.check:check",
    "check-mjcf": "validation.check.model:command",
    "fuzz-files": "validation.stress.mutants:fuzz_files",
    "models": "validation.studies.models:models",
    "published": "validation.published:published",
    "mutation": "validation.stress.mutation.mutation:mutation",
    "fuzz": "validation.stress.fuzz.fuzz:fuzz",
    "stability": "validation.stress.forward_error.stability:stability",
    "bench": "validation.stress.bench:bench",
    "cost": "validation.studies.cost.cost:cost",
    "advise": "validation.studies.cost.advise:command",
    "advise-study": "validation.studies.cost.measure:study",
    "standing": "validation.subjects.standing:command",
    "versions": "validation.subjects.versions:command",
    "problems": "validation.subjects.problems:command",
    "effects-cost": "validation.studies.effects.cost:command",
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
        command: click.Command = resolve_name(COMMANDS[cmd_name])
        return command


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
    return run(group, "python -m validation", arguments)
