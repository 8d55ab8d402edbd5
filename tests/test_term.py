"""The vector fields as diffrax terms move the machines as the library's own solvers do."""

import re
from pathlib import Path
from typing import Any, ClassVar

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float

from omnijax import simulate, torques
from omnijax.laws import AbstractCommand, ActuatorDelay, Parameter
from omnijax.machine import (
    Axis,
    Log,
    PlacedLaw,
    delayed_inputs,
    free_run,
    machine_text,
    outputs_along,
    parse_machine,
    start_vector,
    states_along,
)
from omnijax.rig import InputError
from tests.seeds import drawn_anew

pytestmark = [pytest.mark.long, pytest.mark.brief]

STEP = 2e-3
PAGE = Path(__file__).parents[1] / "docs" / "howto" / "diffrax.md"


def shown(part: int, **changed) -> dict:
    """What a block of the page computes, some of its texts `changed`."""
    text = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.S)[part]
    for old, new in changed.values():
        assert old in text
        text = text.replace(old, new)
    names: dict = {}
    exec(text, names)
    return names


def test_the_term_of_a_rig_moves_as_simulate_does():
    rng = drawn_anew("term of a rig")
    drawn = repr(", ".join(f"{x:.4g} mNm" for x in rng.uniform(-20, 20, 3)))
    found = shown(0, drive=('"10 mNm, 0, 5 mNm"', drawn))
    run = simulate(found["rig"], torques(drawn[1:-1]), found["found"].ts)
    states = found["states"]
    for name, mine in (("Omega", states.angular_velocity), ("theta", states.angle),
                       ("dR", states.elastic.approach)):  # fmt: skip
        theirs = np.asarray(run[name])
        np.testing.assert_allclose(mine, theirs, atol=1e-5 * max(np.ptp(theirs), 1e-9))


def test_the_term_of_an_axis_moves_as_its_free_run_with_delay_and_memory(tmp_path):
    rng = drawn_anew("term of an axis")
    J, k, delay, tau = rng.uniform(0.5, 2), rng.uniform(10, 30), 4 * STEP, rng.uniform(0.01, 0.03)
    data = {
        "kind": "axis", "axis": {"inertia": J, "damping": 0.5 * J, "gravity": k * J},
        "motor": {"input": "torque"},
        "effect": [{"id": "actuator-lag", "parameters": {"tau": tau}},
                   {"id": "actuator-delay", "parameters": {"delay": delay}},
                   {"id": "load-friction", "parameters": {"mu": 0.2}}],
    }  # fmt: skip
    file = parse_machine(data)
    time = np.arange(500) * STEP
    u = 5 * J * np.sin(rng.uniform(3, 6) * time)
    first = {"position": (float(rng.uniform(-0.3, 0.3)), 0.0)}
    wanted = free_run(file.machine, file.placed, first, {"input": u}, STEP)["position"]
    log = Log("a", "train", time, {"input": u}, {"position": wanted})
    got: Any = dfx.diffeqsolve(
        file.machine.term(log, file.placed), dfx.Tsit5(), 0.0, time[-1], 1e-3,
        start_vector(file.machine, first, file.placed), saveat=dfx.SaveAt(ts=jnp.asarray(time)),
        stepsize_controller=dfx.PIDController(rtol=1e-7, atol=1e-9), max_steps=100_000,
    ).ys  # fmt: skip
    np.testing.assert_allclose(got[:, 0], wanted, atol=2e-5)
    path = tmp_path / "machine.toml"
    path.write_text(machine_text(file))
    end = np.asarray(shown(1, file=("machine.toml", str(path)))["found"].ys[-1])
    assert end.shape == (3,) and np.all(np.isfinite(end)) and abs(end[0]) > 1e-4


class SwayingDelay(AbstractCommand):
    """A command whose delay is d (1 + sin(w t))."""

    d: Float[Array, ""]
    w: Float[Array, ""]
    id: ClassVar[str] = "swaying-delay"
    places: ClassVar[tuple[str, ...]] = ("axis",)
    formula: ClassVar[str] = "time of the command -= d (1 + sin w t)"
    parameters: ClassVar[dict[str, Parameter]] = {"d": Parameter("s"), "w": Parameter("rad/s")}

    def __call__(self, signal, state=None):
        return -self.d * (1 + jnp.sin(self.w * signal))


@pytest.mark.full  # in the gate a constant delay, above
def test_a_delay_of_the_command_acts_as_it_is_at_each_moment():
    """J dv/dt = u(t - d (1 + sin w t)) with u = c t; it had stood as it was at the start.

    A second one adds, as at a rig's wheels, and nothing acts from before the first sample.
    """
    rng = drawn_anew("a delay that sways")
    J, c, d, w = rng.uniform(0.5, 2), rng.uniform(1, 5), rng.uniform(0.005, 0.02), 9.0
    sway = PlacedLaw(SwayingDelay(jnp.asarray(d), jnp.asarray(w)), "axis")
    steady = PlacedLaw(ActuatorDelay(jnp.asarray(0.01)), "axis")
    axis, time = Axis(jnp.asarray(J)), np.arange(1000) * STEP
    placed = (sway, steady)
    given = {"input": jnp.asarray(c * time)}
    late = np.asarray(delayed_inputs(placed, jnp.asarray(time), given)["input"])
    wanted = c * np.maximum(time - d * (1 + np.sin(w * time)) - 0.01, 0.0)
    begun = 2 + np.argmax(wanted > 0)  # behind the kink at the first sample
    np.testing.assert_allclose(late[begun:], wanted[begun:], atol=1e-9)
    assert np.all(np.abs(late[: begun - 2]) < c * STEP)
    inputs, first = {"input": c * time}, {"position": (0.0, 0.0)}
    got = free_run(axis, placed, first, inputs, STEP)["velocity"]
    after = time[begun:] - time[begun]
    moved = c / J * (time[begun] - d - 0.01) * after + c / J * after**2 / 2
    moved += c / J * d / w * (np.cos(w * time[begun:]) - np.cos(w * time[begun]))
    np.testing.assert_allclose(got[begun:] - got[begun], moved, atol=2e-5 * np.ptp(got))
    log = Log("a", "train", time, inputs, {"position": 0 * time})
    field, start = axis.term(log, placed), start_vector(axis, first, placed)
    for k in rng.integers(30, 1000, 5):
        assert float(field.vf(time[k], start, None)[1]) == pytest.approx(wanted[k] / J, rel=1e-9)


def test_inputs_that_the_machine_has_not_are_one_sentence():
    axis = Axis(jnp.ones(()))
    with pytest.raises(InputError, match=r"`inputs.imput` is no input.*Did you mean `input`"):
        axis.term({"imput": 1.0})
    with pytest.raises(InputError, match=r"`inputs.input` \(N m\) is missing"):
        axis.term({})


@pytest.mark.full  # in the gate the motion, above; here how fast it is
def test_states_of_a_machine_are_stepped_as_numbers_of_their_own():
    """XLA puts no vector of them together within its loops: that takes twice the time."""
    axis = Axis(0.02, damping=0.1, second_inertia=0.05, second_stiffness=60.0)
    u = jnp.zeros(50)

    def moved_by(x0):
        states = states_along(axis, (), x0, {"input": u}, 1e-3, 1, 1)
        return outputs_along(axis, states, {"input": u}, 1)["position"]

    text = jax.jit(jax.vmap(moved_by)).lower(jnp.zeros((8, 4))).compile().as_text() or ""
    put = [line for line in text.splitlines() if " concatenate(" in line]
    assert " while(" in text and put
    assert not any("/while/" in line for line in put)
