"""Laws of a user's in the diagnosis: known of the machine, also as classes below the library's.

What a law below one of the library's makes is its own formula, nowhere that of the law above it.
"""

import tomllib

import jax
import jax.numpy as jnp
import jsonschema
import numpy as np
import pytest

from omnijax import InputError, cli, diagnose, laws, load_laws, load_rig, save_rig, simulate, speeds
from omnijax.diagnosis._machine._laws.behind import changed_beside_delays
from omnijax.diagnosis._machine._laws.laws import on_time, readings, remembers
from omnijax.diagnosis._machine.clocks import late_by, offset_of
from omnijax.diagnosis._ode._rows.before import Before, matters, memories_at
from omnijax.diagnosis._ode._rows.known import memories
from omnijax.dynamics import sensor_readings, wheel_shape
from omnijax.laws import EFFECTS, GENERIC, ActuatorLag, low_passed
from omnijax.machine import (
    Axis,
    MachineFile,
    PlacedLaw,
    free_run,
    load_machine,
    machine_schema,
    machine_text,
    parse_machine,
)
from omnijax.rig import law_texts, rig_text, save_laws

STEP = 2e-3  # s
TIME = STEP * np.arange(500)


class HalfLate(laws.SensorDelay):
    """Half of what is read is late."""

    id = "half-late"

    def __call__(self, signal, state=None):
        return super().__call__(signal, state) / 2


class TwiceAsSlow(ActuatorLag):
    """A lag of twice the time that it states."""

    id = "twice-as-slow"

    def rate(self, signal, state):
        return super().rate(signal, state) / 2


class SlowSeal(laws.AbstractShaft):
    """A drag that follows the speed late."""

    tau: jnp.ndarray

    id, places = "slow-seal", ("wheel", "all")
    parameters = {"tau": laws.Parameter("s", low=0, above=True)}  # noqa: RUF012

    def __call__(self, signal, state=None):
        return -0.01 * state[0]

    def initial(self):
        return jnp.zeros(1)

    def rate(self, signal, state):
        return (jnp.stack([signal.speed]) - state) / self.tau


def number(x: float):
    return jnp.asarray(x)


@pytest.mark.parametrize("law", [laws.SensorDelay, HalfLate])
@pytest.mark.parametrize("group", ["dR", "Omega"])
def test_what_is_read_on_time_is_read_as_simulated(law, group):
    """A law below the delay was taken for the delay: 43 sigma at the truth, 0.02 now."""
    rig = load_rig("atlas").add(law(number(0.004)), group)
    values = np.sin(2 * np.pi * TIME[:, None] * [2.0, 3.0, 5.0]) * np.minimum(1, 20 * TIME)[:, None]
    late = late_by(values.T, offset_of(rig, group) / STEP).T
    read = readings(rig, group, TIME, late, on_time(rig, group))
    shown = sensor_readings(rig, group, jnp.asarray(TIME), jnp.asarray(values))
    np.testing.assert_allclose(read, shown, atol=2e-4)
    own = law is HalfLate
    assert changed_beside_delays(rig, group) == remembers(rig, group) == own


def test_a_slow_drive_of_an_axis_begins_with_the_torque_that_is_commanded():
    """It began with none, whatever was commanded at first: in `simulate`, sweeps and diagnoses."""
    law, inputs = ActuatorLag(number(0.05)), {"input": np.full(len(TIME), 0.3)}
    axis, first = Axis(0.01, 0.05), {"position": (0.1, 0.2)}
    held, bare = (
        free_run(axis, placed, first, inputs, STEP)["position"]
        for placed in ((PlacedLaw(law, "axis"),), ())
    )
    np.testing.assert_allclose(held, bare, rtol=0, atol=1e-9)


MEMORIES = {  # a law, and the one that it is, or None: of the speed
    "lag": (ActuatorLag(number(0.06)), 0.06),
    "below a lag": (TwiceAsSlow(number(0.03)), 0.06),
    "as fast as nothing": (TwiceAsSlow(number(1e-7)), 2e-7),
    "at the shaft": (SlowSeal(number(0.06)), 0.06),
}


