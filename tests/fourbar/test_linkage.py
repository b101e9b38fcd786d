import json
import math
from dataclasses import replace
from inspect import signature

import numpy as np
from pytest import approx, mark, raises

from fourbar import Bar, InputError
from tests.support.rows import read_rows


def test_density_and_cross_section_give_the_mass_of_a_uniform_bar():
    round_bar = Bar("0.4 m", density="7850 kg/m^3", diameter="20 mm")
    flat = Bar("0.4 m", density="7850 kg/m^3", section=("20 mm", "5 mm"))
    assert round_bar.mass == approx(7850.0 * math.pi * 0.01**2 * 0.4, rel=1e-15)
    assert flat.mass == approx(0.314, rel=1e-15)
    rod = Bar("0.66 m", mass_per_length="4.2 kg/m")
    assert rod.mass == approx(2.772)
    assert replace(rod, length=0.33, mass=0.0).mass == approx(1.386)
    with raises(InputError, match=r"mass = 2\.772.*0 in dataclasses\.replace"):
        replace(rod, length=0.33)
    assert flat.moment_of_inertia == approx(0.314 * 0.4**2 / 12.0, rel=1e-15)


def test_the_section_modulus_is_that_of_the_second_moment_of_area():
    """I over the distance of the outermost fibre.

    Both are integrated over strips of the area.
    """
    y = np.linspace(-0.01, 0.01, 200_001)
    chord = 2.0 * np.sqrt(np.maximum(0.01**2 - y * y, 0.0))
    sections = {
        Bar(1.0, section=(0.02, 0.005)): np.full_like(y, 0.005),
        Bar(1.0, diameter=0.02): chord,
    }
    for bar, widths in sections.items():
        second_moment = np.trapezoid(widths * y * y, y)
        assert bar.section_modulus == approx(second_moment / 0.01, rel=1e-6)
        assert bar.area == approx(np.trapezoid(widths, y), rel=1e-6)
    assert Bar(1.0).section_modulus is None


def test_the_signature_has_the_units():
    assert "Annotated[float, 'kg'] = 0.0" in str(signature(Bar))


@mark.parametrize(
    "stated, key",
    read_rows("""
{"density": 7850} | density
{"density": 7850, "diameter": 0.02, "mass": 1} | mass
{"mass_per_length": 4.2, "mass": 1} | mass
{"mass_per_length": 4.2, "density": 7850, "diameter": 0.02} | density
{"mass_per_length": 0} | mass_per_length
{"density": 7850, "diameter": 0.02, "section": [0.02, 0.01]} | diameter
{"section": [0.02, 0]} | section
{"section": "20 mm"} | section
{"section": [1e-150, 1e-150]} | section
{"diameter": 1e-150} | diameter
{"diameter": 1e150} | diameter
{"density": "7850 kg/m^2", "diameter": 0.02} | density
"""),
)
def test_a_material_that_states_no_mass_is_refused(stated, key):
    with raises(InputError) as error:
        Bar(0.4, **json.loads(stated))
    assert error.value.key == key
