"""The command: mutants of the formulas against the tests (mutmut), or against the harness alone."""

import json
import os
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

import click

from fourbar.errors import DependencyError, InputError, installing
from fourbar.writing import write_text
from fourbar_validation.lab.stress.mutation.harness import MODULES
from fourbar_validation.lab.stress.mutation.planted import planted as every_fault
from fourbar_validation.lab.stress.mutation.planting import faults
from fourbar_validation.places import checkout

COPIED = ("fourbar", "validation", "tests", "models", "docs", "README.md", "CHANGELOG.md", "Makefile", "pyproject.toml")
IN_TREE = os.pathsep.join((".", "validation"))
"""Where a copy of the checkout has its packages."""
LEAST = 0.95
"""Share of the mutants that must be caught."""
HARMLESS = Path(__file__).parent / "harmless.json"
"""By function and changed line: survivors that change nothing that anyone could notice, each with its reason."""
CAUGHT = 1
"""Status of pytest where a test failed."""
ALIVE = ("survived", "no tests", "suspicious")
UNTRIED = ("", "not checked", "check was interrupted by user")


@click.command()
@click.option("--harness", is_flag=True, help="The harness alone, on mutants that change a number by more than 1e-9.")
@click.option("--planted", is_flag=True, help="The faults of planted.toml, one at a time, against the harness.")
@click.option("--module", type=click.Choice(MODULES), help="Only this one.")
@click.option("--most", default=0, type=click.IntRange(0), help="With --harness: at most this many per module.")
@click.option("--whole", is_flag=True, help="Try survivors without a reason on the whole suite (minutes each).")
@click.option("--again", is_flag=True, help="Only what survived the last run into --out, after tests were added.")
@click.option("--workers", default=2, show_default=True, type=click.IntRange(1))
@click.option("-o", "--out", type=click.Path(path_type=Path, file_okay=False), default=Path("results/mutation"))
def mutation(
    harness: bool, planted: bool, module: str | None, most: int, whole: bool, again: bool, workers: int, out: Path
) -> int:
    """Measure the checks: small faults in the formulas, one at a time, against `make test` or the harness alone.

    The tests of the formulas are tried (pyproject.toml names them), the fast ones first: what they
    catch, `make test` catches. Every survivor needs a reason in harmless.json.
    """
    checkout("mutation")
    if planted:
        return _planted(workers)
    if most and not harness:
        raise InputError("--most", most, "is for --harness; mutmut itself runs whole modules")
    if again and harness:
        raise InputError("--again", again, "is for the tests; the harness tries every mutant")
    tree = out / "tree"
    if again and not tree.is_dir():
        raise InputError("--again", again, f"no run into {out} came before")
    mutmut = Path(sys.executable).parent / "mutmut"
    if not mutmut.is_file():
        raise DependencyError(f"mutmut is not installed: {installing('mutation')}")
    _copy(tree)
    if harness:
        return _harness(mutmut, tree, module, most, out)
    modules = [f"fourbar.formulas.{name}*" for name in ([module] if module else MODULES)]
    tried = modules
    if again:  # and those of functions that changed since, whose results are gone
        _generate(mutmut, tree)
        tried = [n for n, state in _listed(mutmut, tree, modules).items() if state in (*ALIVE, *UNTRIED)]
    if tried and (status := _run(mutmut, tree, tried, workers, out / "mutmut.log")):
        print(f"mutmut stopped with status {status}: the results in {out} are not those of this checkout")
        return 1
    states = _listed(mutmut, tree, modules)
    survivors = {name: _change(mutmut, tree, name) for name, state in states.items() if state in ALIVE}
    if whole:
        reasons = _reasons()
        for name in _caught_by_all(tree, [n for n, change in survivors.items() if change not in reasons], workers):
            states[name] = "killed"
            del survivors[name]
    return _reported(states, survivors, out)


def _planted(workers: int) -> int:
    """Every planted fault; 1 where one survives without a reason, or the harness fails without a fault."""
    from rich.console import Console
    from rich.progress import track

    results = list(track(every_fault(workers), "planting", total=len(faults()) + 1, console=Console(stderr=True)))
    survivors = [(fault, why) for fault, why in results if why is not None]
    for fault, why in survivors:
        print(f"{fault}: {why}")
    print(f"{len(results) - 1} planted faults, {len(survivors)} of them survive without a reason on record")
    return 1 if survivors else 0


def _copy(tree: Path) -> None:
    """The checkout, without what earlier runs made of it; mutmut's own record in the tree stays."""
    root = checkout("mutation")
    tree.mkdir(parents=True, exist_ok=True)
    for name in COPIED:
        source, target = root / name, tree / name
        if source.is_dir():
            shutil.rmtree(target, ignore_errors=True)
            shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__"))
        elif source.is_file():
            shutil.copy2(source, target)


def _generate(mutmut: Path, tree: Path) -> None:
    """All mutants, those of changed functions anew: given a name that none has, mutmut then stops."""
    subprocess.run([mutmut, "run", "fourbar.none*"], cwd=tree, check=False, capture_output=True)


def _run(mutmut: Path, tree: Path, names: list[str], workers: int, log: Path) -> int:
    """Try the mutants named; mutmut's status, which is 0 with survivors too and not where a test fails without any."""
    command = [str(mutmut), "run", "--max-children", str(workers), *names]
    if sys.stdout.isatty():
        return subprocess.run(command, cwd=tree, check=False).returncode
    with log.open("w", encoding="utf-8") as shown:  # its display is for a terminal
        return subprocess.run(command, cwd=tree, check=False, stdout=shown, stderr=shown).returncode


