"""`docs/add_a_law.md`, carried out as it stands: its blocks, its claims and its table of ports."""

import inspect
import re
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import omnijax
from omnijax import laws, recording
from omnijax._errors import DataWarning
from omnijax.cli import run
from omnijax.diagnosis._machine import Context, candidates
from omnijax.diagnosis._search import Point, SmallModel
from omnijax.dynamics import (
    Inputs,
    mount_signals,
    mount_tensions,
    sensor_readings,
    torque_driven,
)
from omnijax.machine import PlacedLaw, Ports
from omnijax.machine._ports import resting
from omnijax.rig import GROUPS, acting, bundled_rigs, get_parameter, set_parameter
from omnijax.rig._declaration import declared_laws
from omnijax.rig._places import ONE_WHEEL, WORDS, port_words
from omnijax.simulation import build_model
from omnijax.simulation._solve.state_vector import initial_state

PAGE = (Path(__file__).parents[1] / "docs" / "add_a_law.md").read_text(encoding="utf-8")
(LAW,), (EFFECT,) = (re.findall(rf"```{x}\n(.*?)```", PAGE, re.S) for x in ("python", "toml"))
FILE, NAME = "my_law.py", "effect.mount-quadratic-damper.w1.d"


def test_the_blocks_of_the_page_run_in_its_order(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("OMNIJAX_CONFIG_DIR", str(tmp_path / "config"))
    monkeypatch.setenv("OMNIJAX_TRUSTED_LAWS", "")
    monkeypatch.setattr("omnijax.rig._user_laws._LOADED", {})
    for name in (FILE, NAME):
        assert f"`{name}`" in PAGE
    Path(FILE).write_text(LAW)
    atlas = bundled_rigs()["atlas"].read_text(encoding="utf-8")
    Path("rig.toml").write_text(atlas + EFFECT, encoding="utf-8")
    assert run(["check", "rig.toml"]) == 0
    assert f"a law in {FILE}, whose declaration is" in capsys.readouterr().out
    short = ["simulate", "rig.toml", "--speed", "1,1.2,0.3", "--duration", "0.1"]
    assert run(short) == 2 and "--trust-laws" in capsys.readouterr().err
    (law,) = omnijax.load_laws(FILE).values()
    rig = omnijax.load_rig("rig.toml")
    assert float(get_parameter(rig, NAME)) == 4e5
    rig = set_parameter(rig, NAME, 3.0)
    alike = omnijax.load_rig("atlas").add(law(jnp.asarray(3.0)), "w1")
    rate = np.array([-0.5, 0.2, 0.3])
    for one in (rig, alike):
        signals = mount_signals(one, np.array([1e-3, 2e-3, 3e-3]), jnp.asarray(rate))
        added, _ = mount_tensions(acting(one.at("mount"), 3), signals, (None,))
        np.testing.assert_allclose(added, [-3 * 0.5**2, 0, 0], rtol=1e-12)


def test_the_table_of_ports_is_that_of_the_library():
    rows = re.findall(r"^\| `(Abstract\w+)` \| (.*?) \| ", PAGE, re.M)
    named = {getattr(laws, name).port for name, _ in rows}
    assert named == set(laws.PORTS) and len(rows) == len(laws.PORTS)
    signals = [re.match(r"`(\w+Signal)`: (.*)", given) for _, given in rows]
    assert len([s for s in signals if s]) >= 6
    for signal in filter(None, signals):
        fields = re.findall(r"`(\w+)`", signal[2])
        assert tuple(fields) == getattr(laws, signal[1])._fields, signal[1]
    for name in re.findall(r"`([A-Z]\w+)`", PAGE):
        assert hasattr(laws, name) or name in LAW or name in ("CASE", "Omega"), name


def test_the_table_says_where_each_port_is(tmp_path):
    rows = re.findall(r"^\| `(Abstract\w+)` .*\| (.*?) \|$", PAGE, re.M)
    for name, words in rows:
        port = getattr(laws, name).port
        said = set(re.findall(r"`(\w+)`", words))
        assert said - {"dR", "theta_1"} == set(WORDS.get(port, ONE_WHEEL)) - set(GROUPS), name
    assert len(rows) == len(laws.PORTS)
    assert {w for law in laws.EFFECTS.values() for w in law.places} <= {
        word for port in laws.PORTS for word in port_words(port, 3)
    }


@pytest.mark.parametrize(("places", "said"), [
    ('("wheels", "all")', "the law has 'wheels' in its `places`"),
    ('("sphere",)', "the law has 'sphere' in its `places`"),
    ("()", "the law has no `places`"),
])  # fmt: skip
def test_a_law_that_may_stand_nowhere_is_told(places, said, tmp_path, capsys):
    """A sensor's law at a wheel did nothing; a mount's at the sphere ended in a traceback."""
    (tmp_path / FILE).write_text(LAW.replace('("wheel", "all")', places), encoding="utf-8")
    atlas = bundled_rigs()["atlas"].read_text(encoding="utf-8")
    (tmp_path / "rig.toml").write_text(atlas + EFFECT, encoding="utf-8")
    assert run(["check", str(tmp_path / "rig.toml")]) == 2
    error = " ".join(capsys.readouterr().err.split())
    assert f"`effect.mount-quadratic-damper.law`: {said}" in error
    assert "a law of the port `mount` may have wheel, all." in error


def test_a_law_without_a_formula_is_told(tmp_path):
    """A method of another name was never called: a NotImplementedError, or no word at all."""
    path = tmp_path / FILE
    path.write_text(LAW.replace("__call__", "tension"), encoding="utf-8")
    with pytest.raises(omnijax.InputError, match=r"`mount-quadratic-damper` has no formula: give"):
        omnijax.load_laws(path)
    with pytest.raises(omnijax.InputError, match=r"`mount-quadratic-damper` has no formula: give"):
        declared_laws(path)  # `check` said that all is right
    path.write_text(LAW.replace("    def __call__(", "    def made(") + "\n    __call__ = made\n")
    assert set(declared_laws(path)) == {"mount-quadratic-damper"}


WAYS = {  # of a class's head, its lines, and what stands before it
    "port under another name": ("from omnijax.laws import AbstractMount as Port\n", "Port", ""),
    "port given a name": ("Port = laws.AbstractMount\n", "Port", ""),
    "below a class of the file": ("class Head(laws.AbstractMount):\n    places = ('all',)\n"
                                  "    def __call__(self, signal, state=None):\n"
                                  "        return signal.rate\n", "Head", ""),
    "with its fields": ("class Head(laws.AbstractMount):\n    a: jnp.ndarray\n"
                        "    id, places = 'head', ('all',)\n"
                        "    parameters = {'a': laws.Parameter('m')}\n"
                        "    def __call__(self, signal, state=None):\n"
                        "        return self.a\n", "Head",
                        "parameters = Head.parameters | {'k': laws.Parameter('N')}"),
    "below a law of the library": ("", "laws.MountCubic",
                                   "parameters = {**laws.MountCubic.parameters, "
                                   "'k': laws.Parameter('N')}"),
    "constants": ("HIGH, PLACES = 2 * 3.5, ('all', 'wheel')\n", "laws.AbstractMount",
                  "parameters, places = {'k': laws.Parameter('N', high=HIGH)}, PLACES"),
    "a list of places": ("", "laws.AbstractMount", "places = ['wheel']"),
    "no field": ("", "laws.AbstractMount", "parameters = {'j': laws.Parameter('N')}"),
    "no port": ("", "laws.AbstractMount", "port = 'spring'"),
    "optional": ("", "laws.AbstractMount",
                 "j: float = 2.0\n    parameters = {'k': laws.Parameter('N'), "
                 "'j': laws.Parameter('N', optional=True)}"),
    "optional of no value": ("", "laws.AbstractMount",
                             "parameters = {'k': laws.Parameter('N', optional=True)}"),
}  # fmt: skip


@pytest.mark.parametrize("way", WAYS)
def test_the_text_declares_what_the_run_declares(way, tmp_path):
    """`check` refused what a run takes, a law below another class, and took what a run refuses."""
    before, base, line = WAYS[way]
    path = tmp_path / FILE
    path.write_text(f"""from omnijax import laws
import jax.numpy as jnp
{before}
class Mine({base}):
    k: jnp.ndarray
    id = "mine"
    parameters = {{"k": laws.Parameter("N", high=jnp.inf)}}
    {line}
    def __call__(self, signal, state=None):
        return self.k * signal.rate
""")
    answers = []
    for read in (omnijax.load_laws, declared_laws):
        try:
            answers.append(
                {name: (x.port, x.places, x.parameters) for name, x in read(path).items()}
            )
        except omnijax.InputError as error:
            answers.append(str(error))
    assert answers[0] == answers[1]
    refused = way in ("a list of places", "no field", "no port", "optional of no value")
    assert isinstance(answers[0], str) == refused, answers[0]


def test_the_text_of_many_laws_declares_what_the_run_declares():
    path = Path(__file__).parent / "laws_of_a_user.py"
    run_, read = omnijax.load_laws(path), declared_laws(path)
    assert len(read) > 10 and {k: (x.port, x.places, x.parameters) for k, x in read.items()} == {
        k: (x.port, x.places, x.parameters) for k, x in run_.items()
    }


def test_a_law_below_one_of_the_effects_by_its_id_is_declared_as_it_is_run(tmp_path):
    """`check` refused such a file, and the run took it."""
    path = tmp_path / FILE
    path.write_text(
        "from omnijax import laws\n\n"
        "class Mine(laws.EFFECTS['bearing-coulomb']):\n    id = 'mine'\n"
    )
    (run_,), (read,) = omnijax.load_laws(path).values(), declared_laws(path).values()
    assert (run_.port, run_.places, run_.parameters) == (read.port, read.places, read.parameters)


@pytest.mark.parametrize(("line", "said"), [
    ("places = -'w1'", "must write its `places` out"),
    ("places = WHEELS", "must write its `places` out"),
    ("parameters = {'d': Parameter('m', high=float())}", "must write `d` out"),
    ("id = -'x'", "declares no law"),
])  # fmt: skip
def test_a_declaration_that_is_no_plain_value_is_told(line, said, tmp_path):
    """Some ended in a traceback of `check`, which reads a law file and runs nothing."""
    path = tmp_path / FILE
    path.write_text(f"class A(AbstractMount):\n    id = 'a'\n    {line}\n", encoding="utf-8")
    with pytest.raises(omnijax.InputError, match=said):
        declared_laws(path)


def test_a_value_that_a_rig_file_must_give_is_saved(tmp_path):
    """Where it was the class's own value it was left out: a sweep then said that it is missing."""
    path = tmp_path / FILE
    text = LAW.replace('d: Float[Array, ""]', 'd: Float[Array, ""] = 2.0')
    for ending, optional in (("linear=True", False), ("linear=True, optional=True", True)):
        path.write_text(text.replace("linear=True", ending), encoding="utf-8")
        (law,) = omnijax.load_laws(path).values()
        rig = omnijax.load_rig("atlas").add(law(jnp.asarray(2.0)), "w1")
        omnijax.save_rig(rig, tmp_path / "rig.toml")
        assert float(get_parameter(omnijax.load_rig(tmp_path / "rig.toml"), NAME)) == 2.0
        assert ("d = 2" in (tmp_path / "rig.toml").read_text()) is not optional


def test_a_list_is_declared_as_the_page_says(tmp_path, capsys):
    """`check` asked for `Parameter(unit, ...)` where that stood, with a length that has a name."""
    (declared,) = re.findall(r"`(Parameter\(.*shape=.*?\))`", PAGE)
    path = tmp_path / FILE
    path.write_text(LAW.replace('Parameter("N s^2/m^2", low=0, linear=True)', declared))
    (law,) = declared_laws(path).values()
    assert law.parameters["d"].shape == laws.ANY_LENGTH
    atlas = bundled_rigs()["atlas"].read_text(encoding="utf-8")
    effect = EFFECT.replace("4.0e5", "[1.0, 2.0]")
    (tmp_path / "rig.toml").write_text(atlas + effect, encoding="utf-8")
    assert run(["check", str(tmp_path / "rig.toml")]) == 0, capsys.readouterr().err


def test_a_law_stands_only_where_its_port_is():
    rig, gain = omnijax.load_rig("atlas"), laws.EFFECTS["sensor-gain"](jnp.asarray(0.1))
    with pytest.raises(omnijax.InputError, match=r"`sensor-gain` .* at 'w1': it stands at theta"):
        rig.add(gain, "w1")
    with pytest.raises(omnijax.InputError, match=r"`mount-cubic` .* stands at w1, w2, w3, all\."):
        rig.add(laws.MountCubic(jnp.asarray(1e12)), "sphere")
    assert len(rig.add(gain, "dR").add(gain, "theta").effects) == 2


def test_what_the_page_says_of_a_parameter_are_words_of_it():
    words = [
        w for w in inspect.signature(laws.Parameter).parameters if re.search(f"`{w}[`=]", PAGE)
    ]
    assert words == ["low", "high", "linear", "shape", "optional", "above"]
    assert hasattr(laws, "ANY_LENGTH")
    of_sensors = set(re.findall(r"`(\w+) = True`", PAGE))
    assert of_sensors == vars(laws.AbstractSensor).keys() & {"remembers", "momentary"}
    assert "`linear: ClassVar[bool] = True`" in PAGE and "linear" in vars(laws.AbstractMount)


class SpeedRipple(laws.AbstractShaft):
    """Shaft torque += k ω sin(n θ + φ)."""

    k: jnp.ndarray
    order: jnp.ndarray
    phase: jnp.ndarray

    id, places, formula = "speed-ripple", ("wheel",), "shaft torque += k ω sin(n θ + φ)"
    parameters = {  # noqa: RUF012
        "k": laws.Parameter("N m s/rad", low=0, linear=True),
        "order": laws.Parameter("", low=2, high=9),
        "phase": laws.Parameter("rad"),
    }

    def __call__(self, signal, state=None):
        return self.k * signal.speed * jnp.sin(self.order * signal.angle + self.phase)


class TwoPhased(SpeedRipple):
    """A law of a phase that is no single wave."""

    id = "two-phased"
    parameters = SpeedRipple.parameters | {"order": laws.Parameter("", linear=True)}


def test_a_wave_of_ones_own_is_a_candidate_at_whole_orders():
    """`diagnose --law` ended in a traceback: no `phase` was given to the law."""
    rng, rig = np.random.default_rng(5), omnijax.load_rig("atlas")
    context = Context(rig, ("dR",), np.ones(3), (), 100)
    made = candidates(context, {"speed-ripple": SpeedRipple})
    assert {c.place for c in made} == {"w1", "w2", "w3"} and len(made) == 3 * 8
    signal = laws.ShaftSignal(*map(jnp.asarray, rng.normal(size=len(laws.ShaftSignal._fields))))
    for one in made:
        both = rng.normal(size=2)
        values = one.decode(both)
        assert values["order"] in range(2, 10) and f"order {values['order']:.3g}" == one.note
        alone = SpeedRipple(**values)(signal)
        together = both @ [float(placed.law(signal)) for placed in one.columns]
        assert together == pytest.approx(float(alone), rel=1e-9)
    (first, *_) = candidates(context, {"two-phased": TwoPhased})
    assert len(first.columns) == 2 and first.decode([1.0, 2.0])["phase"] == 0


def test_a_wave_of_ones_own_is_a_candidate_of_a_residual_function():
    """Its strength had to be called `amplitude` in a function's model."""
    made = SmallModel(
        lambda v, placed, split: np.zeros(3), (), {"speed-ripple": SpeedRipple}, "axis"
    )
    for one in made.candidates(Point(np.zeros(0))):
        assert one.decode([3.0, 4.0])["k"] == pytest.approx(5.0)


class Shake(laws.AbstractPlatform):
    """Platform acceleration a sin(20 t) along a direction."""

    a: jnp.ndarray
    direction: jnp.ndarray

    id, places, formula = "shake", ("platform",), "a sin(20 t) e"
    parameters = {  # noqa: RUF012
        "a": laws.Parameter("m/s^2", linear=True),
        "direction": laws.Parameter("1", shape=3),
    }

    def __call__(self, signal, state=None):
        return self.a * jnp.sin(20 * signal) * self.direction


class Cube(laws.AbstractSensor):
    """Reading += g x^3, of three sensors."""

    g: jnp.ndarray

    id, places, formula = "cube", ("dR_z", "encoder", "theta_1", "Omega_x"), "reading += g x³"
    parameters = {"g": laws.Parameter("1", linear=True)}  # noqa: RUF012

    def __call__(self, signal, state=None):
        return self.g * signal.values**3


class Drag(SpeedRipple):
    """A law of one wheel."""

    id, places = "drag", ("w2",)


class Lobes(laws.AbstractShaft):
    """A law that holds a list."""

    amplitudes: jnp.ndarray

    id, places, formula = "lobes", ("wheel",), "shaft torque += sum_k a_k sin(k θ)"
    parameters = {  # noqa: RUF012
        "amplitudes": laws.Parameter("N m", shape=laws.ANY_LENGTH, linear=True)
    }


def test_a_direction_of_ones_own_is_tried_along_each_axis():
    """`diagnose --law` ended in a traceback: no direction was given to the law."""
    context = Context(omnijax.load_rig("atlas"), ("dR",), np.ones(3), (), 100)
    made = candidates(context, {"shake": Shake})
    assert [c.note for c in made] == [f"direction [{x}]" for x in ("1, 0, 0", "0, 1, 0", "0, 0, 1")]
    for axis, one in zip(np.eye(3), made, strict=True):
        pushed = Shake(**one.decode(np.array([2.0])))(jnp.asarray(0.1))
        np.testing.assert_allclose(pushed, 2 * np.sin(2.0) * axis)


@pytest.mark.parametrize(("law", "where"), [
    (Cube, ["dR_z", "theta_1", "theta_2", "theta_3"]),  # Omega was not measured
    (Drag, ["w2"]),
])  # fmt: skip
def test_a_law_of_ones_own_is_tried_wherever_it_may_stand(law, where):
    """One for a single channel or wheel was never tried, without a word."""
    context = Context(omnijax.load_rig("atlas"), ("dR", "theta"), np.ones(3), (), 100)
    made = candidates(context, {law.id: law})
    assert list(dict.fromkeys(c.place for c in made)) == where
    assert len(made) == len(where) * (8 if law is Drag else 1)


def test_a_law_that_holds_a_list_is_no_candidate_and_that_is_said(monkeypatch):
    """`diagnose --law` ended in a traceback."""
    context = Context(omnijax.load_rig("atlas"), ("dR",), np.ones(3), (), 100)
    assert candidates(context, {"lobes": Lobes}) == []
    case = recording.Case(Path("case"), context.rig, [], Path("rig.toml"))
    monkeypatch.setattr("omnijax.diagnosis._diagnose._diagnosed", lambda *_: None)
    with pytest.warns(DataWarning, match="the law `lobes` is no candidate: it holds lists"):
        omnijax.diagnose(case, laws={"lobes": Lobes, "drag": Drag})


SHAPES = {  # port of a law that is not one number a wheel -> place, what it must return
    laws.AbstractBody: ("sphere", "three numbers"),
    laws.AbstractPlatform: ("platform", "three numbers"),
    laws.AbstractShape: ("w1", "one number"),
    laws.AbstractSurface: ("sphere", "one number"),
    laws.AbstractSensor: ("dR", r"an array of shape \(4, 3\)"),
}


@pytest.mark.parametrize("port", SHAPES, ids=lambda port: port.port)
def test_a_law_that_returns_another_shape_than_its_port_s_is_told(port):
    """One number for a torque or an acceleration (3) was taken for all three axes, and a row of a
    sensor's channels for every sample; the others ended in a traceback."""
    place, wanted = SHAPES[port]

    class Wrong(port):
        wide: jnp.ndarray

        id, places = "wrong", ("wheel" if place == "w1" else place,)
        parameters = {"wide": laws.Parameter("1")}  # noqa: RUF012

        def __call__(self, *signal, state=None):
            return jnp.ones(3) if wanted != "three numbers" else jnp.ones(())

    rig = omnijax.load_rig("atlas").add(Wrong(jnp.ones(())), place)
    model = build_model(rig)

    def moving(time):
        state = initial_state(model, omnijax.torques(jnp.ones(3)), time)
        return torque_driven(model, state, Inputs(jnp.ones(3), jnp.zeros(3), time))

    with pytest.raises(omnijax.InputError, match=f"`wrong` must return {wanted} at its port"):
        jax.eval_shape(moving, 0.0)
        sensor_readings(rig, "dR", jnp.arange(4.0), jnp.zeros((4, 3)))


@pytest.mark.parametrize("port", [laws.AbstractMount, laws.AbstractPlatform], ids=lambda p: p.port)
def test_a_law_that_returns_text_is_told(port):
    """It ended in a TypeError of jax."""

    class Says(port):
        g: jnp.ndarray

        id = "says"
        places = (WORDS.get(port.port, ONE_WHEEL)[0],)
        parameters = {"g": laws.Parameter("1")}  # noqa: RUF012

        def __call__(self, *signal, state=None):
            return "loud"

    place = "platform" if port is laws.AbstractPlatform else "w1"
    model = build_model(omnijax.load_rig("atlas").add(Says(jnp.ones(())), place))

    def moving(time):
        state = initial_state(model, omnijax.torques(jnp.ones(3)), time)
        return torque_driven(model, state, Inputs(jnp.ones(3), jnp.zeros(3), time))

    with pytest.raises(omnijax.InputError, match=r"`says` must return numbers .* returns 'loud'"):
        jax.eval_shape(moving, 0.0)


STRANGE = {  # what a law with a memory returns from (`__call__`, `initial`, `rate`) -> the sentence
    "text from initial": ((0.0, "far", 0.0), "numbers from `initial`, but returns 'far'"),
    "text from rate": ((0.0, 0.0, "soon"), "numbers from `rate`, but returns 'soon'"),
    "none from rate": ((0.0, 0.0, None), r"the rate of its memory from `rate`, \(\) \(shapes\)"),
    "three from rate": ((0.0, 0.0, np.zeros(3)), r"the rate of its memory .* returns \(3,\)"),
    "complex from rate": ((0.0, 0.0, 1j * np.ones(())), "real numbers from `rate`"),
    "complex": ((1j * np.ones(()), 0.0, 0.0), "real numbers at its port `contact`"),
}


@pytest.mark.parametrize("place", ["rig", "axis"])
@pytest.mark.parametrize("case", STRANGE)
def test_a_law_whose_memory_is_strange_is_told(case, place):
    (value, first, speed), sentence = STRANGE[case]
    base = laws.AbstractContact if place == "rig" else laws.AbstractShaft

    class Forgets(base):
        """Returns something else than numbers."""

        g: jax.Array
        id = "forgets"
        parameters = {"g": laws.Parameter("1")}  # noqa: RUF012

        def __call__(self, signal, state=None):
            return value

        def initial(self):
            return first

        def rate(self, signal, state):
            return speed

    law, sentence = Forgets(jnp.ones(())), sentence.replace("`contact`", f"`{base.port}`")
    with pytest.raises(omnijax.InputError, match=f"law `forgets` must return {sentence}"):
        if place == "rig":
            omnijax.simulate(omnijax.load_rig("atlas").add(law, "w1"), jnp.ones(3), 0.01)
        else:
            placed = (PlacedLaw(law, "axis"),)
            Ports(placed, resting(placed))("shaft", "axis", laws.ShaftSignal(*jnp.ones(4)))


BELOW = {  # a law below one of the library's -> its place, numbers, and what it makes of the former
    laws.ContactRelaxation: ("all", {"K1": 4e4, "tau": 0.02},
                             lambda first, signal, _: first + 1e12 * signal.deflection**3),
    laws.FloorVibration: ("platform", {"amplitude": 2.0, "frequency": 7.0, "phase": 0.1,
                                       "direction": [1.0, 0.0, 0.0]},
                          lambda first, signal, _: first * (1 + jnp.sin(9 * signal))),
    laws.WheelRunout: ("w1", {"amplitude": 5e-5, "phase": 0.2},
                       lambda first, signal, _: first * jnp.cos(3 * signal)),
}  # fmt: skip


@pytest.mark.full  # in the gate what stands in its way: test_linear_laws
@pytest.mark.parametrize("above", BELOW)
def test_a_law_below_one_of_the_library_is_a_law_of_its_own(above):
    """The closed form took it for the library's: figures of another law without a word."""
    place, numbers, formula = BELOW[above]

    class Own(above):
        """What the library's law gives, changed."""

        id = "own"

        def __call__(self, signal, more=None):
            return formula(super().__call__(signal, more), signal, more)

    rig = omnijax.load_rig("atlas").add(
        Own(**{name: jnp.asarray(x) for name, x in numbers.items()}), place
    )
    with pytest.raises(ValueError, match=r"law `own` has no closed form here"):
        omnijax.steady_state(rig, jnp.array([0.1, 1.2, 0.3]))
    run, stepped = (
        omnijax.simulate(rig, jnp.array([3.0, 4.0, 5.0]), 0.2, solver=solver)
        for solver in ("auto", "exponential")
    )
    assert run.method != "exact"
    np.testing.assert_allclose(run.dR, stepped.dR, rtol=0, atol=1e-8)
