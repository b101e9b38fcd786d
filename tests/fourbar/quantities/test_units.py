"""Texts with units where a scene is described in Python: the same numbers as SI gives, and one line for a mistake."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import fourbar
from fourbar.effects import SpringEnd, Table
from fourbar.errors import InputError
from fourbar.files import loads

ENDS = SpringEnd(1, 0.1, 0.0), SpringEnd(4, 0.2, np.pi)
SAME: list[tuple[Callable[..., Any], tuple[Any, ...], tuple[Any, ...]]] = [
    (fourbar.Bar, ("10 cm", "200 g", "2 kg cm^2", ("5 cm", "180 deg")), (0.1, 0.2, 2e-4, (0.05, np.pi))),
    (fourbar.uniform, ("6 in", 0.05, "127 mm", "4 in"), (0.1524, 0.05, 0.127, 0.1016)),
    (fourbar.Sweep, ("180 deg", "2 rad", 4), (np.pi, 2.0, 4)),
    (fourbar.FromLimit, (1, "180 deg"), (1, np.pi)),
    (fourbar.Free, ("0.5 min", 4), (30.0, 4)),
    (fourbar.Law, (("0 s", "0.5 min"), ("0 deg", 2.0), 4, "rest"), ((0.0, 30.0), (0.0, 2.0), 4, "rest")),
    (fourbar.Point, ("P", 3, ("5 cm", "180 deg")), ("P", 3, (0.05, np.pi))),
    (fourbar.Load, (4, ("2 kN", "180 deg"), ("5 cm", 0), "3 N cm"), (4, (2000.0, np.pi), (0.05, 0.0), 0.03)),
    (Table, (("0 deg", "180 deg"), (1.0, 2.0)), ((0.0, np.pi), (1.0, 2.0))),
    (fourbar.Gravity, ("1 g_0", "180 deg"), (9.80665, np.pi)),
    (fourbar.Flywheel, ("200 kg cm^2",), (0.02,)),
    (fourbar.Viscous, ((("A", "2 N mm s/rad"),),), ((("A", 0.002),),)),
    (fourbar.Friction, ((("A", "5 N cm"),),), ((("A", 0.05),),)),
    (fourbar.PinFriction, ((("A", 0.1, "8 mm"),),), ((("A", 0.1, 0.008),),)),
    (fourbar.Torsion, ((("A", "2 N m/rad", "180 deg", "1 N cm"),),), ((("A", 2.0, np.pi, 0.01),),)),
    (
        fourbar.Spring,
        (SpringEnd(1, "10 cm", 0), SpringEnd(4, "20 cm", "180 deg"), "2 N/mm", "5 cm", "3 N"),  # type: ignore[arg-type]
        (*ENDS, 2000.0, 0.05, 3.0),
    ),
    (fourbar.Spring.gas, (*ENDS, "50 cm", "20 cm", "400 N", "0.5 kN"), (*ENDS, 0.5, 0.2, 400.0, 500.0)),
]


@pytest.mark.parametrize(("make", "texts", "numbers"), SAME)
def test_a_text_with_a_unit_is_its_number(make: Callable[..., Any], texts: Any, numbers: Any) -> None:
    assert make(*texts) == make(*numbers)


def test_a_motion_is_written_as_in_the_file() -> None:
    stated = fourbar.Motion(["10 deg", 1.0], "60 rpm", "30 deg/s^2", branch="crossed")  # type: ignore[arg-type]
    read = loads(
        '[lengths]\nground = "6 in"\ninput = "2 in"\ncoupler = "5 in"\noutput = "4 in"\n[motion]\n'
        'theta_2 = ["10 deg", "1 rad"]\nomega_2 = "60 rpm"\nalpha_2 = "30 deg/s^2"\nbranch = "crossed"\n'
    ).motion
    assert np.array_equal(stated.theta_2, read.theta_2)  # type: ignore[arg-type]
    assert (stated.omega_2, stated.alpha_2, stated.branch) == (read.omega_2, read.alpha_2, read.branch)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: fourbar.uniform("6", 1, 1, 1), r"lengths.ground = '6': the unit is missing.*like \"1 m\""),
        (lambda: fourbar.uniform(1, "6 kg", 1, 1), "lengths.input = '6 kg'.*does not convert to m"),
        (lambda: fourbar.uniform(1, "-6 in", 1, 1), "lengths.input = '-6 in': must be a finite number > 0"),
        (lambda: fourbar.Motion("60", 1.0), r"motion.theta_2 = '60': the unit is missing"),
        (lambda: fourbar.Motion(1.0, branch="opne"), r"motion.branch = 'opne': must be \+1 \(open\)"),
        (lambda: fourbar.PinFriction.at(A=("0.1", 1)), "coefficient = '0.1': must be a finite number"),
    ],
)
def test_a_mistake_is_one_line(make: Callable[[], object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        make()
