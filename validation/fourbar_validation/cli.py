"""Commands of the harness; each lives in its own module and is imported when it is called."""

import sys
from pkgutil import resolve_name

import click

from fourbar import __version__
from fourbar.errors import run
from fourbar_validation.places import PROGRAM

COMMANDS = {
    "run": "fourbar_validation.run.command:command",
    "accept": "fourbar_validation.regression.accept:accept_command",
    "compare": "fourbar_validation.regression.accept:compare",
    "check": "fourbar_validation.check:check",
    "check-mjcf": "fourbar_validation.check.mjcf:command",
    "published": "fourbar_validation.lab.ladder:published",
    "cost": "fourbar_validation.lab.cost.cost:cost",
    "cost --effects": "fourbar_validation.lab.effects:cost_effects",
    "advise": "fourbar_validation.advise.advise:command",
    "advise --study": "fourbar_validation.lab.cost.measure:study",
    "stability": "fourbar_validation.lab.stress.forward_error.stability:stability",
    "bench": "fourbar_validation.lab.stress.bench:bench",
    "fuzz": "fourbar_validation.lab.stress.fuzz.fuzz:fuzz",
    "fuzz --files": "fourbar_validation.lab.stress.mutants:fuzz_files",
    "faults": "fourbar_validation.lab.stress.mutation.faults:command",
    "faults --mutants": "fourbar_validation.lab.stress.mutation.harness:command",
    "standing": "fourbar_validation.lab.simulators.standing:command",
    "standing --findings": "fourbar_validation.lab.simulators.findings:command",
    "write": "fourbar_validation.lab.models:models",
    "write --problems": "fourbar_validation.lab.simulators.problems:command",
}
"""By name, some with the option that makes another command of it, with options of its own."""


class LazyGroup(click.Group):
    """A group whose commands are imported on demand."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """List the commands in the order a newcomer needs them, without the options that make others of them."""
        return [name for name in COMMANDS if " " not in name]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command; its help names those that an option makes of it."""
        if cmd_name not in COMMANDS:
            return None
        try:
            command: click.Command = resolve_name(COMMANDS[cmd_name])
        except ModuleNotFoundError as error:
            return _stand_in(cmd_name, error)
        others = [f"`{name} --help`" for name in COMMANDS if name.startswith(f"{cmd_name} ")]
        command.epilog = f"See also {', '.join(others)}." if others else None
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Choose by name and option."""
        name, *options = args
        for option in options:
            if f"{name} {option}" in COMMANDS:
                options.remove(option)
                return super().resolve_command(ctx, [f"{name} {option}", *options])
        return super().resolve_command(ctx, args)


def _stand_in(name: str, missing: ModuleNotFoundError) -> click.Command:
    """Stand in for a command whose library is not installed: it is listed, and says so where it is called."""

    @click.command(name, help=f"Not available: {missing.name} is not installed.")
    @click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
    def unavailable(arguments: tuple[str, ...]) -> None:
        del arguments
        raise missing

    unavailable.context_settings["ignore_unknown_options"] = True
    return unavailable


@click.group(cls=LazyGroup, invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, "-V", "--version", prog_name="fourbar-validation")
@click.pass_context
def group(context: click.Context) -> None:
    """Check the closed formulas of the planar four-bar linkage against independent engines.

    Exit status: 0 all holds, 1 a comparison fails or nothing was compared, 2 the input is bad,
    3 the environment or the program failed, 130 interrupted.
    """
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


def main(arguments: list[str] | None = None) -> None:
    """Run a command and leave with the exit status."""
    sys.exit(status(arguments))


def status(arguments: list[str] | None = None) -> int:
    """Run a command; what goes wrong becomes one line on standard error and an exit status."""
    return run(group, PROGRAM, arguments)
