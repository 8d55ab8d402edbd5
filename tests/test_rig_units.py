"""Numbers with units: turns, hertz and radians above all."""

import math

import pytest
from rigs import tables

from omnijax.rig import as_number, parse_rig

CASES = [
    ("188.2 kN/m", "N/m", 188200.0),
    ("75.8 mm", "m", 0.0758),
    ("1.22e0m", "m", 1.22),
    ("4961000 g m²", "kg m^2", 4961.0),
    ("120 N*s/m", "N s/m", 120.0),
    ("30 rpm", "rad/s", math.pi),
    ("30 rpm", "Hz", 0.5),
    ("2 Hz", "rad/s", 4 * math.pi),
    ("2 Hz", "Hz", 2.0),
    ("3 rad/s", "Hz", 3 / (2 * math.pi)),
    ("90 deg", "rad", math.pi / 2),
    ("0.4", "rad", 0.4),
    ("14 %", "1", 0.14),
    ("8 s", "s", 8.0),
    ("1 min", "s", 60.0),
    (" -2.5 um ", "m", -2.5e-6),
    (7, "kg", 7.0),
]


@pytest.mark.parametrize(("given", "unit", "value"), CASES)
def test_unit_strings(given, unit, value):
    assert as_number(given, unit) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize("text", ["", "kg", "1e999 kg", "1 2 kg", "5 m", "5 kg kg", "__import__"])
def test_texts_that_are_no_mass(text):
    with pytest.raises(ValueError, match=r"must be (a number in kg|finite)"):
        as_number(text, "kg")


def test_units_in_vectors_and_wheels():
    rig = parse_rig(
        tables(
            (("sphere", "centre_of_mass"), ["2 mm", 0, "-1 cm"]),
            (("wheel", 2, "contact", "stiffness"), "188.2 kN/m"),
        )
    )
    assert rig.sphere.centre_of_mass.tolist() == pytest.approx([0.002, 0, -0.01])
    assert float(rig.wheels.contact.stiffness[2]) == pytest.approx(188200.0)