@pytest.mark.parametrize("case", MEMORIES)
def test_what_a_law_of_an_axis_remembers_is_followed(case):
    """One below a lag was taken for it, any other stayed at rest: what it does was left out."""
    law, tau = MEMORIES[case]
    rng = np.random.default_rng(2)
    u, v = (np.sin(TIME[:, None] * rng.uniform(3, 20, 4)).sum(axis=1) + 1 for _ in range(2))
    q = np.cumsum(v) * STEP
    axis, placed = Axis(0.01, 0.05), (PlacedLaw(law, "axis"),)
    gained = EFFECTS["motor-gain"](number(0.2))
    if law.port == "actuator":  # it is given what the former delivers
        placed = (PlacedLaw(gained, "axis"), *placed)
    felt = v if law.port == "shaft" else 1.2 * u
    inputs = {"input": jnp.asarray(u)}
    x = jnp.stack([jnp.asarray(q), jnp.asarray(v)], axis=1)
    found = memories(axis, placed, jnp.asarray(TIME), x, inputs)
    wanted = low_passed(jnp.asarray(TIME), jnp.asarray(felt)[:, None], tau)
    np.testing.assert_allclose(found, wanted, atol=1e-3)
    jump = Before(number(0.0), number(0.1))
    begun = memories_at(axis, placed, x[0], inputs, jump)[-1]
    before = v[0] if law.port == "shaft" else 1.2 * (u[0] + 0.1)
    np.testing.assert_allclose(np.ravel(begun), [before], rtol=1e-9)
    assert matters([law]) == matters([type(law)]) == (False, True)


LAW = """
import tomllib

import jax
import jax.numpy as jnp
import jsonschema
from omnijax.laws import AbstractShaft, Parameter

class Own(AbstractShaft):
    \"\"\"Shaft torque -k angle.\"\"\"

    k: jnp.ndarray
    id, places, formula = "{}", ("wheel", "all"), "shaft torque -k θ"
    parameters = {{"k": Parameter("N m", low=0, linear=True)}}

    def __call__(self, signal, state=None):
        return -{} * self.k * signal.angle
"""


def test_a_law_of_one_s_own_takes_no_other_s_id(tmp_path, capsys):
    """It replaced that of an axis' own, and the law of the former --law, without a word."""
    (generic, *_) = GENERIC
    (tmp_path / "taken.py").write_text(LAW.format(generic, 1), encoding="utf-8")
    with pytest.raises(InputError, match=f"the id `{generic}` is one of omnijax's own"):
        load_laws(tmp_path / "taken.py")
    for k in (1, 2):
        (tmp_path / f"{k}.py").write_text(LAW.format("own", k), encoding="utf-8")
    files = [part for k in (1, 2) for part in ("--law", str(tmp_path / f"{k}.py"))]
    assert cli.run(["diagnose", str(tmp_path), *files, "--out", str(tmp_path / "out")]) == 2
    assert "another --law has a law of the id `own` already" in capsys.readouterr().err
    for key, said in (("own", "'own' is `half-late`"), ("bearing-viscous", "omnijax's own")):
        with pytest.raises(InputError, match=said):
            diagnose(tmp_path, laws={key: Named if key != "own" else HalfLate})


def test_a_law_is_of_the_library_where_its_class_stands_there_itself():
    """Six comparisons by id stood for this one."""
    (generic, *_) = GENERIC.values()
    for law in (laws.SensorDelay, laws.SensorDelay(number(0.1)), generic):
        assert laws.of_library(law)
    for law in (HalfLate, HalfLate(number(0.1)), Named, Named(number(0.1))):
        assert not laws.of_library(law)
    assert laws.of_library(ActuatorLag, EFFECTS) and not laws.of_library(generic, EFFECTS)


class Named(laws.BearingViscous):
    """A law below one of the library's that keeps its id."""


def test_a_machine_file_names_the_file_of_a_law_of_one_s_own(tmp_path):
    """`diagnose` of an axis wrote a machine-diagnosed.toml that every command refused."""
    (tmp_path / "own.py").write_text(LAW.format("own", 3), encoding="utf-8")
    (law,) = load_laws(tmp_path / "own.py").values()
    placed = (PlacedLaw(law(number(0.3)), "axis"),)
    text = machine_text(MachineFile(Axis(0.01, 0.05), placed))
    (tmp_path / "machine.toml").write_text(text, encoding="utf-8")
    file = load_machine(tmp_path / "machine.toml")
    assert type(file.placed[0].law) is law and float(file.placed[0].law.k) == 0.3
    assert machine_text(file) == text and 'law = "own.py"' in text
    jsonschema.validate(tomllib.loads(text), machine_schema())
    (tmp_path / "machine.toml").write_text(text.replace("own.py", "no.py"), encoding="utf-8")
    with pytest.raises(InputError, match=r"`effect.own.law`: .*no.py: no such Python file of laws"):
        load_machine(tmp_path / "machine.toml")
    with pytest.raises(InputError, match="the law `half-late` cannot be saved: put its class"):
        machine_text(MachineFile(Axis(0.01), (PlacedLaw(HalfLate(number(0.1)), "position"),)))


