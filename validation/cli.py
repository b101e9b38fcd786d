"""Commands of the harness; each lives in its own module and is imported when it is called."""

import sys
from pkgutil import resolve_name

import click

from fourbar.errors import run

COMMANDS = {
    "run": "validation.run.run:command",
    "accept": "validation.regression.accept:accept_command",
    "compare": "validation.regression.accept:compare",
    "history": "validation.regression.accept:history",
    "check": "validation.check:check",
    "published": "validation.published:published",
    "cost": "validation.studies.cost.cost:cost",
    "cost --effects": "validation.studies.effects.cost:command",
    "advise": "validation.studies.cost.advise:command",
    "advise --study": "validation.studies.cost.measure:study",
    "stability": "validation.stress.forward_error.stability:stability",
    "bench": "validation.stress.bench:bench",
    "fuzz": "validation.stress.fuzz.fuzz:fuzz",
    "fuzz --files": "validation.stress.mutants:fuzz_files",
    "faults": "validation.stress.mutation.planted:command",
    "faults --mutants": "validation.stress.mutation.harness:command",
    "standing": "validation.subjects.standing:command",
    "standing --versions": "validation.subjects.versions:command",
    "write": "validation.studies.models:models",
    "write --problems": "validation.subjects.problems:command",
}
"""By name, some with the option that makes another command of it, with options of its own."""
RENAMED = {
    "fuzz-files": "fuzz --files",
    "models": "write",
    "problems": "write --problems",
    "mutation": "faults, or faults --mutants",
    "advise-study": "advise --study",
    "effects-cost": "cost --effects",
    "versions": "standing --versions",
}
"""Earlier names of commands."""


class LazyGroup(click.Group):
    """A group whose commands are imported on demand."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """List the commands in the order a newcomer needs them, without the options that make others of them."""
        return [name for name in COMMANDS if " " not in name]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a command; its help names those that an option makes of it."""
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = resolve_name(COMMANDS[cmd_name])
        others = [f"`{name} --help`" for name in COMMANDS if name.startswith(f"{cmd_name} ")]
        command.epilog = f"See also {', '.join(others)}." if others else None
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Choose by name and option."""
        name, *options = args
        if name in RENAMED:
            raise click.UsageError(f"{name} is now called {RENAMED[name]}", ctx)
        for option in options:
            if f"{name} {option}" in COMMANDS:
                options.remove(option)
                return super().resolve_command(ctx, [f"{name} {option}", *options])
        return super().resolve_command(ctx, args)


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
    """Run a command and leave with its exit status."""
    sys.exit(status(arguments))


def status(arguments: list[str] | None = None) -> int:
    """Run a command; what goes wrong becomes one line on standard error and an exit status."""
    return run(group, "python -m validation", arguments)
