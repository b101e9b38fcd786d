"""How good the advice is.

On linkages that it has never seen, against an exhaustive search.
"""

import pytest

from fourbar.errors import FAILED, HOLDS
from fourbar.scene import command
from fourbar_lab import advice
from fourbar_lab.advice import try_all_settings
from fourbar_lab.cli import status as ended
from fourbar_validation.advise import advise
from fourbar_validation.engines.mujoco.trial import TrialSetup
from tests.validation.cost.test_cost import turning

RK4_ALONE = {("RK4", True): 1.0}


@pytest.mark.slow
@pytest.mark.parametrize("index", [9, 10])
def test_an_unseen_linkage_is_served_and_not_at_three_times_the_cheapest(index):
    """A linkage of the study `advice` is judged between the positions that the advice
    saw. These two ask for two digits, which a search finds in few steps.
    """
    case = advice.measure_case(99, index, RK4_ALONE)
    assert case.met and case.cheap, case


@pytest.mark.slow
def test_the_search_knows_when_nothing_serves():
    scene = turning(positions=12)
    setup = TrialSetup(scene, command(scene))
    assert try_all_settings(setup, 1e-3, RK4_ALONE) is not None
    lost = setup.try_out(advise.make_settings(10.0, 3.0))
    lost.broken = "lost"
    trials = []
    setup.try_out = lambda settings: trials.append(settings) or lost
    assert try_all_settings(setup, 1e-3, RK4_ALONE) is None and len(trials) > 50


@pytest.fixture
def measured(monkeypatch):
    """Numbers of the cases that are measured: each is met at little more cost."""
    numbers = []

    def measure(seed, index, costs):
        numbers.append(index)
        return advice.AdviceCase(index, 1e-3, True, 5e-4, 20.0, 19.0)

    monkeypatch.setattr(advice, "measure_case", measure)
    monkeypatch.setattr(advice, "time_relative_costs", lambda setup: {})
    return numbers


# Wilson: n of n met are at least n/(n + 1.96^2) at 95 %
@pytest.mark.slow
@pytest.mark.usefixtures("measured")
@pytest.mark.parametrize(("count", "decided"), [(72, FAILED), (73, HOLDS)])
def test_few_cases_cannot_tell_how_often_the_advice_is_met(count, decided, tmp_path):
    assert ended(["advice", "--count", str(count), "--out", str(tmp_path)]) == decided


def test_a_measure_is_resumed(tmp_path, measured):
    list(advice.measure_cases(3, 2, tmp_path))
    cases = list(advice.measure_cases(3, 4, tmp_path))
    assert [case.number for case in cases] == measured == [0, 1, 2, 3]
    assert all(case.met and case.cheap for case in cases)
    measured.clear()
    list(advice.measure_cases(4, 1, tmp_path))  # another seed starts over
    assert measured == [0]
