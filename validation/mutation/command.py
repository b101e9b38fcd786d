"""The command: mutants of the formulas against the tests (mutmut), or against the harness alone."""

import json
import os
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

import click

from fourbar.errors import DependencyError, InputError
from fourbar.writing import write_text
from validation.mutation.harness import MODULES

ROOT = Path(__file__).parent.parent.parent
COPIED = ("fourbar", "validation", "tests", "models", "docs", "README.md", "CHANGELOG.md", "Makefile", "pyproject.toml")
LEAST = 0.95
"""Share of the mutants that must be caught."""
HARMLESS = Path(__file__).parent / "harmless.json"
"""Survivors that change nothing that anyone could notice, each with its reason."""
ALIVE = ("survived", "no tests", "suspicious")


@click.command()
@click.option("--harness", is_flag=True, help="The harness alone, on mutants that change a number by more than 1e-9.")
@click.option("--module", type=click.Choice(MODULES), help="Only this one.")
@click.option("--most", default=0, type=click.IntRange(0), help="With --harness: at most this many per module.")
@click.option("--workers", default=2, show_default=True, type=click.IntRange(1))
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), default=Path("results/mutation"))
def mutation(harness: bool, module: str | None, most: int, workers: int, out: Path) -> int:
    """Measure the checks: small faults in the formulas, one at a time, against `make test` or the harness alone."""
    mutmut = Path(sys.executable).parent / "mutmut"
    if not mutmut.is_file():
        raise DependencyError('mutmut is not installed: pip install "fourbar[mutation]"')
    if most and not harness:
        raise InputError("--most", most, "is for --harness; mutmut itself runs whole modules")
    tree = out / "tree"
    _copy(tree)
    if harness:
        return _harness(mutmut, tree, module, most, out)
    names = [f"fourbar.{name}*" for name in ([module] if module else MODULES)]
    # its own status says nothing of survivors; the results are read below
    subprocess.run([mutmut, "run", "--max-children", str(workers), *names], cwd=tree, check=False)
    listed = subprocess.run([mutmut, "results", "--all", "true"], cwd=tree, check=True, capture_output=True, text=True)
    return _told(listed.stdout, out, names)


def _copy(tree: Path) -> None:
    """The checkout, without what earlier runs made of it; results of unchanged mutants in the tree are kept."""
    tree.mkdir(parents=True, exist_ok=True)
    for name in COPIED:
        source, target = ROOT / name, tree / name
        if source.is_dir():
            shutil.rmtree(target, ignore_errors=True)
            shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__"))
        elif source.is_file():
            shutil.copy2(source, target)


def _told(listed: str, out: Path, names: list[str]) -> int:
    """Kill rate per module, and the survivors with the reason that is on record for them."""
    harmless: dict[str, str] = json.loads(HARMLESS.read_text(encoding="utf-8")) if HARMLESS.is_file() else {}
    prefixes = tuple(name.rstrip("*") for name in names)
    states = {}
    for line in listed.splitlines():
        name, _, state = line.strip().partition(": ")
        if name.startswith(prefixes) and state not in ("", "not checked"):
            states[name] = state
    count = Counter((name.split(".")[1], state in ALIVE) for name, state in states.items())
    for module in MODULES:
        dead, alive = count[module, False], count[module, True]
        if dead + alive:
            print(f"{module}: {dead} of {dead + alive} mutants killed ({dead / (dead + alive):.1%})")
    survivors = [name for name, state in sorted(states.items()) if state in ALIVE]
    lines = [f"{name}: {harmless.get(name, 'NO REASON ON RECORD')}" for name in survivors]
    write_text(out / "survivors.txt", "\n".join(lines) + "\n")
    print(f"{len(survivors)} survivors are listed in {out / 'survivors.txt'}")
    killed = len(states) - len(survivors)
    return 0 if states and killed >= LEAST * len(states) else 1


def _harness(mutmut: Path, tree: Path, module: str | None, most: int, out: Path) -> int:
    """Generate the mutants with mutmut, then try them on the harness in the mutated tree."""
    generated = tree / "mutants"
    if not generated.is_dir():
        # a name that no mutant has: mutmut generates all of them, finds none to run and stops
        subprocess.run([mutmut, "run", "fourbar.none*"], cwd=tree, check=False, capture_output=True)
    arguments = [sys.executable, "-m", "validation.mutation.harness", module or "", str(most)]
    environment = {**os.environ, "PYTHONPATH": "."}
    done = subprocess.run(arguments, cwd=generated, check=True, stdout=subprocess.PIPE, text=True, env=environment)
    result = json.loads(done.stdout.splitlines()[-1])
    write_text(out / "harness.json", json.dumps(result, indent=1))
    changing = sum(tally["changing"] for tally in result.values())
    found = sum(tally["caught"] for tally in result.values())
    for name, tally in result.items():
        print(f"{name}: {tally['caught']} of {tally['changing']} caught, of {tally['mutants']} mutants tried")
    print(f"the harness alone catches {found} of {changing}; the others are listed in {out / 'harness.json'}")
    return 0 if found >= LEAST * changing else 1
