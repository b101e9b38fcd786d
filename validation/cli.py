"""Commands of the harness; each lives in its own module and is imported when it is called."""

import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import click

from fourbar.errors import DependencyError, FourBarError

COMMANDS = {
    "run": "validation.run:command",
    "accept": "validation.regression.command:accept_command",
    "compare": "validation.regression.command:compare",
    "check": "validation.check:check",
    "fuzz-files": "validation.suite.mutants:fuzz_files",
    "models": "validation.models:models",
    "published": "validation.published:published",
    "stability": "validation.stability:stability",
    "bench": "validation.bench:bench",
}
HOLDS, FAILED, BAD_INPUT, BROKEN, INTERRUPTED = 0, 1, 2, 3, 130
"""Exit statuses of the design."""


class LazyGroup(click.Group):
    """A group whose commands are imported on demand."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Every command, in the order a newcomer needs them."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command of that name."""
        if cmd_name not in COMMANDS:
            return None
        module, _, name = COMMANDS[cmd_name].partition(":")
        command: click.Command = getattr(import_module(module), name)
        return command


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
def group() -> None:
    """Check the closed formulas of the planar four-bar linkage against independent engines.

    Exit status: 0 all holds, 1 a comparison fails, 2 the input is bad, 3 the environment or the
    program failed, 130 interrupted.
    """


def main(arguments: list[str] | None = None) -> None:
    """Run a command and leave with the exit status of the design."""
    sys.exit(status(arguments))


def status(arguments: list[str] | None = None) -> int:
    """Run a command; what goes wrong becomes one line on standard error and an exit status."""
    try:
        result: Any = group.main(args=arguments, prog_name="python -m validation", standalone_mode=False)
        return result if isinstance(result, int) else HOLDS
    except click.exceptions.Abort:
        return INTERRUPTED
    except KeyboardInterrupt:
        return INTERRUPTED
    except click.ClickException as error:
        return _say(error.format_message(), BAD_INPUT)
    except DependencyError as error:
        return _say(str(error), BROKEN)
    except FourBarError as error:
        return _say(str(error), BAD_INPUT)
    except ModuleNotFoundError as error:
        return _say(f'{error.name} is not installed: pip install "fourbar[all]"', BROKEN)
    except OSError as error:
        return _say(f"{Path(error.filename).name if error.filename else 'file'}: {error.strerror}", BROKEN)
    except Exception as error:  # a bug: still one line, never a traceback
        return _say(f"internal error: {type(error).__name__}: {error}", BROKEN)


def _say(message: str, code: int) -> int:
    click.echo("error: " + " ".join(message.split()), err=True)
    return code
