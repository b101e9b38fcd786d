"""How a command ends: its exit status, and one line on standard error where something is wrong."""

import io
import os
import sys

import click

from fourbar.errors import DependencyError, FourBarError

HOLDS, FAILED, BAD_INPUT, BROKEN, INTERRUPTED = 0, 1, 2, 3, 130
"""All holds; a comparison fails; the input is bad; the environment or the program failed; interrupted."""


def run(group: click.Group, program: str, arguments: list[str] | None = None) -> int:
    """Run a command of a group; the exit status is what the command returns, or tells what went wrong."""
    given = sys.argv[1:] if arguments is None else arguments
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal that has no Greek still gets its table
    try:
        result = group.main(args=given, prog_name=program, standalone_mode=False)
        return result if isinstance(result, int) else HOLDS
    except SystemExit:
        return HOLDS  # click leaves with 1 where the reader of a pipe has gone; it has what it wants
    except (click.exceptions.Abort, KeyboardInterrupt):
        return _say("interrupted", INTERRUPTED)
    except click.ClickException as error:
        return _say(error.format_message(), BAD_INPUT)
    except DependencyError as error:
        return _say(str(error), BROKEN)
    except FourBarError as error:
        return _say(str(error), BAD_INPUT)
    except ModuleNotFoundError as error:
        return _say(f'{error.name} is not installed: pip install "fourbar[all]"', BROKEN)
    except OSError as error:
        return _say(f"{error.filename or 'output'}: {error.strerror}", BROKEN)
    except Exception as error:
        if "--traceback" in given or os.environ.get("FOURBAR_TRACEBACK"):
            raise
        return _say(f"internal error: {type(error).__name__}: {error} (FOURBAR_TRACEBACK=1 shows where)", BROKEN)


def _say(message: str, status: int) -> int:
    click.echo("error: " + printable(message), err=True)
    return status


def printable(text: str) -> str:
    """One line without control characters: a title or file name does not steer the terminal."""
    return " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())
