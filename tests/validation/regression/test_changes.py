"""What happens to one row from a run to the next, and what a run ends with."""

import html
import math
import re
from collections import Counter
from dataclasses import replace

from pytest import fixture, mark

from fourbar.errors import FAILED, HOLDS
from fourbar_validation.compare.rows import FAILS, REFUSES
from fourbar_validation.compare.tolerance import EQUIVALENCE
from fourbar_validation.regression import render
from fourbar_validation.regression.changes import Kind, write_fault_sentence
from fourbar_validation.regression.record import NOTHING_KNOWN
from tests.support import runs
from tests.support.rows import read_rows
from tests.support.runs import FORMS, WORDS, compare_made_here, compare_rows, kinds

WHY = "Cannot find module 'x'"
ROW = runs.changed(allowed=1e-9, reason="")


def changed(**fields):
    return replace(ROW, **fields)


NAN = math.nan
FAILING = changed(verdict=FAILS)
OTHER = changed(quantity="F12")
KINDS = read_rows("""
agrees 1e-15 1e-9 | agrees 1e-15 1e-9 | same
fails 1e-15 1e-9 | fails 1e-15 1e-9 | fails as before
# round-off of an exact comparison are 50 last digits, 1.1e-14
agrees 1e-15 1e-9 | agrees 9.8e-15 1e-9 | same
agrees 1e-15 1e-9 | agrees 1.33e-14 1e-9 | grew within its allowance
agrees 1e-15 1e-15 | agrees 1.33e-14 1e-9 | worse
# over the condition
agrees 1e-15 1e-13 0.01 | agrees 6.6e-13 1e-13 0.01 | same
agrees 1e-15 1e-13 0.01 | agrees 6.6e-13 1e-13 1 | same
agrees 1e-15 1e-13 0.01 | agrees 1.33e-12 1 0.01 | worse
agrees 1e-15 1e-13 0.01 | agrees 1.33e-12 1e-13 1 | worse
# and of a simulation a quarter
agrees 1e-6 1e-5 | agrees 1.2e-6 1e-5 | same
agrees 1e-6 1e-5 | agrees 1.3e-6 1e-5 | grew within its allowance
agrees 1e-6 1e-5 | agrees 1.3e-5 1 | worse
agrees 1e-6 1e-5 | agrees 0.7e-6 1e-5 | better
agrees 1e-6 1e-5 | agrees 0.9e-6 1e-5 | same
agrees 1e-15 1e-9 | degraded 1e-15 1e-9 | verdict got worse
agrees 1e-15 1e-9 | refuses nan 1e-9 | verdict got worse
agrees 1e-15 1e-9 | fails nan 1e-9 | verdict got worse
fails 1e-15 1e-9 | agrees 1e-15 1e-9 | verdict got better
fails 1e-15 1e-9 | fails nan 1e-9 | worse
agrees 1e-15 1e-9 | | gone
fails 1e-15 1e-9 | | gone
fails nan 1e-9 1 exact watch | | gone, and had failed
 | agrees 1e-15 1e-9 1 exact F12 | new
 | fails 1e-15 1e-9 1 exact F12 | new, and fails
agrees 1e-15 1e-9 | agrees 1 1e-9 1 h/2 | not compared
agrees 1e-15 1e-9 | fails 1e-15 1e-9 1 h/2 | new, and fails
fails 1e-15 1e-9 | fails 1e-15 1e-9 1 h/2 | not compared
""")
"""Row of the old and of the new run, and what happened: each line in its own scene.

Of a row verdict, error and what is allowed, then condition, setting and quantity.
"""


def make_row(word, error, allowed, condition=1, setting="exact", quantity="torque"):
    """Return a row of these words."""
    numbers = {"error": float(error), "allowed": float(allowed)}
    numbers["condition"] = float(condition)
    named = {"verdict": WORDS[word], "setting": setting, "quantity": quantity}
    return changed(**numbers, **named)


@fixture(scope="module")
def compared():
    """The runs that have all these rows, and an identity in each scene."""
    runs = ([], [])
    for number, (*both, _) in enumerate(KINDS):
        beside = changed(engine="formulas", error=0.0, allowed=0.0)
        for run, text in zip(runs, both, strict=True):
            rows = [make_row(*text.split()), beside] if text else [beside]
            run += [replace(one, scene=f"case {number}") for one in rows]
    return compare_made_here(*runs)


