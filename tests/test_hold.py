"""Where nothing holds the sphere there is no steady state, and a status says so."""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compilations import counted
from machines import SKEW, machine

from omnijax._errors import DataWarning, InputError
from omnijax._status import Status
from omnijax.dynamics import held, held_directions, hold_obstacle
from omnijax.simulation import propagate, simulate, speeds, steady_state, torques
from omnijax.study import sweep
from omnijax.study._evaluation import Evaluation
from omnijax.vibration import steady_metrics
from omnijax.view._panel import Panel

pytestmark = pytest.mark.brief

W = np.array([0.6, 1.2, 0.9])
SIZES = {"harmonics": 96, "grid_bits": 7}  # as the panel asks for: one program


def layout(rng, kind, wheels=3):
    """Normals and drives, turned at random; drives span space, whatever the normals do."""
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    normal = rng.normal(size=(wheels, 3))
    if kind == "opposed":
        normal[1] = -normal[0]
        normal[3:, 2] = normal[0, 2] = normal[1, 2] = normal[2, 2] = 0.0
    elif kind == "parallel":
        normal = np.sign(normal[:, :1]) * normal[0]
    elif kind == "nearly":  # all in one plane but for 1e-8
        normal[:, 2] *= 1e-8
    else:  # far enough from one plane
        normal[:3] = np.array(SKEW[0]) + 0.1 * rng.normal(size=(3, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    drive = np.cross(normal, rng.normal(size=(wheels, 3)))
    return normal @ turn, drive / np.linalg.norm(drive, axis=1, keepdims=True) @ turn


@pytest.mark.parametrize("kind", ["opposed", "parallel", "nearly", "held"])
def test_what_holds_is_what_the_singular_values_say(kind):
    rng = np.random.default_rng(sum(map(ord, kind)))
    for wheels in (3, 3, 4, 5, 6):
        rig = machine(layout(rng, kind, wheels))
        values = np.linalg.svd(np.asarray(rig.wheels.normal))[1]
        count = int(np.sum(values > 1e-6))
        assert (count == 3) == (kind == "held")
        assert bool(held(rig)) == (count == 3) and held_directions(rig) == count
        assert (hold_obstacle(rig) is None) == (count == 3)
        assert hold_obstacle(rig, "paper") is None


def test_the_bound_lies_within_a_root_of_three_of_the_least_singular_value():
    rng = np.random.default_rng(1)
    for exponent in rng.uniform(-9, -3, 60):
        left, right = (np.linalg.qr(rng.normal(size=(n, n)))[0] for n in (4, 3))
        normal = left[:, :3] * [1.0, rng.uniform(0.1, 1), 10**exponent] @ right
        if abs(exponent + 6) > np.log10(2):
            rig = eqx.tree_at(
                lambda r: r.wheels.normal, machine(layout(rng, "held", 4)), jnp.asarray(normal)
            )
            assert bool(held(rig)) == (exponent > -6)
    two = machine(tuple(x[:2] for x in layout(rng, "held")))
    assert not held(two) and held_directions(two) == 2


def _layouts():
    rng = np.random.default_rng(7)
    found = [layout(rng, kind) for kind in ("held", "opposed", "parallel", "nearly", "held")]
    normal, drive = (jnp.asarray(np.stack(x)) for x in zip(*found, strict=True))
    return normal, drive, np.array([0, 7, 7, 7, 0])


def _moved(rig, normal, drive, stiffer=0.0):
    w = rig.wheels
    return eqx.tree_at(
        lambda r: (r.wheels.normal, r.wheels.drive, r.wheels.contact.stiffness),
        rig,
        (normal, drive, w.contact.stiffness * (1 + stiffer)),
    )


@pytest.mark.full
def test_steady_states_under_jit_vmap_and_grad_have_a_status():
    rig, (normal, drive, expected) = machine(SKEW), _layouts()
    one = partial(steady_state, speeds=W, **SIZES)

    @jax.jit
    def many(normal, drive):
        def rms(stiffer, n, d):
            state = one(_moved(rig, n, d, stiffer))
            return state.rms, state

        return jax.vmap(jax.grad(rms, has_aux=True), (None, 0, 0))(0.0, normal, drive)

    slopes, states = many(normal, drive)
    ok = expected == Status.OK
    np.testing.assert_array_equal(states.status, expected)
    for name in (*states.UNITS,):
        if name != "order":
            finite = np.isfinite(getattr(states, name)).reshape(len(ok), -1)
            np.testing.assert_array_equal(finite, np.broadcast_to(ok[:, None], finite.shape))
    assert np.isfinite(np.asarray(slopes)[ok]).all()
    alone = one(_moved(rig, normal[0], drive[0]))
    assert alone.ok and alone.message() == "ok"
    np.testing.assert_allclose(alone.peak, states.peak[0], rtol=1e-9)
    loose = one(_moved(rig, normal[1], drive[1]))
    assert not loose.ok and np.isnan(loose.rms)
    assert repr(loose).startswith("SteadyState(unheld: the wheels do not hold the sphere")
    assert loose.to_xarray().attrs["status"] == "unheld"


@pytest.mark.full  # in the gate one such rig, below
def test_designs_of_a_batch_that_nothing_holds_fail_with_that_word():
    rig, (normal, drive, expected) = machine(SKEW), _layouts()
    how = Evaluation("steady", ("rms",))

    @jax.jit
    @jax.vmap
    def evaluated(normal, drive):
        return how(_moved(rig, normal, drive), speeds(W))

    values, status = evaluated(normal, drive)
    np.testing.assert_array_equal(np.isnan(values[:, 0]), expected != 0)
    np.testing.assert_array_equal(np.asarray(status) == Status.UNHELD, expected != 0)
    assert {Status(int(s)).text for s in status[1:4]} == {"unheld"}
    names = ("rms", "peak")
    found = steady_metrics(_moved(rig, normal[1], drive[1]), jnp.asarray(W), names)
    assert tuple(found) == names and np.isnan(found["rms"])
    compiled = counted("jaxpr_trace")
    held = steady_metrics(_moved(rig, normal[0], drive[0]), jnp.asarray(W[::-1]), names)
    assert np.isfinite(held["rms"]) and compiled == []  # another rig by the same program


def test_a_rig_that_no_wheel_drives_about_an_axis_ends_without_figures():
    """w2 opposite w1 with parallel rims: Omega is not finite, and the sizes are still counted."""
    E = np.eye(3)
    rig = machine(([E[0], -E[0], E[2]], [E[2], E[2], E[1]]))
    with pytest.warns(DataWarning, match="no wheel drives the axis|do not fit"):
        state = steady_state(rig, jnp.asarray(W), **SIZES)
    assert int(state.status) == Status.UNHELD and np.isnan(state.peak)
    with pytest.warns(DataWarning, match="no wheel drives the axis|do not fit|drifts off"):
        run = propagate(rig, speeds(W), jnp.linspace(0, 0.1, 6))
    assert int(run.status) == Status.NON_FINITE and "no wheel drives" in run.message()
    with pytest.raises(InputError, match="no steady state: unheld"):
        Panel("a", rig, W.tolist(), 0).evaluate({})


@pytest.mark.parametrize("given", [[1e300, 1, 1], [0, -2e6, 1], "1, 1, 1e8 rpm"])
def test_speeds_beyond_all_measure_are_refused(given):
    """At 1e30 rad/s a run was ok."""
    rig = machine(SKEW)
    told = r"must lie in \[-1e\+06, 1e\+06\] rad/s, but is -?(1e\+300|2e\+06|1\.)"
    for ask in (
        lambda: propagate(rig, speeds(given), jnp.linspace(0, 0.1, 6)),
        lambda: simulate(rig, given, 0.1),
        lambda: steady_state(rig, given, **SIZES),
        lambda: sweep(rig, {"contact.stiffness": [1e5]}, drive=given),
    ):
        with pytest.raises(InputError, match=told):
            ask()


AROUND = np.array([0.3, 2.2, 4.9])
ACROSS = np.stack([-np.sin(AROUND), np.cos(AROUND), 0 * AROUND], 1) * np.sin([[0.4], [-0.9], [1.1]])
IN_A_PLANE = (
    np.stack([np.cos(AROUND), np.sin(AROUND), 0 * AROUND], 1),
    ACROSS + np.cos([[0.4], [-0.9], [1.1]]) * np.eye(3)[2],
)
OPPOSED = np.eye(3)[[0, 0]] * [[1], [-1]], np.eye(3)[[2, 2]]


@pytest.mark.filterwarnings("ignore:(the wheels do not hold|no wheel drives|The speeds)")
@pytest.mark.parametrize(
    "layout, turning",
    [pytest.param(IN_A_PLANE, [1.3] * 3, id="plane"),
     pytest.param(OPPOSED, [1.3, -1.3], id="opposed", marks=pytest.mark.full)],
)  # fmt: skip
def test_runs_of_what_nothing_holds_are_the_same_on_every_path(layout, turning):
    """Three wheels around the equator, or two opposite each other: every run was non-finite."""
    rig, ts = machine(layout), jnp.linspace(0, 0.1, 6)
    exact = propagate(rig, speeds(turning), ts)
    stepped = simulate(rig, speeds(turning), ts, solver="dopri8", rtol=1e-10)
    assert exact.ok and stepped.ok
    size = np.abs(exact.dR).max()
    assert size > 1e-6
    np.testing.assert_allclose(stepped.dR, exact.dR, atol=1e-7 * size)


@pytest.mark.full  # in the gate under speeds, above
@pytest.mark.filterwarnings("ignore:(the wheels do not hold|no wheel drives|The speeds)")
@pytest.mark.parametrize("layout", [IN_A_PLANE, OPPOSED], ids=["plane", "opposed"])
def test_torques_drive_what_nothing_holds(layout):
    """Such runs were non-finite."""
    rig = machine(layout)
    torque = torques(0.01 * np.ones(rig.size))
    assert simulate(rig, torque, jnp.linspace(0, 0.1, 6)).ok