@pytest.mark.parametrize(("id", "place", "parameters", "said"), [
    ("sensor-delay", "position", {"delay": 0.01}, None),
    ("bearing-viscous", "position", {"b": 0.01}, "`effect.bearing-viscous.place` must be axis"),
    ("contact-cubic", "axis", {"K3": 1.0}, "`effect.contact-cubic` acts at the port `contact`"),
])  # fmt: skip
def test_an_effect_of_a_machine_file_stands_where_its_port_is(id, place, parameters, said):
    """A diagnosed sensor's effect could not be read again; a contact's did nothing."""
    effect = {"id": id, "place": place, "parameters": parameters}
    data = {"kind": "axis", "motor": {}, "axis": {"inertia": 1.0}, "effect": [effect]}
    if said is None:
        file = parse_machine(data)
        assert machine_text(parse_machine(tomllib.loads(machine_text(file)))) == machine_text(file)
        return
    with pytest.raises(InputError, match=said):
        parse_machine(data)


CHIPPED = """
from omnijax.laws import DamagedRoller, Parameter

class Chipped(DamagedRoller):
    \"\"\"Twice what a damaged roller of its severity does.\"\"\"

    id = "chipped"

    def __call__(self, angle, gap):
        return 2 * super().__call__(angle, gap)
"""


def test_a_law_below_the_damaged_roller_is_read_from_a_file(tmp_path):
    """The wheel's profile, which the rig fills in, was taken for a parameter that is missing."""
    (tmp_path / "chip.py").write_text(CHIPPED, encoding="utf-8")
    (law,) = load_laws(tmp_path / "chip.py").values()
    atlas = load_rig("atlas")
    rig = atlas.add(law(number(1.0), number(0.2)), "w2")
    path = save_rig(rig, tmp_path / "rig.toml")
    assert cli.run(["check", str(path)]) == 0
    again = load_rig(path)
    assert type(again.effects[0].law) is law and rig_text(again) == rig_text(rig)
    angle = jnp.linspace(0, 2 * np.pi, 500)
    shapes = [
        np.asarray(jax.vmap(lambda a, rig=rig: wheel_shape(rig, a * jnp.ones(3)))(angle))
        for rig in (again, atlas.add(laws.DamagedRoller(number(1.0), number(0.4)), "w2"), atlas)
    ]
    np.testing.assert_allclose(shapes[0], shapes[1], rtol=0, atol=1e-15)
    assert np.abs(shapes[0] - shapes[2]).max() > 1e-6


@pytest.mark.full  # in the gate its shape (above), and such a law's run: test_add_a_law
def test_a_law_below_the_damaged_roller_moves_a_machine_as_that_one_does(tmp_path):
    (tmp_path / "chip.py").write_text(CHIPPED, encoding="utf-8")
    (law,) = load_laws(tmp_path / "chip.py").values()
    atlas = load_rig("atlas")
    again = atlas.add(law(number(1.0), number(0.2)), "w2")
    library = atlas.add(laws.DamagedRoller(number(1.0), number(0.4)), "w2")
    drive, times = speeds([0.1, 1.2, 0.3]), np.linspace(0, 0.5, 101)
    own, known = (simulate(x, drive, times, solver="exponential").dR for x in (again, library))
    np.testing.assert_allclose(own, known, rtol=0, atol=1e-12)
    assert np.abs(own - simulate(atlas, drive, times, solver="exponential").dR).max() > 1e-6


def test_law_files_of_one_text_keep_their_names(tmp_path):
    """A rig whose law came from the second file was saved with the name of the first one."""
    for name in ("first", "second"):
        (tmp_path / f"{name}.py").write_text(LAW.format("twin", 7), encoding="utf-8")
    rigs = {
        name: load_rig("atlas").add(load_laws(tmp_path / f"{name}.py")["twin"](number(0.1)), "w1")
        for name in ("first", "second", "first")
    }
    for name, rig in rigs.items():
        assert f'law = "{name}.py"' in rig_text(rig) and list(law_texts(rig)) == [f"{name}.py"]
    assert load_laws(tmp_path / "first.py") == load_laws(tmp_path / "first.py")


def test_a_law_file_beside_a_machine_file_is_not_overwritten(tmp_path):
    """`diagnose --force` of an axis wrote over a file of the law's name, whatever stood in it."""
    source = tmp_path / "source"
    source.mkdir()
    (source / "mine.py").write_text(
        "from omnijax import laws\n\n"
        "class Mine(laws.EFFECTS['bearing-coulomb']):\n    id = 'mine-beside'\n"
    )
    (law,) = load_laws(source / "mine.py").values()
    save_laws([law(number(0.1))], tmp_path, "machine")
    assert (tmp_path / "mine.py").read_text() == (source / "mine.py").read_text()
    (tmp_path / "mine.py").write_text("# another\n")
    with pytest.raises(InputError, match=r"mine\.py exists with another text: save the machine"):
        save_laws([law(number(0.1))], tmp_path, "machine")
    assert (tmp_path / "mine.py").read_text() == "# another\n"