@mark.parametrize("number", range(len(KINDS)))
def test_each_kind_of_change(number, compared):
    lines = compared.table[compared.table.scene == f"case {number}"]
    (kind,) = lines[lines.engine == "engine"].kind
    assert kind == KINDS[number][-1]


def test_kinds_are_counted_and_shown(compared):
    counts = Counter(kind for *_, kind in KINDS)
    regressing = (Kind.VERDICT_WORSE, Kind.WORSE, Kind.GONE, Kind.NEW_FAILURE)
    assert compared.regressed == sum(counts[kind] for kind in regressing)
    counts[Kind.SAME] += len(KINDS)
    verdict, text = render.write_verdict(compared), render.write_differences(compared)
    for kind, count in counts.items():
        assert f" {count} {kind}" in verdict
        shown = f"\n{kind.capitalize()}: case " in f"\n{text}"
        assert shown == (kind != Kind.SAME)
    found = compare_made_here([ROW], [ROW, replace(OTHER, verdict=FAILS, reason=WHY)])
    assert all(WHY in html.unescape(form(found)) for form in FORMS)


def test_settings_are_paired_only_where_each_run_has_one_of_its_own():
    first, second = (changed(setting=name) for name in ("h", "h/2"))
    third, none = (changed(setting=name) for name in ("h/4", "-"))
    unpaired = [
        ([first], [second, third]),
        ([first, second], [third]),
        ([first], [none]),
        ([none], [first]),
        ([first], [replace(second, quantity="F12")]),
        ([first], [replace(second, engine="formulas")]),
    ]
    for old, new in unpaired:
        assert {*kinds(old, new)} == {Kind.GONE, Kind.NEW}
    assert kinds([first, second], [third, second]) == [Kind.NOT_COMPARED, Kind.SAME]


@mark.parametrize(
    "old, new, status",
    [
        ([ROW], [OTHER], FAILED),
        ([], [ROW], FAILED),
        ([changed(verdict=REFUSES)], [changed(verdict=REFUSES)], FAILED),
        ([FAILING], [FAILING], HOLDS),
    ],
)
def test_two_runs_without_a_comparison_in_common_are_no_success(old, new, status):
    assert compare_made_here(old, new).status == status


def test_of_two_rows_of_one_name_the_worse_counts_in_either_order():
    for twice in ([ROW, FAILING], [FAILING, ROW]):
        assert kinds([ROW], twice) == [Kind.VERDICT_WORSE]
        assert kinds(twice, twice) == [Kind.STILL_FAILS]
        assert kinds(twice, [ROW]) == [Kind.VERDICT_BETTER]


def test_one_exact_engine_alone_is_not_all_of_them():
    assert write_fault_sentence({"one"}, {"one"}) == "only one"


def test_the_worst_change_comes_first():
    old = [changed(scene=name, allowed=1e-15) for name in "abcd"]
    errors = {
        "a": 1e-9,
        "b": NAN,
        "c": 1e-6,
        "d": 1e-12,
    }
    new = [
        changed(scene=name, error=error, verdict=FAILS)
        for name, error in errors.items()
    ]
    new[1] = changed(scene="b", verdict=REFUSES, error=NAN)
    found = compare_made_here(old, new)
    assert [*found.of(Kind.VERDICT_WORSE).scene] == ["c", "a", "d", "b"]


def about(engines, **settings):
    """The record of a run of guests: name of the column, and version."""
    names = ", ".join(engines)
    answers = settings.pop("answers", "F12, torque")
    return replace(
        NOTHING_KNOWN,
        versions={name: version for name, version in engines.items() if version},
        settings={"engines": names, "guests": names, "chosen": ""} | settings,
        rules={name: {"answers": answers, "factor": "1e-9"} for name in engines},
    )


