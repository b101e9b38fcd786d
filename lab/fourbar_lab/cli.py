"""Commands of the lab, each imported from its own module when it is called."""

import sys

from fourbar.errors import run
from fourbar_validation.cli import LazyCommand, LazyGroup

LAB_PROGRAM = "python -m fourbar_lab"
LAB_COMMANDS = {
    "stability": LazyCommand(
        "fourbar_lab.stability:stability",
        "Measure the error of every output against 50-digit arithmetic.",
    ),
    "bench": LazyCommand(
        "fourbar_lab.bench:bench",
        "Time NumPy, C and the 13x13 system side by side; ratios that must hold.",
    ),
    "effects": LazyCommand(
        "fourbar_lab.effect_costs:effects",
        "Time each effect in each engine, and each flag of MuJoCo; a minute.",
    ),
    "worlds": LazyCommand(
        "fourbar_lab.worlds:worlds_command",
        "Time torque and pin forces of many positions at once, on a GPU.",
    ),
    "advice": LazyCommand(
        "fourbar_lab.advice:advice_command",
        "Measure the advice on random linkages.",
    ),
    "fuzz": LazyCommand(
        "fourbar_lab.fuzz:fuzz",
        "Put random scenes through files, formulas and exact engines.",
    ),
    "fuzz-files": LazyCommand(
        "fourbar_lab.fuzz_files:fuzz_files",
        "Read mutated scene files.",
    ),
    "faults": LazyCommand(
        "fourbar_lab.faults:faults_command",
        "Make each fault of faults.toml, one at a time; each must be caught.",
    ),
    "mutants": LazyCommand(
        "fourbar_lab.mutants:mutants_command",
        "Change operators and numbers of the formulas, one at a time.",
    ),
    "findings": LazyCommand(
        "fourbar_lab.simulators.findings:findings_command",
        "Run the scripts of docs/findings where their simulators are installed.",
    ),
    "write": LazyCommand(
        "fourbar_lab.write:write_command",
        "Write the MJCF of every scene in models/ for which it is stale.",
    ),
    "problems": LazyCommand(
        "fourbar_lab.simulators.problems:problems_command",
        "Write the problems of models/problems and their answers as JSON.",
    ),
    "benchmark": LazyCommand(
        "fourbar_lab.benchmark:benchmark_command",
        "Ask every engine every problem of models/problems.",
    ),
}


group = LazyGroup(
    "fourbar-lab",
    """Study the formulas, the harness that checks them, and the engines.

    Exit status: 0 all holds, 1 something does not hold, 2 the input is bad, 3 the
    environment or the program failed, 130 interrupted.
    """,
    LAB_COMMANDS,
)


def main(arguments: list[str] | None = None) -> None:
    """Run a command and leave with the exit status."""
    sys.exit(status(arguments))


def status(arguments: list[str] | None = None) -> int:
    """Run a command and return its exit status.

    An error becomes one line on standard error.
    """
    return run(group, LAB_PROGRAM, arguments)
