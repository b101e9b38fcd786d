"""Commands of the lab.

Each lives in its own module and is imported when it is called.
"""

import sys

import click

from fourbar import __version__
from fourbar.errors import run
from fourbar_validation.cli import LazyGroup

LAB_PROGRAM = "python -m fourbar_lab"
LAB_COMMANDS = {
    "stability": "fourbar_lab.stability:stability",
    "bench": "fourbar_lab.bench:bench",
    "effects": "fourbar_lab.effects:effects",
    "worlds": "fourbar_lab.worlds:worlds_command",
    "advice": "fourbar_lab.advice:advice_command",
    "fuzz": "fourbar_lab.fuzz:fuzz",
    "fuzz-files": "fourbar_lab.fuzz_files:fuzz_files",
    "faults": "fourbar_lab.faults:faults_command",
    "mutants": "fourbar_lab.mutants:mutants_command",
    "findings": "fourbar_lab.simulators.findings:findings_command",
    "write": "fourbar_lab.write:write_command",
    "problems": "fourbar_lab.simulators.problems:problems_command",
    "benchmark": "fourbar_lab.benchmark:benchmark_command",
}


@click.group(
    cls=LazyGroup,
    modules=LAB_COMMANDS,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(__version__, "-V", "--version", prog_name="fourbar-lab")
@click.pass_context
def group(context: click.Context) -> None:
    """Study the formulas, the harness that checks them, and the engines.

    Exit status: 0 all holds, 1 something does not hold, 2 the input is bad, 3 the
    environment or the program failed, 130 interrupted.
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
    return run(group, LAB_PROGRAM, arguments)