@mark.parametrize(
    "old, new, pairs",
    read_rows("""
wg=1 | wg=2 |
wg=1 | wg 2=2, wg 3=3 | wg=wg 2
wg 1=1, wg 2=2 | wg=3 | wg 1=wg
wg 1=1, wg 2=2 | wg=2 | wg 2=wg
wg 1=1, wg 2=2 | wg 2=2, wg 3=3 | wg 1=wg 3
wg= | wg2= | wg=wg2
wg=, a= | wg2=, b= |
wg=, a= | wg2=, a= | wg=wg2
"""),
)
def test_versions_and_a_renamed_guest_are_compared_as_one(old, new, pairs):
    """Guests and their versions, and who is compared with whom."""
    old, new, pairs = (
        dict(re.findall("([^=,]+)=([^,]*)(?:, )?", text)) for text in (old, new, pairs)
    )
    runs = [
        (about(engines), [changed(engine=name) for name in engines])
        for engines in (old, new)
    ]
    found = compare_rows(*runs)
    gone = old.keys() - new.keys() - pairs.keys()
    assert found.gone == [f"engine {name} is gone (1 row)" for name in sorted(gone)]
    assert found.status == bool(gone)
    same = [*found.table.engine[found.table.kind == Kind.SAME]]
    assert same == sorted({*pairs.values(), *(old.keys() & new.keys())})
    said = "\n".join(found.notes)
    assert all(before in said and after in said for before, after in pairs.items())


def test_a_renamed_guest_is_held_to_its_rule_and_to_what_it_answered():
    old, wider = about({"wg": ""}), about({"wg2": ""})
    wider.rules["wg2"]["factor"] = "1e-2"
    renamed = changed(engine="wg2")
    found = compare_rows((old, [changed(engine="wg")]), (wider, [renamed]))
    assert [str(one) for one in found.weakened] == ["wg2: factor 1e-9 -> 1e-2"]
    fewer = about({"wg2": ""}, answers="torque")
    found = compare_rows((old, [changed(engine="wg")]), (fewer, [renamed]))
    assert found.gone == ["engine wg is gone (1 row)"] and found.status == FAILED
    assert render.write_differences(found).startswith("Gone: engine wg is gone")


def test_what_was_not_asked_for_is_not_run_and_what_was_is_gone():
    whole = about({"wg": "", "b": ""}, **{"scenes of": "hard"})
    both = [changed(scene=s, engine=e) for s in "stu" for e in ("wg", "b")]
    without = ["engine wg is gone (3 rows)"]
    others = ["scene t (2 rows)", "scene u (2 rows)"]
    gone_scenes = [text.replace(" (", " is gone (") for text in others]
    for before, settings, rows, not_run, gone in (
        ("b, wg 1", {"chosen": "b"}, both[1::2], ["wg (3 rows)"], []),
        ("b", {"chosen": "b"}, both[1::2], [], without),  # wg was named by --guest
        ("", {}, both[1::2], [], without),
        ("", {"scenes of": ""}, both[:2], others, []),
        ("", {"scenes of": "x"}, both[:2], others, []),
        ("", {"scenes of": "hard"}, both[:2], [], gone_scenes),
    ):
        asked = about({row.engine: "" for row in rows}, **settings)
        whole.settings["chosen"] = before
        found = compare_rows((whole, both), (asked, rows))
        assert (found.name_whole(Kind.NOT_RUN), found.gone) == (not_run, gone), settings
        assert found.status == bool(gone) and not found.strange
        assert not found.sentences  # nobody disagrees


def test_the_rule_that_a_row_is_held_to_is_not_stated_as_a_cause():
    rule = f"{EQUIVALENCE.cause}: 50 eps over the condition 0.5"
    for reason, stated in ((rule, f"held to {rule}"), (WHY, WHY)):
        failing = changed(verdict=FAILS, error=1.0, reason=reason)
        text = render.write_differences(compare_made_here([ROW], [failing]))
        assert f", agrees -> fails: {stated}\n" in text
        assert f", agrees -> fails ({stated});" in text


def test_a_scene_that_an_engine_newly_refuses_is_one_regression():
    old = [changed(engine="wg", quantity=name) for name in ("F12", "torque")]
    refusal = changed(
        engine="wg",
        quantity="all",
        verdict=REFUSES,
        error=NAN,
    )
    found = compare_made_here([*old, ROW], [refusal, ROW])
    assert found.gone == ["scene scene is newly refused by wg (3 rows)"]
    first = render.write_differences(found).splitlines()[0]
    assert first == f"Gone: {found.gone[0]}" and found.status == FAILED
    found = compare_made_here([ROW], [refusal, ROW])
    assert [*found.table.kind].count(Kind.NEW) == 1 and found.status == HOLDS
    as_before = compare_made_here([refusal, ROW], [refusal, ROW])
    assert not as_before.gone and as_before.status == HOLDS
