"""`findings`: each finding's script in an environment with its simulator.

The environments are those of engines.toml.
"""

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from textwrap import dedent

import click

from fourbar.errors import DependencyError, InputError
from fourbar.linkage import record
from fourbar_validation.engines.environments import make_environment, read_engines
from fourbar_validation.engines.programs import run_to_end
from fourbar_validation.places import CHECKOUT

FINDINGS = None if CHECKOUT is None else CHECKOUT / "docs" / "findings"
FIELDS = ("Engine", "With", "Expected", "Found", "Since", "Until", "Reported")
"""Fields of a script's docstring, after its first sentence and an empty line. Engine:
the name for pip, in brackets what is imported. A field's further lines are indented.
"""
_LOOK = (
    "import importlib.metadata, importlib.util as u, sys; u.find_spec({0!r}) or"
    " sys.exit(1)"
)
"""Program for a Python interpreter that fails if a module is not installed."""
FIXED = "fixed"
"""Word that a script prints at its end if the finding no longer holds. Its exit status
is then 1.
"""


@record
class Reproduction:
    """Docstring of a script of docs/findings, in parts."""

    script: Path
    sentence: str
    fields: dict[str, str]

    @property
    def engine(self) -> tuple[str, str]:
        """Return its name for pip and the module that is imported."""
        name, _, module = self.fields["Engine"].partition(" ")
        return name, module.strip("()")

    def run(self, python: str | Path, seconds: float) -> str:
        """Run the script: "holds", "fixed" or why it could not run.

        A traceback is no "fixed".
        """
        done = run_to_end([python, self.script], seconds=seconds)
        if not done.failed:
            return "holds"
        if done.last == FIXED:
            return FIXED
        return f"not run: {done.last}"


def read_docstring(script: Path) -> Reproduction:
    """Read the docstring of a script."""
    module = ast.parse(script.read_text(encoding="utf-8"))
    sentence, _, rest = (ast.get_docstring(module) or "").partition("\n\n")
    stated = re.findall(
        rf"^({'|'.join(FIELDS)}): (.*(?:\n  .*)*)",
        dedent(rest),
        re.MULTILINE,
    )
    return Reproduction(
        script,
        _fold(sentence),
        {name: _fold(text) for name, text in stated},
    )


def _fold(text: str) -> str:
    return " ".join(text.split())


def read_findings() -> list[Reproduction]:
    """Read the scripts of a checkout."""
    scripts = FINDINGS.glob("*.py") if FINDINGS else ()
    return [read_docstring(path) for path in sorted(scripts)]


def find_interpreter(finding: Reproduction) -> tuple[str, str] | None:
    """Find the first interpreter that has the engine, and its version there."""
    name, module = finding.engine
    for python in _list_interpreters(name):
        look = (
            f"{_LOOK.format(module)}; print(importlib.metadata.version({name!r}),"
            " sys.version.split()[0])"
        )
        done = run_to_end([python, "-c", look])
        if not done.failed:
            version, of_python = done.out.split()
            return python, f"{name} {version}, Python {of_python}"
    return None


def _list_interpreters(name: str) -> Iterator[str]:
    """Return this interpreter, and those of the engines that require a package.

    The package is installed by pip for the first of these.
    """
    yield sys.executable
    for entry in read_engines([]).values():
        named = [re.split(r"[^\w.-]", text)[0] for text in entry.requires]
        if name in named:
            try:
                yield make_environment(entry)
            except DependencyError as error:
                click.echo(str(error), err=True)


def _run_finding(finding: Reproduction, seconds: float) -> str:
    """Run a finding where its engine is: what came of it, in words."""
    place = find_interpreter(finding)
    if place is None:
        name, _ = finding.engine
        return f"not run: {name} is not installed, and no engine requires it"
    python, versions = place
    return f"{finding.run(python, seconds)} in {versions}"


@click.command()
@click.argument(
    "scripts",
    nargs=-1,
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
)
@click.option(
    "--time-limit",
    default=600.0,
    show_default=True,
    help="Seconds for each script.",
)
def findings_command(scripts: tuple[Path, ...], time_limit: float) -> None:
    """Run the scripts of docs/findings where their simulators are installed.

    A simulator is installed here or in its environment of engines.toml.
    """
    chosen = [read_docstring(script) for script in scripts] or read_findings()
    for finding in chosen:
        if "Engine" not in finding.fields:
            why = "has no line 'Engine: NAME (MODULE)' in its docstring"
            raise InputError("SCRIPT", str(finding.script), why)
    states = [_run_finding(finding, time_limit) for finding in chosen]
    for finding, state in zip(chosen, states, strict=True):
        click.echo(f"{finding.script.name}: {state}")
    if all(state.startswith("not run") for state in states):
        raise DependencyError(
            "no finding's simulator is installed here or required by an engine of"
            " engines.toml"
        )
