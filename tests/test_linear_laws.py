"""Laws of a user's at contacts and mounts that say they are linear: closed forms take them.

A spring, a damper and a branch that relaxes are known by other names too, as numbers of the rig and
as a law of the library: whatever is asked of them has to be the same.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import ANY_SPEEDS, drawn_machine
from scipy.optimize import brentq
from seeds import drawn_anew

import omnijax
from omnijax import InputError, laws
from omnijax.dynamics import rolling, sphere_velocity
from omnijax.laws import ContactRelaxation
from omnijax.rig._declaration import declared_laws
from omnijax.simulation import (
    exact_obstacle,
    modal_obstacle,
    propagate,
    simulate,
    speeds,
    steady_state,
)
from omnijax.simulation._exact import forced_system
from omnijax.study._evaluation.methods import Question, choose
from omnijax.vibration import evaluate

pytestmark = pytest.mark.brief

FILE = '''
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from omnijax.laws import AbstractContact, AbstractMount, Parameter

ANYWHERE = ("wheel", "all")


class Pad(AbstractContact):
    """Tension k (deflection - z) + c rate, tau dz/dt = deflection - z."""

    k: Float[Array, ""]
    c: Float[Array, ""]
    tau: Float[Array, ""]

    id: ClassVar[str] = "pad"
    places: ClassVar[tuple[str, ...]] = ANYWHERE
    formula: ClassVar[str] = "tension += k (delta - z) + c rate"
    parameters: ClassVar[dict[str, Parameter]] = {
        "k": Parameter("N/m", linear=True), "c": Parameter("N s/m"),
        "tau": Parameter("s", low=0, above=True),
    }
    linear: ClassVar[bool] = True

    def __call__(self, signal, state=None):
        return self.k * (signal.deflection - state) + self.c * signal.rate

    def initial(self):
        return jnp.zeros(())

    def rate(self, signal, state):
        return (signal.deflection - state) / self.tau


class Strut(AbstractMount):
    """A spring and a damper beside the mount's own."""

    k: Float[Array, ""]
    c: Float[Array, ""]

    id = "strut"
    places = ANYWHERE
    formula = "tension += k Delta + c rate"
    parameters = {"k": Parameter("N/m", linear=True), "c": Parameter("N s/m")}
    linear = True

    def __call__(self, signal, state=None):
        return self.k * signal.deflection + self.c * signal.rate


class Swing(AbstractMount):
    """A mass m on a spring k and a damper c that hangs in the mount: p, v of the mass."""

    k: Float[Array, ""]
    c: Float[Array, ""]
    m: Float[Array, ""]

    id = "swing"
    places = ANYWHERE
    formula = "tension += k (Delta - p) + c (rate - v)"
    parameters = {
        "k": Parameter("N/m"), "c": Parameter("N s/m"), "m": Parameter("kg", low=0, above=True)
    }
    linear = True

    def __call__(self, signal, state=None):
        return self.k * (signal.deflection - state["p"]) + self.c * (signal.rate - state["v"][0])

    def initial(self):
        return {"p": jnp.zeros(()), "v": jnp.zeros(1)}

    def rate(self, signal, state):
        return {"p": state["v"][0], "v": (self(signal, state) / self.m)[None]}