def _listed(mutmut: Path, tree: Path, modules: list[str]) -> dict[str, str]:
    """What mutmut has on record of the mutants of the modules."""
    listed = subprocess.run([mutmut, "results", "--all", "true"], cwd=tree, check=True, capture_output=True, text=True)
    return _states(listed.stdout, modules)


def _states(listed: str, modules: list[str]) -> dict[str, str]:
    """What became of each mutant of the modules."""
    prefixes = tuple(name.rstrip("*") for name in modules)
    states = {}
    for line in listed.splitlines():
        name, _, state = line.strip().partition(":")  # of one that was not tried the state may be missing
        if name.startswith(prefixes):
            states[name] = state.strip()
    return states


def _reasons() -> dict[str, str]:
    """Changes on record, as `_change` words them, and why each is harmless."""
    recorded = json.loads(HARMLESS.read_text(encoding="utf-8")) if HARMLESS.is_file() else {}
    return {
        f"{function}: {change}": reason for function, changes in recorded.items() for change, reason in changes.items()
    }


def _change(mutmut: Path, tree: Path, name: str) -> str:
    """Function and changed line of a mutant; its number alone would mean another mutant after any edit."""
    shown = subprocess.run([mutmut, "show", name], cwd=tree, check=True, capture_output=True, text=True).stdout
    lines = [line for line in shown.splitlines() if line[:1] in ("-", "+") and line[:4] not in ("--- ", "+++ ")]
    old, new = (" ".join(line[1:].strip() for line in lines if line[0] == sign) for sign in "-+")
    mangled = name.partition("__mutmut_")[0].removeprefix(
        "fourbar.formulas."
    )  # module.x_function, module.xǁClassǁmethod
    function = mangled.replace(".x_", ".").replace(".xǁ", ".").replace("ǁ", ".")
    return f"{function}: {old} -> {new}"


def _caught_by_all(tree: Path, names: list[str], workers: int) -> list[str]:
    """Those of the mutants that some test of the whole suite catches."""
    mutants = tree / "mutants"

    def tested(name: str, *options: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-n", str(workers), *options]
        environment = {**os.environ, "PYTHONPATH": IN_TREE, "MUTANT_UNDER_TEST": name}
        return subprocess.run(command, cwd=mutants, check=False, capture_output=True, text=True, env=environment)

    if not names:
        return []
    # what fails on the copy without a mutant (no repository, slower calls) says nothing
    failing = [line.split()[1] for line in tested("", "-rfE").stdout.splitlines() if line[:6] in ("FAILED", "ERROR ")]
    without = [f"--deselect={test}" for test in failing]
    return [name for name in names if tested(name, "-x", *without).returncode == CAUGHT]


def _reported(states: dict[str, str], survivors: dict[str, str], out: Path) -> int:
    """Kill rate per module, and the survivors with the reason that is on record for them."""
    reasons = _reasons()
    untried = [name for name, state in states.items() if state in UNTRIED]
    count = Counter((name.split(".")[2], name in survivors or name in untried) for name in states)
    shares = {}
    for module in MODULES:
        dead, alive = count[module, False], count[module, True]
        if dead + alive:
            shares[module] = dead / (dead + alive)
            print(f"{module}: {dead} of {dead + alive} mutants killed ({shares[module]:.1%})")
    killed = len(states) - len(survivors) - len(untried)
    if states:
        print(f"together: {killed} of {len(states)} ({killed / len(states):.1%})")
    if untried:
        print(f"{len(untried)} mutants were not tried: the run of mutmut ended before it came to them")
    lines = [f"{change}\n    {reasons.get(change, 'NO REASON ON RECORD')}" for change in sorted(survivors.values())]
    write_text(out / "survivors.txt", "\n".join(lines) + "\n")
    unknown = sum(change not in reasons for change in survivors.values())
    print(f"{len(survivors)} survivors, {unknown} without a reason, are listed in {out / 'survivors.txt'}")
    idle = [change for change in reasons if change.split(".")[0] in shares and change not in survivors.values()]
    if idle:
        print("on record, but of no survivor:", *idle, sep="\n    ")
    return 0 if shares and min(shares.values()) >= LEAST and not unknown and not untried else 1


def _harness(mutmut: Path, tree: Path, module: str | None, most: int, out: Path) -> int:
    """Generate the mutants with mutmut, then try them on the harness in the mutated tree."""
    generated = tree / "mutants"
    _generate(mutmut, tree)
    arguments = [sys.executable, "-m", "fourbar_validation.lab.stress.mutation.harness", module or "", str(most)]
    environment = {**os.environ, "PYTHONPATH": IN_TREE}
    done = subprocess.run(arguments, cwd=generated, check=True, stdout=subprocess.PIPE, text=True, env=environment)
    result = json.loads(done.stdout.splitlines()[-1])
    write_text(out / "harness.json", json.dumps(result, indent=1))
    changing = sum(tally["changing"] for tally in result.values())
    found = sum(tally["caught"] for tally in result.values())
    for name, tally in result.items():
        print(f"{name}: {tally['caught']} of {tally['changing']} caught, of {tally['mutants']} mutants tried")
    print(f"the harness alone catches {found} of {changing}; the others are listed in {out / 'harness.json'}")
    return 0 if changing and found >= LEAST * changing else 1
