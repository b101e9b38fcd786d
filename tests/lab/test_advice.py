"""How good the advice is.

On linkages that it has never seen, against an exhaustive search.
"""

from dataclasses import replace

import pytest

from fourbar.scene import command
from fourbar_lab import advice
from fourbar_lab.advice import try_all_settings
from fourbar_lab.cli import status as ended
from fourbar_validation.advise import advise
from fourbar_validation.engines.mujoco.trial import TrialSetup
from tests.validation.cost.test_cost import turning


@pytest.mark.slow
@pytest.mark.parametrize("index", [9, 10])
def test_an_unseen_linkage_is_served_and_not_at_three_times_the_cheapest(index):
    """A linkage of the study `advice` is judged between the positions that the advice
    saw. These two ask for two digits, which a search finds in few steps.
    """
    case = advice.measure_case(99, index, {("RK4", True): 1.0})
    assert case.met and case.cheap, case


@pytest.mark.slow
def test_the_search_knows_when_nothing_serves():
    scene = turning(positions=12)
    setup = TrialSetup(scene, command(scene))
    assert try_all_settings(setup, 1e-3, {("RK4", True): 1.0}) is not None
    trials = []
    setup.try_out = lambda settings: trials.append(settings) or hopeless(scene)
    assert (
        try_all_settings(setup, 1e-3, {("RK4", True): 1.0}) is None and len(trials) > 50
    )


def hopeless(scene):
    made = TrialSetup(scene, command(scene)).try_out(advise.make_settings(10.0, 3.0))
    made.broken = "lost"
    return made


@pytest.mark.slow
def test_a_count_that_cannot_decide_says_which_one_can(tmp_path, monkeypatch, capsys):
    case = advice.AdviceCase(0, 1e-3, True, 5e-4, 20.0, 19.0)
    monkeypatch.setattr(
        advice, "measure_case", lambda seed, index, costs: replace(case, index=index)
    )
    monkeypatch.setattr(advice, "time_relative_costs", lambda setup: {})
    for count, status in ((40, 1), (73, 0)):
        assert (
            ended(
                ["advice", "--count", str(count), "--out", str(tmp_path / str(count))]
            )
            == status
        )
        stated = (
            "undecided: with 0 not met the bound is reached from --count 73 on"
            in capsys.readouterr().out
        )
        assert stated == (status == 1)


def test_a_measure_is_resumed(tmp_path, monkeypatch):
    made = []

    def case(seed, index, costs):
        made.append(index)
        return advice.AdviceCase(index, 1e-3, True, 5e-4, 20.0, 19.0)

    monkeypatch.setattr(advice, "measure_case", case)
    monkeypatch.setattr(advice, "time_relative_costs", lambda setup: {})
    out = tmp_path / "study"
    list(advice.measure_cases(3, 2, out))
    cases = list(advice.measure_cases(3, 4, out))
    assert (
        made == [0, 1, 2, 3]
        and [measured.index for measured in cases] == made
        and all(measured.met for measured in cases)
    )
    made.clear()
    list(advice.measure_cases(4, 1, out))  # another seed starts over
    assert made == [0]