'''

W = np.array([1.4, 5.2, -3.3, 2.1])
TS = jnp.linspace(0.0, 0.4, 401)


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """The laws of the file, by id."""
    path = tmp_path_factory.mktemp("laws") / "linear.py"
    path.write_text(FILE, encoding="utf-8")
    assert declared_laws(path).keys() == {"pad", "strut", "swing"}
    return omnijax.load_laws(path)


def with_law(rig, law, place: str, **numbers: float):
    """The rig with a law of these numbers."""
    return rig.add(law(**{name: jnp.asarray(float(x)) for name, x in numbers.items()}), place)


def two_rigs(own, rng, n: int):
    """A drawn rig with laws of a user's, and the same rig by its own numbers."""
    rig = drawn_machine(rng, n, laws.GatedSine())
    k, c, tau = 10 ** rng.uniform([4, 1, -2.5], [5, 2, -1])
    soft, drag = -0.2 * float(rig.wheels.mount.stiffness[1]), rng.uniform(20, 90)
    user = with_law(rig, own["pad"], "w1", k=k, c=c, tau=tau)
    user = with_law(user, own["strut"], "w2", k=soft, c=drag)
    other = with_law(rig, ContactRelaxation, "w1", K1=k, tau=tau)
    wheels = rig.wheels
    moved = (
        wheels.contact.damping.at[0].add(c),
        wheels.mount.stiffness.at[1].add(soft),
        wheels.mount.damping.at[1].add(drag),
    )
    return user, eqx.tree_at(_numbers, other, moved)


def _numbers(rig):
    return rig.wheels.contact.damping, rig.wheels.mount.stiffness, rig.wheels.mount.damping


@ANY_SPEEDS
@pytest.mark.parametrize(
    "long",
    [pytest.param(False, id="four, a run", marks=pytest.mark.full),
     pytest.param(True, id="three, the long run", marks=pytest.mark.full)],
)  # fmt: skip
def test_sweeps_of_linear_laws_are_those_of_the_numbers_that_they_are(own, long):
    """Figures in bulk, and slopes of runs; such a law was stepped in time."""
    rng, n = drawn_anew("sweeps of linear laws"), 3 if long else 4
    user, other = two_rigs(own, rng, n)
    assert modal_obstacle(user) is None
    vary = {"wheel.w1.contact.stiffness": rng.uniform(1e5, 8e5, 3)}
    run = {} if long else {"duration": 0.4, "rate": 500}
    a, b = (
        omnijax.sweep(rig, vary, ("rms", "peak"), speeds=W[:n], gradient=not long, **run)
        for rig in (user, other)
    )
    assert "in bulk" in a.method
    for name in a.store.names:
        rtol = 1e-7 if name.startswith("d_") else 1e-9
        np.testing.assert_allclose(a[name], b[name], rtol=rtol, err_msg=name)
    if not long:  # the sweep's programs again
        paths = ("effect.strut.w2.c", "wheel.w2.mount.damping")
        told = omnijax.sensitivity(user, W, ("rms", "peak"), parameters=paths, **run)
        np.testing.assert_allclose(*told.raw.T, rtol=1e-7)


def test_closed_forms_of_linear_laws_with_memory_are_what_steps_give(own):
    """A mass that hangs in the mount of every wheel, whose laws have two numbers of memory each."""
    rng = drawn_anew("closed forms of linear laws")
    rig = with_law(
        drawn_machine(rng, 3, laws.GatedSine()), own["swing"], "all",
        k=rng.uniform(2e4, 9e4), c=rng.uniform(5, 50), m=rng.uniform(0.02, 0.2),
    )  # fmt: skip
    drive = speeds(W[:3], force=rng.normal(size=3), initial_angle=rng.uniform(-1, 1, 3))
    exact = propagate(rig, drive, TS[::40])
    stepped = simulate(rig, drive, TS[::40], solver="dopri8", rtol=1e-11)
    assert exact.method == "exact"
    size = np.abs(np.asarray(stepped.dR)).max()
    np.testing.assert_allclose(exact.dR, stepped.dR, rtol=0, atol=1e-9 * size)


@pytest.mark.full  # in the gate such laws in runs, above; effects in long runs: test_one_evaluation
def test_steady_states_of_linear_laws_are_those_of_the_numbers_that_they_are(own):
    """Every figure of it, by one solution."""
    rng = drawn_anew("long run of linear laws")
    user, other = two_rigs(own, rng, 3)
    assert modal_obstacle(user) is None
    states = [steady_state(rig, W[:3], harmonics=4, grid_bits=8) for rig in (user, other)]
    for name in ("rms", "peak", "elastic_rms", "sphere_acceleration_rms"):
        a, b = (float(getattr(state, name)) for state in states)
        assert a == pytest.approx(b, rel=1e-9), name


def _declares(port, formula, rate=None, first=0.0):
    """A class that says it is linear."""

    class Says(port):
        k: jax.Array
        g: jax.Array

        id, places, linear = "says", ("wheel", "all"), True
        parameters = {  # noqa: RUF012
            "k": laws.Parameter("N/m", low=0, linear=True), "g": laws.Parameter("1")
        }  # fmt: skip

        def __call__(self, signal, state=None):
            return formula(self, signal, state)

    class Remembers(Says):
        linear = True

        def initial(self):
            return jnp.asarray(first)

        def rate(self, signal, state):
            return rate(self, signal, state)

    return Says if rate is None else Remembers


LIARS = {
    "cubic": (lambda law, s, _: law.k * s.deflection + law.g * s.deflection**3, None),
    "play": (lambda law, s, _: law.k * jnp.clip(s.deflection, -1e-5, 1e-5), None),
    "one way": (lambda law, s, _: law.k * jnp.maximum(s.rate, 0.0), None),
    "preload": (lambda law, s, _: law.k * s.deflection + 0.01, None),
    "product": (lambda law, s, _: law.k * s.deflection * s.rate, None),
    "root": (lambda law, s, _: law.k * jnp.sqrt(s.deflection**2), None),
    "memory": (lambda law, s, z: law.k * (s.deflection - z),
               lambda law, s, z: s.deflection - z - law.g * z**2),
    "creep": (lambda law, s, z: law.k * z, lambda law, s, z: s.rate * (1 + law.g * z) - z),
}  # fmt: skip


@pytest.mark.parametrize("port", [laws.AbstractContact, laws.AbstractMount], ids=lambda p: p.port)
@pytest.mark.parametrize("case", LIARS)
def test_a_law_that_is_not_linear_and_says_so_is_told(case, port):
    """With g = 0 some are linear: a study may vary it."""
    law = _declares(port, *LIARS[case])
    rig = with_law(omnijax.load_rig("atlas"), law, "w2", k=3e4, g=0.0)
    said = r"law `says` says that it is linear, but what it returns is not proportional"
    with pytest.raises(InputError, match=said):
        simulate(rig, [1.0, 2.0, 3.0], 0.1)


def test_the_file_of_a_law_that_is_not_linear_is_told(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(FILE.replace("+ self.c * signal.rate", "+ self.c * abs(signal.rate)"))
    law = omnijax.load_laws(path)["strut"]
    rig = with_law(omnijax.load_rig("atlas"), law, "w2", k=3e4, c=1.0)
    for ask in (
        lambda: omnijax.sweep(rig, {"wheel.roundness": [0.2, 0.3]}, "rms", speeds=[1, 2, 3]),
        lambda: jax.jit(lambda x: exact_obstacle(eqx.tree_at(_damping, rig, x)) or x)(1.0),
    ):
        with pytest.raises(InputError, match=r"law `strut` of mine.py says that it is linear"):
            ask()


def _damping(rig):
    return rig.effects[0].law.c


@pytest.mark.parametrize(("line", "said"), [
    ('linear = "yes"', "`linear` must be True or False, but is 'yes'"),
    ("linear = 1", "`linear` must be True or False, but is 1"),
])  # fmt: skip
def test_a_declaration_is_true_or_false(line, said, tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(FILE.replace("    linear = True", f"    {line}"), encoding="utf-8")
    for read in (omnijax.load_laws, declared_laws):
        with pytest.raises(InputError, match=f"law `strut`: {said}"):
            read(path)
    path.write_text(FILE.replace("AbstractMount", "AbstractShaft"), encoding="utf-8")
    for read in (omnijax.load_laws, declared_laws):
        with pytest.raises(InputError, match=r"law `strut` says `linear = True`, .* `shaft`"):
            read(path)


def test_a_law_below_a_linear_one_says_so_itself():
    """Its formula is another one."""

    class Below(ContactRelaxation):
        id = "below"

    class Says(Below):
        id, linear = "below-says", True

    class Named(laws.AbstractMount):
        """A field of that name is a number of the law, not its word."""

        linear: jax.Array = 1.0
        id, places, parameters = "named", ("wheel",), {"linear": laws.Parameter("1")}

        def __call__(self, signal, state=None):
            return self.linear * signal.deflection

    atlas = omnijax.load_rig("atlas")
    silent = with_law(atlas, Below, "w1", K1=1e4, tau=0.1)
    assert exact_obstacle(silent) == (
        "law `below` has no closed form here, as it does not say `linear = True`"
    )
    assert exact_obstacle(with_law(atlas, Says, "w1", K1=1e4, tau=0.1)) is None
    other = with_law(atlas, Named, "w1", linear=1.0)
    assert "does not say" in str(exact_obstacle(other))


def test_a_memory_that_comes_to_no_rest_is_an_obstacle():
    law = _declares(laws.AbstractMount, lambda s, x, z: s.k * z, lambda s, x, z: x.rate + 0 * z)
    rig = with_law(omnijax.load_rig("atlas"), law, "w1", k=1e3, g=0.0)
    assert exact_obstacle(rig) == "the memory of law `says` comes to no rest by itself"


def _feeding(rig, law, rate: float) -> float:
    """Damping of a strut at w2 with which the fastest growth of the rig is `rate` (1/s)."""

    def growth(c):
        A = forced_system(with_law(rig, law, "w2", k=0.0, c=c), "coupled", W[:3], (0,)).A
        return np.linalg.eigvals(np.asarray(A)).real.max() - rate

    return float(brentq(growth, -3000.0, 0.0, xtol=1e-3))


@pytest.mark.full
def test_a_law_that_feeds_the_motion_has_no_long_run_and_lifts_off_as_its_run_does(own):
    """A damper of negative size: a pole that grows shows more at a block's end than before."""
    rng = drawn_anew("laws that feed")
    rig = drawn_machine(rng, 3, laws.GatedSine())
    strut, path = own["strut"], "effect.strut.w2.c"
    fed = with_law(rig, strut, "w2", k=0.0, c=0.0)
    values = np.array([_feeding(rig, strut, rng.uniform(5, 25)), rng.uniform(20, 90)])
    long = omnijax.sweep(fed, {path: values}, ("rms",), speeds=W[:3])
    np.testing.assert_array_equal(np.isfinite(long["rms"]), [False, True])
    assert long.status(0) == "non-finite"
    one = with_law(rig, strut, "w2", k=0.0, c=values[0])
    assert not steady_state(one, W[:3], harmonics=4, grid_bits=8).ok
    run = propagate(one, speeds(W[:3]), TS)
    swing = np.asarray(run.normal_force) - np.asarray(rig.wheels.closure.preload)
    held, lifted = (
        eqx.tree_at(lambda r: r.wheels.closure.preload, fed, jnp.full(3, share * -swing.min()))
        for share in (1.05, 0.9)
    )
    for case, ended in ((held, {"ok", "slip"}), (lifted, {"lift-off"})):
        runs = omnijax.sweep(case, {path: values}, ("rms",), speeds=W[:3], duration=0.4, rate=1000)
        assert runs["rms"][0] == pytest.approx(float(evaluate(run, one, "rms")["rms"]), rel=1e-8)
        assert runs.status(0) in ended


OUTSIDE = {  # a law that no closed form takes -> its place, numbers, and why
    "contact-cubic": ("w1", {"K3": 1e12}, "is not linear in the elastic state"),
    "mount-backlash": ("all", {"gap": 1e-5}, "is not linear in the elastic state"),
    "air-drag": ("sphere", {"D": 0.1}, "is not linear in the sphere's rate"),
    "sphere-out-of-round": ("sphere", {"amplitude": 8e-5, "axis": [1.0, 0.3, 0.2]},
                            "hangs on the sphere's attitude"),
}  # fmt: skip


@pytest.mark.parametrize("name", OUTSIDE)
def test_a_rig_outside_the_linear_class_says_which_law_and_what_it_costs(name):
    """It said that a sphere out of round is not linear in the elastic state."""
    place, numbers, why = OUTSIDE[name]
    law = laws.EFFECTS[name](**{key: jnp.asarray(x) for key, x in numbers.items()})
    rig = omnijax.load_rig("atlas-tripod").add(law, place)
    drive, length = speeds(W[:3]), drawn_anew(name).uniform(0.2, 5)
    asked = Question(rig, (drive,), (), ("rms",), "coupled", length, True)
    method, reason = choose(asked)
    assert method == "full" and f"law `{name}` {why}" in reason
    assert f"each run of {length:g} s is stepped in time" in reason
    with pytest.raises(InputError, match=rf"(?s)`{name}` {why}.*each second of a run is stepped"):
        choose(asked._replace(duration=None))
    inside = asked._replace(rig=omnijax.load_rig("atlas-tripod"), duration=None)
    assert "stepped" not in choose(inside)[1]


def test_gaps_move_the_rate_of_the_sphere():
    """So a sphere out of round shows no lines at |Omega| and 2 |Omega|."""
    rig = drawn_machine(drawn_anew("rate of the sphere"), 3, laws.GatedSine())
    angles = np.linspace(0, 2 * np.pi / np.asarray(rig.wheels.rollers), 50)
    rate = jax.vmap(lambda a: sphere_velocity(rig, rolling(rig, a, W[:3]), W[:3]))(angles)
    assert np.ptp(np.asarray(rate), axis=0).max() > 1e-4 * np.abs(rate).max()
