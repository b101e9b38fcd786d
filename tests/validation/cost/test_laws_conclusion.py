"""The conclusion of a study: few lines, by the criterion of its pictures."""

from dataclasses import replace

from fourbar_validation.advise.matters import WorstErrors
from fourbar_validation.cost import charts, laws
from tests.support.costs import point


def test_statement_and_conclusion_have_one_criterion():
    """A setting counts, here and on the front, by its error at the steps and between
    them.
    """
    curves = {
        "recommended": [point(30, 5e-5)],
        "d": [replace(point(300, 4e-3), setting=laws.DEFAULT)],
        "RK4": [replace(point(10, 0.1), at_steps=WorstErrors(*[1e-9] * 5))],
    }
    assert (
        charts.write_statement(curves, "torque")
        == "Four digits of torque cost 0.06 ms a simulated second;\n"
        "MuJoCo's defaults have an error of 4e-3"
    )
    lines = laws.conclude(curves, [], [])
    assert len(lines) <= 11
    assert (
        "Four digits of every pin force: 0.06 ms (0.03 ms a revolution) by "
        "c, 30 steps a revolution." in lines
    )
    assert (
        "Six digits of every pin force: no setting that was tried reaches them."
        in lines
    )
