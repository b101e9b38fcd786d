"""Printed figures.

The thesis's torque error by error, its tables, its errata, and answers of public test
cases.
"""

from collections import Counter
from functools import cache

import numpy as np
from click.testing import CliRunner
from pytest import mark

import fourbar
from fourbar.quantities import UNKNOWNS
from fourbar_validation.places import MODELS
from fourbar_validation.published import comparison as command
from fourbar_validation.published.comparison import (
    MISPRINT,
    REPRODUCED,
    UNEXPLAINED,
    explain_difference,
    list_figures,
    list_ladder_rows,
    published,
)
from fourbar_validation.published.printed_figures import (
    ERRATA,
    FOLDER,
    PublishedFigure,
    compare_figure,
    read_printed,
)
from fourbar_validation.published.thesis import (
    BAR_LENGTHS,
    LADDER,
    TEXTBOOK_FOLDER,
    THETA_1,
    THETA_2,
    compute_model,
    make_model_scene,
)
from tests.support.rows import read_rows
from tests.support.scenes import cis, recommand

LISTED = 0.5e-12
"""Half a unit of the last digit listed below."""
ROUND_OFF = 1.8e-12
"""N cm of T4, and less in N: what the terms of the free bodies are rounded by."""
SPELLED = 1e-13
"""Relative; two spellings of one input, 57*153^2/12 cm^2 or 11.119275 m^2, differ by a
few roundings, and what follows from them by some more.
"""
PRINTED_GAP = 20.0 * np.radians(0.5e-5) + 55.0 * np.radians(0.5e-6)
"""cm; theta_4 is printed to five decimals of a degree at least, theta_3 to six: half a
unit of each, by its bar.
"""
LISTED_UNKNOWNS = {
    "T4": """309.30935923198564 309.330779939797 309.313000742774 309.304477356844
             309.002005400392 308.804407126702 308.80440716278196""",
    "F12x": """7.033117757022 7.033839565011 161.418472567466 161.418320162565
               161.418168408309""",
}
"""What each error of the thesis, one after another, makes of two unknowns."""


@cache
def list_all():
    """Return every figure; all of them take some seconds."""
    return tuple(list_figures())


def test_the_published_torque_error_by_error():
    assert len(LADDER) + 1 == len(LISTED_UNKNOWNS["T4"].split())
    for name, listed in LISTED_UNKNOWNS.items():
        for step, figure in enumerate(listed.split()):
            number = compute_model(LADDER[:step])[name.removesuffix("x")].real
            assert abs(number - float(figure)) <= LISTED + ROUND_OFF


def test_rows_for_the_report():
    rows = list(list_ladder_rows())
    begin = " ".join(did.partition(" ")[0] for did, *_ in rows)
    assert begin == "nothing #3 #1 #2 #4 #5 #5b"
    assert all(did and right for did, right, *_ in rows)
    assert rows[0][2:] == ("309.309359232", "7.033", "-2.121")
    assert rows[-1][2:] == ("308.804407163", "161.418", "-156.506")


@mark.parametrize(
    "printed, ours, noise, verdict",
    read_rows("""
0.12 | 0.1249 | 0.0 | rounded
0.13 | 0.1251 | 0.0 | rounded
-0.12 | -0.1299 | 0.0 | truncated
0.12 | 0.1299 | 0.0 | truncated
0.12 | 0.1301 | 0.0 | differs
0.12 | -0.12 | 0.0 | differs
308 | 308.9 | 0.0 | truncated
0 | -0.4 | 0.0 | rounded
308.8044071267012 | 308.8044071267003 | 1e-12 | rounded
308.8044071267012 | 308.8044071267027 | 1e-12 | differs
"""),
)
def test_verdicts(printed, ours, noise, verdict):
    """Noise is of the last digits alone."""
    assert compare_figure(printed, float(ours), float(noise)) == verdict


@mark.slow
def test_every_figure_is_compared():
    assert Counter(figure.table for figure in list_all()) == {
        "2.4 positions": 281 * 4,
        "2.4 constants": 16,
        "3.2 limits": 7,
        "manual, window": 8,
        "4.12": 52,
        "manual, kinematics": 26,
        "5.7 inertias": 3,
        "5.7 constants": 28,
        "5.7 matrix": 21,
        "manual, unknowns": 13,
        "5.7 unknowns": 13,
        "Maple": 5,
        "public test cases": 16,
    }
    names = {(figure.table, figure.name) for figure in list_all()}
    assert len(names) == len(list_all())
    of_thesis = [one for one in list_all() if one.table != "public test cases"]
    verdicts = Counter(figure.verdict() for figure in of_thesis)
    assert verdicts == {"rounded": 1228, "truncated": 28, "differs": 60}


