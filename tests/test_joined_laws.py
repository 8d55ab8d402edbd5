"""Laws of one kind at one place that are one: what both do together, in a file that is read."""

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import machine
from seeds import drawn_anew

from omnijax import laws, load_rig, save_rig
from omnijax.cli.diagnose import _write
from omnijax.laws import EFFECTS, joined, one_a_place


def drawn_law(rng, law, like=None):
    """A law with drawn numbers; with those of `like` but for its sizes."""
    numbers, count = {}, int(rng.integers(1, 4))
    for key, known in law.parameters.items():
        shape = {0: (), laws.ANY_LENGTH: (count,)}.get(known.shape, known.shape)
        low = max(known.low, -0.9)
        high = min(known.high, max(0.9, low + 1))
        own = like is None or known.linear
        numbers[key] = rng.uniform(low, high, shape) if own else getattr(like, key)
    return law(**{k: jnp.asarray(v) for k, v in numbers.items()})


def drawn_input(rng, port):
    """Arguments of a law at a port."""
    x = rng.uniform(0.2, 1.5, 8)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    gap = jax.tree.map(lambda x: x[0], machine().gaps)
    return {
        "contact": (laws.ContactSignal(*x[:6]),),
        "mount": (laws.MountSignal(*x[:4]),),
        "shaft": (laws.ShaftSignal(*x[:4]),),
        "rolling": (laws.RollingSignal(*x[:4]),),
        "sphere": (laws.BodySignal(jnp.asarray(x[:3]), jnp.asarray(turn), x[3], x[4:7]),),
        "platform": (x[0],),
        "radius": (x[0],),
        "kinematics": (x[0],),
        "shape": (x[0], gap),
        "surface": (jnp.asarray(turn[0]),),
    }[port]


SUMMED = [
    law
    for law in EFFECTS.values()
    if law.port not in ("actuator", "sensor")
    and any(known.linear for known in law.parameters.values())
    and law.id not in ("motor-ripple", "cogging")
]


def test_many_laws_have_sizes_that_add():
    assert len(SUMMED) > 12


@pytest.mark.parametrize("law", SUMMED, ids=lambda law: law.id)
def test_sizes_at_one_place_add(law):
    rng = drawn_anew(f"joined {law.id}")
    first = drawn_law(rng, law)
    second = drawn_law(rng, law, like=first)
    both = joined(first, second)
    assert type(both) is law
    given = drawn_input(rng, law.port)
    if law.id == "damaged-roller":
        gapped = laws.HalfSine()
        first, second, both = (law(x.roller, x.severity, gapped) for x in (first, second, both))
        assert joined(first, second).profile == gapped
    state = () if not law.has_memory() else (jax.tree.map(lambda z: z + 0.3, first.initial()),)
    parts = [one(*given, *state) for one in (first, second)]
    whole = both(*given, *state)
    for a, b, c in zip(*map(jax.tree.leaves, (*parts, whole)), strict=True):
        np.testing.assert_allclose(c, a + b, rtol=1e-12, atol=1e-300)
    other = {k for k, known in law.parameters.items() if not known.linear}
    if other - {"phase"}:
        assert joined(first, drawn_law(rng, law)) is None
    elif other:  # waves whose phases differ are one wave too
        third = drawn_law(rng, law)
        both, parts = joined(first, third), [one(*given) for one in (first, third)]
        np.testing.assert_allclose(both(*given), sum(parts), rtol=1e-12)


@pytest.mark.parametrize(
    "law", [x for x in EFFECTS.values() if x not in SUMMED], ids=lambda x: x.id
)
def test_laws_that_take_up_what_another_left_stay_two(law):
    rng = drawn_anew(f"two {law.id}")
    first = drawn_law(rng, law)
    second = drawn_law(rng, law, like=first)
    both = joined(first, second)
    gain = law.id in ("motor-gain", "sensor-gain")
    assert (both is None) == (law.id not in ("motor-ripple", "cogging") and not gain)
    if gain:
        np.testing.assert_allclose(1 + both.g, (1 + first.g) * (1 + second.g), rtol=1e-12)


@pytest.mark.parametrize("between", ["sensor-saturation", None])
def test_gains_of_a_sensor_are_one_where_no_law_of_it_stands_between(between):
    rng, rig = drawn_anew("gains in series"), machine()
    first, second = (drawn_law(rng, EFFECTS["sensor-gain"]) for _ in range(2))
    rig = rig.add(first, "dR")
    if between:
        rig = rig.add(EFFECTS[between](jnp.asarray(1e-4)), "dR_x")
    rig = rig.add(second, "dR")
    ids = [placed.law.id for placed in one_a_place(rig.effects)]
    assert ids == (["sensor-gain", between, "sensor-gain"] if between else ["sensor-gain"])


def test_lines_of_torque_are_one_cogging():
    rng = drawn_anew("lines of torque")
    kinds = [EFFECTS[k] for k in rng.choice(["motor-ripple", "cogging"], 4)]
    lines = [drawn_law(rng, law) for law in kinds]
    rig = machine()
    for law in lines:
        rig = rig.add(law, "w1")
    rig = rig.add(EFFECTS["motor-ripple"](*jnp.ones(3)), "w2")
    one, other = one_a_place(rig.effects)
    assert (one.law.id, one.place, one.wheels) == ("cogging", "w1", (0,))
    assert (other.law.id, other.place) == ("motor-ripple", "w2")
    assert np.all(np.diff(one.law.amplitudes) <= 0)
    for _ in range(3):
        (given,) = drawn_input(rng, "shaft")
        assert one.law(given) == pytest.approx(sum(float(law(given)) for law in lines), rel=1e-12)


def test_a_rig_whose_laws_of_a_place_are_joined_is_read_again(tmp_path):
    """Two lines of one motor ended `omnijax diagnose` with their rig file, after all the work."""
    rng = drawn_anew("joined in a file")
    rig = machine()
    for law in (EFFECTS["motor-ripple"], EFFECTS["bearing-viscous"]):
        first = drawn_law(rng, law)
        rig = rig.add(first, "w1").add(drawn_law(rng, law, like=first), "w1")
    save_rig(rig.with_effects(one_a_place(rig.effects)), tmp_path / "rig.toml")
    again = load_rig(tmp_path / "rig.toml")
    assert [placed.law.id for placed in again.effects] == ["cogging", "bearing-viscous"]


def test_an_answer_is_written_where_no_rig_file_can_say_it(tmp_path, monkeypatch):
    """A friction beside one of another width, which the rig has there: the page was lost."""
    wide, narrow = (
        EFFECTS["bearing-coulomb"](jnp.asarray(0.1), jnp.asarray(w)) for w in (0.1, 0.2)
    )
    rig = machine().add(wide, "w1").add(narrow, "w1")
    assert one_a_place(rig.effects) == rig.effects
    written = []
    page = SimpleNamespace(write=written.append)
    monkeypatch.setattr("omnijax.report.diagnosis_page", lambda diagnosis, command: page)
    answer = SimpleNamespace(rig=rig, save=written.append, notes=[])
    (tmp_path / "rig-diagnosed.toml").write_text("of an earlier answer")
    said = _write(answer, tmp_path)
    assert said.startswith("but no rig-diagnosed.toml: `effect.bearing-coulomb.w1` stands twice")
    assert written == [tmp_path / "diagnosis.json", tmp_path]
    assert not (tmp_path / "rig-diagnosed.toml").exists()
    (note,) = answer.notes
    assert note.startswith("There is no rig-diagnosed.toml: `effect.bearing-coulomb.w1`")
