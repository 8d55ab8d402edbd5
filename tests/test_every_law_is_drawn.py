"""A law of the library that a random test leaves out is named here, with the reason."""

import pytest
from drawn_rigs import every_law, with_laws
from planted import EFFECTS as PLANTED
from seeds import drawn_anew

from omnijax import laws
from omnijax.rig import load_rig

NOT_PLANTED = {  # the plant gives true values; a recording's sensors are compared by themselves
    name: "tests/test_sensor_effects.py" for name, law in laws.EFFECTS.items()
    if law.port == "sensor"
}  # fmt: skip


def test_every_law_is_drawn_for_the_diagnosis():
    """`tests/drawn_rigs.py`: what is simulated is predicted.  Each may stand where it is drawn."""
    rng, rig = drawn_anew("every law"), load_rig("atlas")
    for _ in range(10):
        drawn = every_law(rng, rig)
        assert {name for name, _, _ in drawn} == {*laws.EFFECTS}
        for law in drawn:
            with_laws(rig, [law])


def test_every_law_is_compared_with_the_plant():
    """`tests/planted.py`: each law in the words of a program that shares no code."""
    assert {*PLANTED, *NOT_PLANTED} == {*laws.EFFECTS}
    assert not PLANTED.keys() & NOT_PLANTED.keys()


@pytest.mark.parametrize("name", laws.AXIS_EFFECTS)
def test_the_face_shows_every_law(name):
    law = laws.AXIS_EFFECTS[name]
    assert getattr(laws, law.__name__, None) is law
