"""Numbers with units: turns, hertz and radians above all."""

import math
import re

import numpy as np
import pytest
from rigs import tables

from omnijax.rig import _units, as_number, parse_rig
from omnijax.rig._units import SPELLINGS

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
    ("1.5 Nm", "N m", 1.5),
    ("2 mNm", "N m", 2e-3),
    ("3 µNm", "N m", 3e-6),
    ("4 Ncm", "N m", 0.04),
    ("80 Ns/m", "N s/m", 80.0),
    ("6e-5 kgm²", "kg m^2", 6e-5),
    ("6e-5 kgm^2", "kg m^2", 6e-5),
    ("3 gcm^2", "kg m^2", 3e-7),
    ("30 U/min", "rad/s", math.pi),
    ("30 1/min", "rad/s", math.pi),
    ("90°", "rad", math.pi / 2),
    ("5 nm", "m", 5e-9),
    (7, "kg", 7.0),
    ("30 RPM", "rad/s", math.pi),
    ("30 rev/min", "rad/s", math.pi),
    ("2 rev/s", "rad/s", 4 * math.pi),
    ("2 rps", "rad/s", 4 * math.pi),
    ("2 Revolutions", "rad", 4 * math.pi),
    ("90 Deg", "rad", math.pi / 2),
    ("180 dps", "rad/s", math.pi),
    ("180 degrees s-1", "rad/s", math.pi),
    ("3 rad s-1", "rad/s", 3.0),
    ("3 1/s", "rad/s", 3.0),
    ("3 s-1", "rad/s", 3.0),
    ("3 s^-1", "rad/s", 3.0),
    ("3 1/second", "rad/s", 3.0),
    ("3 1/ms", "rad/s", 3000.0),
    ("3 s-1", "Hz", 3.0),
    ("30 min-1", "rad/s", math.pi),
    ("30 1/minute", "rad/s", math.pi),
    ("2 hertz", "rad/s", 4 * math.pi),
    ("2 m s-2", "m/s^2", 2.0),
    ("2 m.s-2", "m/s^2", 2.0),
    ("2 mm s-2", "m/s^2", 2e-3),
    ("2 m/s2", "m/s^2", 2.0),
    ("2 g_n", "m/s^2", 19.6133),
    ("2 g0", "m/s^2", 19.6133),
    ("2 N-m", "N m", 2.0),
    ("2 N.m", "N m", 2.0),
    ("2 mN-m", "N m", 2e-3),
    ("2 kg m2", "kg m^2", 2.0),
    ("2 lbf-in", "N m", 2 * 4.4482216152605 * 0.0254),
]


@pytest.mark.parametrize(("given", "unit", "value"), CASES)
def test_unit_strings(given, unit, value):
    assert as_number(given, unit) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize("text", ["", "kg", "1e999 kg", "1 2 kg", "5 m", "5 kg kg", "__import__"])
def test_texts_that_are_no_mass(text):
    with pytest.raises(ValueError, match=r"must be (a number in kg|finite)"):
        as_number(text, "kg")


@pytest.mark.parametrize(
    ("text", "unit", "remedy"),
    [
        ("2,5 kg", "kg", "Write '2.5 kg', with a point."),
        ("5", "N m", "Write the number without quotes, or '5 N m'."),
        ("5 Nmm/s", "N m", "Units that work here: N m (or Nm), mN m, kN m."),
        ("5 Grad", "rad", "`Grad` is no unit of an angle. Units that work here: rad, deg, mrad."),
        ("5 Mrad/s", "rad/s", "`Mrad` is no unit of an angle."),
        ("5 counts", "rad", "How many make a turn is not known: convert them. Units that work"),
        ("5 bit/s", "rad/s", "How many make a turn is not known"),
        ("5 g", "m/s^2", "Units that work here: m/s^2 (or m/s²), mm/s², g_n."),
        ("5 blub", "N s/m", "Its unit is not known. Units that work here: N s/m (or Ns/m)"),
    ],
)
def test_a_refused_unit_names_the_spelling_that_works(text, unit, remedy):
    with pytest.raises(ValueError, match="must be a number in") as refused:
        as_number(text, unit)
    assert remedy in str(refused.value)


@pytest.mark.parametrize("unit", SPELLINGS)
def test_every_spelling_that_a_refusal_names_is_understood(unit):
    for spelling in re.findall(r"[^,()]+", SPELLINGS[unit].replace("or ", "")):
        if spelling.strip():
            assert as_number(f"1 {spelling.strip()}", unit) > 0


def test_units_in_vectors_and_wheels():
    rig = parse_rig(
        tables(
            (("sphere", "centre_of_mass"), ["2 mm", 0, "-1 cm"]),
            (("wheel", 2, "contact", "stiffness"), "188.2 kN/m"),
        )
    )
    assert rig.sphere.centre_of_mass.tolist() == pytest.approx([0.002, 0, -0.01])
    assert float(rig.wheels.contact.stiffness[2]) == pytest.approx(188200.0)


def test_our_own_reading_of_units_is_that_of_pint():
    """Products of two of our units with powers, against the library for all units."""
    words = [
        "mm",
        "kN",
        "g",
        "kg",
        "ms",
        "µm",
        "deg",
        "rpm",
        "Hz",
        "min",
        "MPa",
        "rad",
        "cm",
        "N",
    ]
    rng = np.random.default_rng(3)
    for _ in range(60):
        first, second, third = rng.choice(words, 3)
        text = f"{first}^{rng.integers(1, 4)} {second}/{third}²"
        own = _units._plain(text)
        assert own is not None
        metres, kilograms, seconds = own.dimension
        target = f"m^{metres} kg^{kilograms} s^{seconds}"
        assert own.factor == pytest.approx(_units._by_pint(text, target)[0], rel=1e-12), text
