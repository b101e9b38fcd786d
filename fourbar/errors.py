"""Errors with one root, and the exit status and the line with which a command ends.

Each kind of mistake has a class.
"""

import io
import os
import re
import select
import signal
import sys
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    import click

LONGEST_VALUE = 160
"""Characters of a value that an error repeats."""
LONGEST_MESSAGE = 400
"""Characters of the line that a command prints of an error."""
LONGEST_LIST = 220
"""Characters of the names that an error lists; they are whole, the others counted."""
ELSEWHERE = (
    "this is a planar four-bar linkage with pins alone: synthesis of paths is in "
    "pylinkage and MotionGen, sliders and several loops (six bars) in PMKS+, any "
    "mechanism in MuJoCo, Drake or Exudyn"
)
"""Address for people with another mechanism."""
_OF_OTHER_MECHANISM = re.compile(
    r"sliders?|slot|(connecting_?)?rod|piston|rail|cams?|gears?|offset|dyad"
    r"|precision_points|bell_?crank|(fif|six|seven|eigh)th"
    r"|(bell_?crank|link|bar|rod|arm|crank|rocker|coupler|input|output|slider)_?[0-9]+"
    r"|(v_|a_)?(theta|omega|alpha|G)_?([5-9]|1[0-9])|F([5-9][1-9]|[1-9][5-9])"
)
"""Names of parts, quantities and problems of mechanisms that are no four-bar."""


def names_other_mechanism(name: str) -> bool:
    """Return True if a name is that of a part or quantity of another mechanism."""
    return _OF_OTHER_MECHANISM.fullmatch(name) is not None


_MESSAGE_UNITS = ContextVar[Mapping[str, tuple[str, float]]]("units of messages")
"""Name and factor of the unit in which messages state numbers of each SI unit."""


@contextmanager
def state_messages_in(units: Mapping[str, tuple[str, float]]) -> Iterator[None]:
    """Let messages that are written in the body state numbers in these units.

    A reader compares them with the file, which is seldom in SI units.
    """
    token = _MESSAGE_UNITS.set(units)
    try:
        yield
    finally:
        _MESSAGE_UNITS.reset(token)


def name_unit(unit: str) -> str:
    """Return the unit of messages for an SI unit."""
    return _MESSAGE_UNITS.get({}).get(unit, (unit, 1.0))[0]


def write_in_units(
    unit: str,
    *values: float,
    digits: int = 6,
    between: str = ", ",
) -> str:
    """Write numbers of an SI unit in the unit of messages, which follows them.

    >>> write_in_units("m", 0.0254, 0.3)
    '0.0254, 0.3 m'
    """
    name, factor = _MESSAGE_UNITS.get({}).get(unit, (unit, 1.0))
    numbers = between.join(f"{factor * value:.{digits}g}" for value in values)
    return f"{numbers} {name}".rstrip()


def abbreviate(text: str, longest: int) -> str:
    """Return a text of at most `longest` characters: its beginning and its end.

    >>> abbreviate("a name that goes on and on", 13)
    'a nam...nd on'
    """
    if len(text) <= longest:
        return text
    kept = longest - len("...")
    end = kept // 2
    return f"{text[: kept - end]}...{text[-end:]}"


def list_allowed(wrong: str, names: Iterable[str]) -> str:
    """Say what names are allowed in place of a wrong one, those like it first.

    Then come those that share most parts of a dotted name.

    Names are whole; those beyond LONGEST_LIST characters are counted.

    >>> list_allowed("forc", ["position", "velocity", "force"])
    'must be among force, position, velocity'
    """
    from difflib import get_close_matches

    names = list(names)
    like = [name for name in names if wrong.casefold() in name.casefold()]
    like += get_close_matches(wrong, names)
    parts = wrong.split(".")

    def count_shared(name: str) -> int:
        return len(os.path.commonprefix([parts, name.split(".")]))  # noqa: RUF071

    names.sort(key=count_shared, reverse=True)
    listed = list(dict.fromkeys([*like, *names]))
    shown = len(listed)
    while shown > 1 and len(", ".join(listed[:shown])) > LONGEST_LIST:
        shown -= 1
    more = f" and {len(listed) - shown} more" if shown < len(listed) else ""
    return f"must be among {', '.join(listed[:shown])}{more}"


def suggest_keys(wrong: str, names: Iterable[str]) -> str:
    """Say what keys of a scene are allowed in place of a wrong one.

    For a part of another mechanism it is said where that is solved.
    """
    if any(map(names_other_mechanism, wrong.split("."))):
        return ELSEWHERE
    return list_allowed(wrong, names)


