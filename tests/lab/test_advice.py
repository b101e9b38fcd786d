"""How good the advice is.

On linkages that it has never seen, against an exhaustive search.
"""

from pytest import mark

from fourbar.errors import FAILED, HOLDS
from fourbar_lab import advice
from fourbar_lab.cli import status as ended

pytestmark = mark.slow


@mark.parametrize("index", [9, 10])
def test_an_unseen_linkage_is_served_and_not_at_three_times_the_cheapest(index):
    """A linkage of the study `advice` is judged between the positions that the advice
    saw. These two ask for two digits, which a search finds in few steps.
    """
    case = advice.measure_case(99, index, {("RK4", True): 1.0})
    assert case.met and case.cheap, case


# Wilson: n of n met are at least n/(n + 1.96^2) at 95 %
@mark.parametrize("count, decided", [(72, FAILED), (73, HOLDS)])
def test_few_cases_cannot_tell_how_often_the_advice_is_met(
    count, decided, tmp_path, monkeypatch
):
    """Each case is met at little more cost than the cheapest."""
    case = advice.AdviceCase(0, 1e-3, True, 5e-4, 20.0, 19.0)
    monkeypatch.setattr(advice, "measure_case", lambda *_: case)
    monkeypatch.setattr(advice, "time_relative_costs", lambda setup: {})
    assert ended(["advice", "--count", str(count), "--out", str(tmp_path)]) == decided
