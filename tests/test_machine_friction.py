"""Free runs with steep friction, and what a diagnosis by free runs names and leaves alone."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tiers import tiered

from omnijax.diagnosis import diagnose
from omnijax.laws import AXIS_EFFECTS
from omnijax.machine import Axis, Log, MachineCase, PlacedLaw, free_run, parse_machine

STEP, COUNT, CUT = 5e-3, 2400, 1600


def law(id: str, **values) -> PlacedLaw:
    """An effect at the axis."""
    return PlacedLaw(
        AXIS_EFFECTS[id](**{k: jnp.asarray(v, float) for k, v in values.items()}), "axis"
    )


@pytest.mark.parametrize("seed", tiered(range(3), bool))
def test_steep_friction_is_followed_however_coarse_the_log(seed):
    rng = np.random.default_rng(seed)
    J, k, torque = 10 ** rng.uniform(-3, 0), rng.uniform(20, 80), rng.uniform(2, 6)
    width = 10 ** rng.uniform(-2, -1)  # steps of a sample would need some 0.1 ms of it
    t, w = np.arange(300) * STEP, rng.uniform(4, 9)
    u = 25 * J * np.sin(w * t)
    placed = (law("bearing-coulomb", torque=torque * J, width=width),)
    axis = Axis(J, damping=0.5 * J, stiffness=k * J)
    got = free_run(axis, placed, {"position": (0.0, 0.0)}, {"input": u}, STEP)["position"]

    def rate(time, x):
        given = np.interp(time, t, u) / J
        return [x[1], given - k * x[0] - 0.5 * x[1] - torque * np.tanh(x[1] / width)]

    exact = solve_ivp(
        rate, (0, t[-1]), [0.0, 0.0], "Radau", t, rtol=1e-8, atol=1e-10, max_step=STEP
    )
    np.testing.assert_allclose(got, exact.y[0], atol=2e-3 * np.ptp(exact.y[0]))


def case(folder, seed: int, placed=(), noise: float = 2e-4) -> MachineCase:
    """A pendulum with a motor, its inertia and gravity not quite as stated, in two runs of one.

    The second run begins in mid-motion: nobody measured its speed there.
    """
    rng = np.random.default_rng(seed)
    J, w = 10 ** rng.uniform(-3, -1), rng.uniform(5, 9)
    pendulum = {"inertia": J, "gravity": J * w**2, "damping": 0.1 * J * w}
    file = parse_machine({
        "kind": "axis", "motor": {"input": "torque"}, "axis": pendulum,
        "uncertainty": {"axis.inertia": 0.3, "axis.gravity": 0.3, "axis.damping": 0.5},
    })  # fmt: skip
    t = np.arange(COUNT) * STEP
    u = sum(np.sin(2 * np.pi * f * t + rng.uniform(0, 6)) for f in rng.uniform(0.2, 1.5, 4))
    off = rng.normal(size=2)
    true = Axis(J * np.exp(0.1 * off[0]), gravity=J * w**2 * np.exp(0.1 * off[1]),
                damping=0.1 * J * w)  # fmt: skip
    u = 3 * J * u
    q = free_run(true, placed, {"position": (0.0, 0.0)}, {"input": u}, STEP)["position"]
    q = q + noise * rng.normal(size=COUNT)
    logs = [
        Log(role, role, t[part] - t[part][0], {"input": u[part]}, {"position": q[part]})
        for role, part in (("train", slice(None, CUT)), ("held-out", slice(CUT, None)))
    ]
    return MachineCase(folder, file, logs, False, [])


@pytest.mark.full
@pytest.mark.parametrize(("id", "key", "power"), [
    ("load-friction", "mu", 0.0), ("load-friction-quadratic", "kappa", 1.0),
])  # fmt: skip
def test_friction_that_grows_with_the_load_is_named_not_what_its_tangent_looks_like(
    tmp_path, id, key, power
):
    rng = np.random.default_rng(7)
    mu, plain = float(rng.uniform(0.15, 0.3)), case(tmp_path, 3)
    size = mu / float(np.std(plain.logs[0].inputs["input"])) ** power
    found = diagnose(case(tmp_path, 3, (law(id, **{key: size}, width=0.02),)))
    assert [e.id for e in found.effects] == [id], found
    assert found.effects[0].parameters[key]["value"] == pytest.approx(size, rel=0.05)


@pytest.mark.full
def test_a_run_that_begins_in_motion_is_no_evidence(tmp_path):
    found = diagnose(case(tmp_path, int(np.random.default_rng(5).integers(100, 200))))
    assert (found.verdict, found.effects) == ("none", []), found