def write_count(count: int, noun: str) -> str:
    """Write a number of things, in the singular if it is one.

    >>> write_count(1, "entry"), write_count(2, "entry"), write_count(0, "position")
    ('1 entry', '2 entries', '0 positions')
    """
    if count == 1:
        return f"1 {noun}"
    return f"{count} {noun[:-1]}ies" if noun.endswith("y") else f"{count} {noun}s"


class FourBarError(Exception):
    """Root of every error that this package raises on purpose."""


class InputError(FourBarError):
    """The description is bad: names the key, its value and what is allowed.

    Parameters
    ----------
    key : dotted name of the offending entry, for example ``"bars.input.mass"``.
    value : what was given; None is not shown, as of an entry that is left out.
    allowed : one phrase that says what would have been accepted.
    file : the file it stands in, where there is one.
    unit : SI unit of a value that is a number, or several. It is then shown in the unit
        of messages.
    """

    def __init__(
        self,
        key: str,
        value: object,
        allowed: str,
        file: str | None = None,
        unit: str | None = None,
    ) -> None:
        self.key = key
        self.value = value
        self.allowed = allowed
        self.file = file
        self.unit = unit
        # a reader wants 0.21, not np.float64(0.21); an interruption while numpy is
        # imported is one line too, so that this module does not import it
        if type(value).__module__ == "numpy" and not getattr(value, "shape", True):
            value = value.item()  # type: ignore[attr-defined]
        try:
            shown = " ".join(repr(value).split())  # arrays take several lines
        except ValueError:
            shown = "a huge whole number"
        except RecursionError:  # deeper than Python writes
            shown = "..."
        if unit is not None:
            numbers = value if isinstance(value, tuple) else (value,)
            shown = write_in_units(unit, *map(float, numbers))
        shown = abbreviate(shown, LONGEST_VALUE)  # of a long path the end says which
        prefix = f"{file}: " if file else ""
        # the words of a file must neither control a terminal nor fill it
        name = abbreviate(clean_line(key), LONGEST_VALUE)
        super().__init__(
            f"{prefix}{name}{'' if value is None else f' = {shown}'}: {allowed}"
        )

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        """Let the error cross from one process to another as it was made."""
        return type(self), (self.key, self.value, self.allowed, self.file, self.unit)

    def in_file(self, file: str) -> "InputError":
        """Return the same mistake with the name of the file that holds it."""
        return self.moved_to(self.key, file)

    def moved_to(self, key: str, file: str | None) -> "InputError":
        """Return the same mistake at another key, of a file."""
        return InputError(key, self.value, self.allowed, file, self.unit)


def expect(name: str, value: object, *kinds: type) -> None:
    """Raise InputError where an argument is none of the kinds that a function takes."""
    if not isinstance(value, kinds):
        wanted = " or ".join(kind.__name__ for kind in kinds)
        raise InputError(
            name,
            value,
            f"must be of type {wanted}, not {type(value).__name__}",
        )


class NotAssembledError(FourBarError):
    """The linkage closes at none of the positions of the scene."""


class LimitError(FourBarError):
    """A declared limit of an engine that the scene meets; not a fault of the scene."""


class DependencyError(FourBarError):
    """A library that the request needs is not installed."""


@contextmanager
def needing(what: str, extra: str) -> Iterator[None]:
    """Raise DependencyError where the body imports what is not installed.

    `what`: needs it, as the error says. `extra`: brings it.
    """
    try:
        yield
    except ImportError:
        raise DependencyError(f"{what}: {say_install(extra)}") from None


def say_install(extra: str) -> str:
    """Return how to install an extra of this package from where the package came.

    No package index has the package itself.
    """
    if (Path(__file__).parents[1] / "pyproject.toml").is_file():
        return f'pip install ".[{extra}]" in the checkout'
    from importlib.metadata import requires

    def list_packages(name: str) -> Iterator[str]:
        for line in requires("fourbar") or ():
            if not re.search(f"extra == [\"']{name}[\"']", line):
                continue
            package = line.partition(";")[0].strip()
            inner = re.fullmatch(r"fourbar\[(.+)\]", package)
            if inner is None:
                yield package
                continue
            for other in inner[1].split(","):
                yield from list_packages(other)

    packages = dict.fromkeys(list_packages(extra))
    return "pip install " + " ".join(f'"{package}"' for package in packages)


HOLDS, FAILED, BAD_INPUT, BROKEN, INTERRUPTED = 0, 1, 2, 3, 130
"""Exit statuses. All holds; a comparison fails or none was made; bad input; the
environment or the program failed; interrupted.
"""


