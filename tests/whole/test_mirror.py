"""Whoever opens a module knows its test.

Tests/ mirrors the tree, and what has no test of its name stands below.
`tests/fourbar/formulas/test_position.py` is of `fourbar/formulas/position.py`, as is
`test_position_more.py`; a test may have the name of its folder. `whole/` is of no
module alone, `support/` holds what tests share.
"""

from pytest import mark

from tests.support.checkout import ROOT
from tests.support.rows import read_rows

SOURCES = {
    "fourbar": ROOT / "fourbar",
    "validation": ROOT / "validation" / "fourbar_validation",
    "lab": ROOT / "lab" / "fourbar_lab",
}
"""Folder of tests, and folder of the modules that it mirrors."""
JUDGED_BY = read_rows("""
# what a command reads, does and prints is tested through the command
fourbar/cli/test_cli.py | analyze export given
fourbar/cli/test_cli.py | fourbar/show: tables
whole/test_exits.py | validation: cli
whole/test_exits.py | validation/report: sentences terminal
whole/test_exits.py | lab: cli fuzz_files
whole/test_narrow_terminal.py | fourbar/show: folded
whole/test_results_format.py | validation/compare: results_file
# one table or one evaluation, whose rows are no use alone
fourbar/effects/test_effects.py | *
fourbar/edit/test_session.py | dragging scene_entries
fourbar/edit/test_server.py | redirect
fourbar/files/test_files.py | new_scene scene_text
fourbar/formulas/test_formulas.py | arithmetic many_digits path
fourbar/studies/test_equilibrium.py | circuit_curve
fourbar/studies/test_equilibrium.py | fourbar/show: studies
fourbar/test_solving.py | fourbar/evaluation: case
fourbar/show/test_located.py | fourbar/studies: course
fourbar/show/test_columns.py | derived
fourbar/show/test_position_sheet.py | change_point
fourbar/show/test_summary.py | driving motion_curves
# parts of one document or picture
fourbar/mjcf/test_mjcf.py | document model
fourbar/show/test_animate.py | fourbar/show/plot: film
fourbar/show/test_page.py | tolerances
fourbar/show/plot/test_plot.py | figures freebody labels linkage_figure style
fourbar/show/plot/test_plot.py | tolerance_figures view
# a comparison is tested by engines with given answers
validation/run/test_judge.py | validation/compare: answer bodies effect_sizes
validation/run/test_judge.py | identities judge_engines law question
# adapters: judged against printed figures, each other, and faults put in front of
# them
validation/engines/test_engines.py | description limits loaded pinocchio
validation/engines/test_engines.py | lab/engines: drake exudyn exudyn_elements opensim
validation/engines/test_engines.py | validation/scenes: random
validation/engines/test_engines.py | validation/engines/mujoco: inverse
validation/engines/test_guests.py | validation: engine
validation/engines/test_guests.py | programs workers
validation/engines/test_free_body.py | free_body_closure
validation/scenes/test_hard_families.py | validation/engines/mujoco: shipped
validation/scenes/test_hard_families.py | bars
validation/report/test_sections.py | hard_picture
validation/engines/mujoco/test_simulate.py | monitor
validation/check/test_check.py | calculated fitted
validation/check/test_check.py | judge_table theirs wrong_scenes
validation/robots/test_check_mjcf.py | differences guard judge_loop
validation/robots/test_check_mjcf.py | validation/engines/mujoco: describe
validation/robots/test_check_mjcf.py | validation/engines/mujoco/robots: seen
validation/engines/mujoco/robots/test_closures.py | ancestry
validation/robots/test_loops.py | options
validation/published/test_published.py | comparison printed_figures thesis
validation/regression/test_regression.py | accept history record render rules
validation/regression/test_regression.py | scenes
validation/report/test_report.py | machine overview run_summary
validation/report/test_report.py | scene_record svg templating words
# studies: each through its command
lab/test_bench.py | contenders
lab/test_effect_costs.py | tables
lab/test_stability.py | families slopes tally
lab/test_faults.py | each fault_scenes injection
validation/cost/test_cost.py | charts work_precision
validation/cost/test_cost.py | validation/advise: clocks
lab/test_benchmark.py | lab/simulators: slider_engines slider_mujoco slider_pinocchio
lab/simulators/test_problems.py | slider_crank
lab/simulators/test_problems.py | validation/check: problem
# simulators that need not be there: their scripts run where they are installed
lab/simulators/test_simulators.py | dart drake_sap exudyn_simulated
lab/simulators/test_simulators.py | genesis_rigid gradients mujoco_c
lab/simulators/test_simulators.py | mujoco_mjx mujoco_warp newton_kamino
lab/simulators/test_simulators.py | newton_mujoco pinocchio_simulated
lab/simulators/test_simulators.py | protocol_engines pybullet
""")
"""A test, and the modules without a test of their name of which it says when they are
wrong: those of its own folder if none is named.
"""


def listed():
    """The test of each module of the table."""
    tests_of = {}
    for test, group in JUDGED_BY:
        folder, _, names = group.rpartition(": ")
        folder = folder or test.rpartition("/")[0]
        if names == "*":  # all that have none of their own
            top, _, inner = folder.partition("/")
            paths = (SOURCES[top] / inner).glob("[!_]*.py")
            names = " ".join(path.stem for path in paths if not own_test(path, top))
        tests_of |= {f"{folder}/{name}.py": test for name in names.split()}
    return tests_of


def own_test(path, top):
    """Whether a module has a test of its name."""
    folder = ROOT / "tests" / top / path.parent.relative_to(SOURCES[top])
    return any(
        [*folder.glob(f"test_{path.stem}.py"), *folder.glob(f"test_{path.stem}_*.py")]
    )


@mark.parametrize("top", SOURCES)
def test_every_module_has_a_test_or_is_listed(top):
    paths = list(SOURCES[top].rglob("[!_]*.py"))
    assert paths
    without = {
        f"{top}/{path.relative_to(SOURCES[top]).as_posix()}"
        for path in paths
        if not own_test(path, top)
    }
    assert without == {name for name in listed() if name.partition("/")[0] == top}


def test_the_tests_of_the_table_are_there():
    assert all((ROOT / "tests" / test).is_file() for test, _ in JUDGED_BY)


@mark.parametrize("top", SOURCES)
def test_every_test_has_the_name_of_a_module_or_folder(top):
    for test in (ROOT / "tests" / top).rglob("test_*.py"):
        folder = SOURCES[top] / test.parent.relative_to(ROOT / "tests" / top)
        names = {folder.name, *(entry.stem for entry in folder.iterdir())}
        name = test.stem.removeprefix("test_")
        assert any(
            name == module or name.startswith(f"{module}_") for module in names
        ), test
