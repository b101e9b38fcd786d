"""`findings`: each finding's script where its simulator is, in an environment that has it."""

import ast
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import dedent

import click

from fourbar.errors import DependencyError, InputError
from fourbar_lab.simulators.examine import LOOK
from fourbar_validation.engines.processes import Ended, run_to_end
from fourbar_validation.places import CHECKOUT

FOLDER = None if CHECKOUT is None else CHECKOUT / "docs" / "findings"
FIELDS = ("Engine", "With", "Expected", "Found", "Since", "Until", "Reported")
"""Fields of a script's docstring, after its first sentence; Engine: the name for pip, in brackets what is imported."""
MENDED = "mended"
"""Word that a script prints at its end, with exit status 1, if the finding no longer holds."""


@dataclass(frozen=True, slots=True)
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

    def run(self, python: Path, seconds: float) -> str:
        """Run the script: "holds", "mended" or why it could not run."""
        return read_outcome(run_to_end([python, self.script], seconds=seconds))


def read_outcome(done: Ended) -> str:
    """Return what a script's end says; a traceback is no "mended"."""
    if not done.failed:
        return "holds"
    return MENDED if done.last == MENDED else f"not run: {done.last}"


def read(script: Path) -> Reproduction:
    """Read the docstring of a script."""
    sentence, _, rest = (ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or "").partition("\n")
    stated = re.findall(rf"^({'|'.join(FIELDS)}): (.*(?:\n  .*)*)", dedent(rest), re.MULTILINE)
    return Reproduction(script, sentence, {name: " ".join(text.split()) for name, text in stated})


def read_findings() -> list[Reproduction]:
    """Read the scripts of a checkout."""
    return [read(path) for path in sorted(FOLDER.glob("*.py") if FOLDER else ())]


def find_interpreter(finding: Reproduction, pythons: Sequence[Path]) -> tuple[Path, str] | None:
    """Find the first interpreter that has the engine, and its version there."""
    name, module = finding.engine
    for python in pythons:
        look = f"{LOOK.format(module)}; print(importlib.metadata.version({name!r}), sys.version.split()[0])"
        done = run_to_end([python, "-c", look])
        if not done.failed:
            version, of_python = done.out.split()
            return python, f"{name} {version}, Python {of_python}"
    return None


def run_findings(pythons: Sequence[Path], seconds: float) -> list[tuple[Reproduction, str]]:
    """Run each finding where its engine is: what came of it, in words."""
    made = []
    for finding in read_findings():
        place = find_interpreter(finding, pythons)
        if place is None:
            made.append((finding, f"not run: {finding.engine[0]} is not installed under any --python"))
        else:
            made.append((finding, f"{finding.run(place[0], seconds)} in {place[1]}"))
    return made


@click.command()
@click.argument("scripts", nargs=-1, type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--python", "pythons", type=click.Path(path_type=Path), multiple=True, help="An environment (repeat).")
@click.option("--time-limit", default=600.0, show_default=True, help="Seconds for each script.")
def command(scripts: tuple[Path, ...], pythons: tuple[Path, ...], time_limit: float) -> None:
    """Run the scripts of docs/findings where their simulators are."""
    chosen = [read(script) for script in scripts]
    for finding in chosen:
        if "Engine" not in finding.fields:
            raise InputError("SCRIPT", str(finding.script), "has no line 'Engine: NAME (MODULE)' in its docstring")
    found = run_findings([Path(sys.executable), *(path.absolute() for path in pythons)], time_limit)
    wanted = {finding.script.resolve() for finding in chosen} or {each.script for each, _ in found}
    for finding, state in found:
        if finding.script in wanted:
            click.echo(f"{finding.script.name}: {state}")
    if all(state.startswith("not run") for _, state in found):
        raise DependencyError("no finding's simulator is installed here or under a --python")