@mark.slow
def test_every_difference_is_what_its_errata_make_of_ours():
    """Save three misprints, for which no computation is known.

    An agreement needs no misprint to explain it.
    """
    differ = [figure for figure in list_all() if figure.verdict() == "differs"]
    kinds = [(figure, explain_difference(figure)[0]) for figure in differ]
    assert {kind for _, kind in kinds} == {REPRODUCED, MISPRINT}
    misprints = {one.name: one.errata for one, kind in kinds if kind == MISPRINT}
    twelve = dict.fromkeys(("k3_2_in_eq_5_6", "k4_1"), ("12b",))
    assert misprints == twelve | {"tetaDos_deg": ("17",)}
    assert {key for key, one in ERRATA.items() if "reproduced" in one} == {"12b", "17"}
    # as data/README.md says
    assert sum("unknowns" in figure.table for figure in differ) == 26
    assert sum(set(figure.errata) <= {"1", "2", "3"} for figure in differ) == 10
    # no figure names an erratum and yet is right before it is made; one entry of the
    # matrix is, by its two digits
    named = [figure for figure in list_all() if figure.errata]
    (idle,) = [figure for figure in named if figure not in differ]
    assert (idle.table, idle.name) == ("5.7 matrix", "k4_5")


def test_errata_are_complete():
    assert {str(n) for n in range(1, 41)} <= set(ERRATA)
    for entry in ERRATA.values():
        said = ("where", "title", "printed", "right", "derivation", "effect")
        assert all(map(entry.get, said))


def solve_as_printed(sides, arms):
    """T4 of the 13 x 13 system of section 5.7 from printed numbers, built anew."""
    matrix, right = np.zeros((13, 13)), np.zeros(13)
    right[:9] = sides
    for k, row in enumerate(arms):
        rows, columns = slice(3 * k, 3 * k + 2), slice(4 * k, 4 * k + 4)
        matrix[rows, columns] = np.hstack((np.eye(2), np.eye(2)))
        matrix[3 * k + 2, columns] = row
    matrix[8, 12] = 1.0
    for row, *pair in ((9, 2, 4), (10, 3, 5), (11, 6, 10), (12, 7, 11)):
        matrix[row, pair] = 1.0
    return float(np.linalg.solve(matrix, right)[12])


def test_torques_that_the_errata_state():
    def program(*made):
        return compute_model(tuple(map(str, made)))["T4"]

    right = program()
    k, matrix = (
        {one.name: float(one.printed) for one in read_printed() if one.table == table}
        for table in ("5.7 constants", "5.7 matrix")
    )
    used = {"k3_5": 14.99169304, "k4x": 0.2 * -0.02840253815}

    def hand(numbers, *put_right):
        numbers = numbers | {name: used[name] for name in put_right}
        arms = [[numbers[f"k{bar}_{n}"] for n in (1, 2, 3, 4)] for bar in (2, 3, 4)]
        names = (f"k{bar}{key}" for bar in (2, 3, 4) for key in ("x", "y", "_5"))
        return solve_as_printed([numbers[name] for name in names], arms)

    for erratum, words in (
        (1, f"{program(1) - right:.5f}"),
        (2, f"{program(3, 2) - program(3):.5f}"),
        (2, f"{program(2) - right:.4f}"),
        (3, f"{program(3) - right:+.5f}"),
        (3, f"{program(1, 2, 4, 5):.3f}"),
        (4, f"{program(4) - right:.6f}"),
        (4, f"{program(1, 4) - program(1):.6f}"),
        (5, f"{program(5) - right:.6f}"),
        (5, f"{program(1, 5) - program(1):.6f}"),
        (7, f"{hand(k, 'k4x'):.4f}"),
        (8, f"{hand(k):.4f}"),
        (8, f"{hand(k, 'k3_5'):.4f}"),
        (9, f"{program(3, 1, 2, 4, 5) + 100 * 15 - 15:.3f}"),
        (13, f"{hand(matrix):.6f}"),
    ):
        assert words in ERRATA[str(erratum)]["effect"]
    last = float(LISTED_UNKNOWNS["T4"].split()[-1])
    assert f"{hand(k, 'k3_5', 'k4x'):.4f}" == f"{last:.4f}"