def run(
    group: "click.Group",
    program: str,
    arguments: list[str] | None = None,
    extra: str = "all",
) -> int:
    """Run a command of a group and return its exit status.

    The status is what the command returns, or that of its error.

    `extra`: the one that brings what the program needs, named where a module is
    missing.
    """
    import click  # on the command line alone

    words = sys.argv[1:] if arguments is None else arguments
    # a program without a console, or one started with `>&-`, has none
    streams = tuple(
        stream or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
        for stream in (sys.stdout, sys.stderr)
    )
    sys.stdout, sys.stderr = streams
    if isinstance(sys.stdout, io.TextIOWrapper):
        # a terminal that has no Greek still gets its table
        sys.stdout.reconfigure(errors="replace")
    try:
        with _interrupted_by_sigterm():
            returned = group.main(args=words, prog_name=program, standalone_mode=False)
        status = HOLDS if returned is None else int(returned)
        _flush()
        return status
    except SystemExit as left:
        return _read_exit(left, streams)
    except (click.exceptions.Abort, KeyboardInterrupt):
        return _print_error("interrupted", INTERRUPTED)
    except click.ClickException as error:
        return _print_error(error.format_message(), BAD_INPUT)
    except DependencyError as error:
        return _print_error(str(error), BROKEN)
    except FourBarError as error:
        return _print_error(str(error), BAD_INPUT)
    except ModuleNotFoundError as error:
        return _print_error(
            f"{error.name} is not installed: {say_install(extra)}",
            BROKEN,
        )
    except OSError as error:
        # where a file is put in place, the second name is that of the place
        file = error.filename2 or error.filename or "output"
        return _print_error(f"{file}: {error.strerror or error}", BROKEN)
    except Exception as error:
        if "--traceback" in words or os.environ.get("FOURBAR_TRACEBACK"):
            raise
        return _print_error(
            f"internal error: {type(error).__name__}: {error} (FOURBAR_TRACEBACK=1"
            " shows where)",
            BROKEN,
        )


@contextmanager
def _interrupted_by_sigterm() -> Iterator[None]:
    """Let SIGTERM interrupt the body as Ctrl-C does.

    Python lets only the main thread handle signals; in another thread nothing changes.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _read_exit(raised: SystemExit, streams: tuple[TextIO, ...]) -> int:
    """Return the exit status of a command that raised SystemExit.

    Click and rich leave with 1 where the reader of a pipe has gone; it has what it
    wants. Click lets go of standard output then, and does so for every pipe that
    breaks, that of a worker too.
    """
    if sys.stdout is not streams[0]:
        if any(map(_is_unread, streams)):
            return HOLDS
        return _print_error("a pipe inside the program broke", BROKEN)
    if isinstance(raised.__context__, BrokenPipeError):
        return HOLDS
    if raised.code is None or isinstance(raised.code, int):
        return raised.code or HOLDS
    return _print_error(raised.code, BROKEN)


def _is_unread(stream: TextIO) -> bool:
    """Return True if a stream is a pipe without a reader, or if that cannot be told."""
    if not hasattr(select, "poll"):
        return True
    try:
        poll = select.poll()
        poll.register(stream.fileno(), select.POLLOUT)
        return any(
            event & (select.POLLERR | select.POLLHUP) for _, event in poll.poll(0)
        )
    except (OSError, ValueError):  # one without a file
        return False


def _flush() -> None:
    """Write out what was printed, while an error can still be reported.

    A reader that has gone is no error.
    """
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        # otherwise the interpreter reports the broken pipe when it ends
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())


def _print_error(message: str, status: int) -> int:
    import click

    line = abbreviate(f"error: {clean_line(message)}", LONGEST_MESSAGE)
    click.echo(line, err=True)
    return status


def clean_line(text: str) -> str:
    """Return one line without control characters.

    A title or file name must not control the terminal.
    """
    return " ".join(
        "".join(letter if letter.isprintable() else " " for letter in text).split()
    )


def _report_interruption(
    kind: type[BaseException],
    error: BaseException,
    trace: TracebackType | None,
) -> None:
    """Print one line for an interruption while the libraries are imported.

    Nothing else can catch it at that time.
    """
    if not issubclass(kind, KeyboardInterrupt):
        sys.__excepthook__(kind, error, trace)
        return
    # a worker that starts meanwhile leaves the line to the command
    if "--multiprocessing-fork" not in sys.orig_argv:
        print("error: interrupted", file=sys.stderr, flush=True)
    os._exit(INTERRUPTED)


_STARTED_AS = [("-m", name) for name in ("fourbar", "validation", "fourbar_validation")]
"""The commands of this project. A program that imports it reports its own
interruptions.
"""
if Path(sys.argv[0] if sys.argv else "").stem in (
    "fourbar",
    "fourbar-validation",
) or any(
    pair in _STARTED_AS for pair in zip(sys.orig_argv, sys.orig_argv[1:], strict=False)
):
    sys.excepthook = _report_interruption