def test_open_loops_that_the_errata_state():
    """Closure of the angles as printed, in the thesis's polygon, cm."""
    rows = np.loadtxt(
        FOLDER / "data" / "positions.csv",
        delimiter=",",
        skiprows=1,
        usecols=range(5),
    )
    d, a, b, c = BAR_LENGTHS
    unit = cis(np.radians(rows)).T

    def gaps(third, fourth):
        crank = d * cis(THETA_1) + a * unit[0]
        return abs(crank + b * unit[third] + c * unit[fourth])

    first, second = gaps(1, 4), gaps(2, 3)
    assert f"{first.max():.3f} cm" in ERRATA["6"]["derivation"]
    assert np.sort(first)[-2] < PRINTED_GAP and second.max() < PRINTED_GAP
    wrong = np.append(np.delete(gaps(1, 3), first.argmax()), gaps(2, 4))
    assert f"{wrong.min():.1f} to {wrong.max():.1f} cm" in ERRATA["22"]["derivation"]


def test_limits_that_the_errata_state():
    linkage = make_model_scene(THETA_2).linkage
    for bar, title in ((4, "limits"), (2, "dead centres")):
        angles = {
            f"{np.degrees(limit.theta_2) % 360.0:.4f}"
            for limit in fourbar.limit_positions(linkage, bar)
        }
        stated = ERRATA["16"]["right"].split(title)[1].split(" deg")[0]
        assert angles == {part.strip() for part in stated.split(" and ")}


def test_public_test_cases_agree_to_the_last_digit():
    answers = [figure for figure in list_all() if figure.scene]
    assert {answer.verdict() for answer in answers} == {"rounded"}
    scenes = {path.stem for path in TEXTBOOK_FOLDER.glob("*.toml")}
    assert {answer.scene for answer in answers} == scenes
    assert len({answer.where.split(",")[0] for answer in answers}) >= 3


def test_answers_that_sympy_leaves_to_be_solved():
    """Mass matrix and forcing as printed in test_jointsmethod.py give the accelerations
    that are compared.
    """
    mass = [
        [3.452709815256506e01, 7.003948798374735e00, -4.939690970641498e00],
        [-2.203792703880936e-14, 2.071702479957077e-01, 2.842917573033711e-01],
        [-1.300000000000123e-01, -8.836934896046506e-03, 1.864891330060847e-01],
    ]
    forcing = [-0.031211821321648, -0.00066022608181, 0.001813559741243]
    relative = [
        answer.printed
        for answer in read_printed()
        if answer.note.startswith("the printed mass matrix")
    ]
    assert [f"{x:.8f}" for x in np.linalg.solve(mass, forcing)] == relative


def test_inputs_are_those_of_the_model():
    """Accelerated, so that every mass, inertia and load takes part."""
    theirs = fourbar.load(MODELS / "thesis.toml")
    ours = make_model_scene(THETA_2)
    assert ours.effects == theirs.effects == ()
    one, other = (
        fourbar.solve(recommand(scene, angle=THETA_2, acceleration=7.0))
        for scene in (ours, theirs)
    )
    for quantity in UNKNOWNS:
        np.testing.assert_allclose(one[quantity], other[quantity], rtol=SPELLED)


@mark.slow
def test_the_command_explains_every_difference():
    process = CliRunner().invoke(published, standalone_mode=False)
    assert process.return_value == 0
    assert max(map(len, process.output.splitlines())) <= 80
    for figure in list_all():
        line = f"{figure.table}: {figure.name}  printed {figure.printed}"
        assert (line in process.output) == (figure.verdict() == "differs")
    output = CliRunner().invoke(published, ["--all"]).output
    assert output.count("  printed ") == len(list_all())


def test_a_difference_without_an_erratum_fails(monkeypatch):
    """Or of one that does not make it."""
    wrong = PublishedFigure(
        "2.4 positions", "1 theta3_1", "167.877224", 167.8772234, ("4",), 167.8
    )
    for changes in ({}, {"errata": ()}):
        figure = wrong._replace(**changes)
        assert figure.verdict() == "differs"
        assert explain_difference(figure)[0] == UNEXPLAINED
        monkeypatch.setattr(command, "list_figures", lambda one=figure: iter([one]))
        process = CliRunner().invoke(published, standalone_mode=False)
        assert process.return_value == 1
        assert "0 are misprints" in " ".join(process.output.split())
