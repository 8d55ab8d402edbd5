"""The exponential method: its phi functions, its order, its accuracy at every stiffness, kinks."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import ORTHOGONAL, machine
from scipy.linalg import expm

from omnijax import InputError, laws
from omnijax.laws import Gap
from omnijax.simulation import fixed_methods, simulate, simulate_many, speeds, torques
from omnijax.simulation._solve.exponential import FRACTIONS, Exponential, LinearPart
from omnijax.simulation._solve.phi import phi_functions
from omnijax.simulation._solve.steps import angle_to_edge, time_to_edge

pytestmark = pytest.mark.brief


def phi_by_exponential(z, count):
    """phi_1 ... phi_count as blocks of one matrix exponential."""
    m = len(z)
    whole = np.zeros(((count + 1) * m,) * 2)
    whole[:m, :m] = z
    for j in range(count):
        whole[j * m : (j + 1) * m, (j + 1) * m : (j + 2) * m] = np.eye(m)
    return expm(whole)[:m].reshape(m, count + 1, m).swapaxes(0, 1)[1:]


def stiff_matrix(fast):
    """A fast pole, a slow one, an undamped pair, and a defective pair, mixed."""
    A = np.zeros((6, 6))
    A[0, 0], A[1, 1], A[2, 3], A[3, 2] = -fast, -9.0, 190.0, -190.0
    A[4:, 4:] = [[-40.0, 1.0], [0.0, -40.0]]
    mix = np.eye(6) + 0.1 * np.random.default_rng(3).normal(size=(6, 6))
    return mix @ A @ np.linalg.inv(mix)


@pytest.mark.parametrize("step", [0.064, 0.001, 3.1e-7])
def test_phi_functions_agree_with_matrix_exponentials(step):
    A = stiff_matrix(7e4)
    found = LinearPart.of(jnp.asarray(A), jnp.asarray(0.064)).at(jnp.asarray(step))
    for row, fraction in zip(found, FRACTIONS, strict=True):
        np.testing.assert_allclose(row, phi_by_exponential(fraction * step * A, 5), atol=1e-11)
    for halved, phi in enumerate(phi_functions(jnp.asarray(A), step, 2)):
        np.testing.assert_allclose(phi, phi_by_exponential(step / 2**halved * A, 3), atol=1e-11)


def test_derivative_of_phi_is_finite_and_right_at_a_defective_matrix():
    A, way = jnp.asarray(stiff_matrix(300.0)), jnp.asarray(np.eye(6)[::-1])

    def entry(s):
        return LinearPart.of(A + s * way, jnp.asarray(0.03)).at(jnp.asarray(0.03))[-1, 1]

    slope = jax.jacfwd(entry)(0.0)
    difference = (entry(1e-3) - entry(-1e-3)) / 2e-3
    np.testing.assert_allclose(slope, difference, rtol=1e-5, atol=1e-9)


def one_step_errors(steps, fast):
    """Error of the method at fixed steps on dy/dt = A y + N(t, y) with a known solution."""
    import diffrax as dfx

    A = jnp.asarray(stiff_matrix(fast))
    direction = jnp.arange(1.0, 8.0) / 7

    def known(t):
        return direction * jnp.sin(3 * t + 1 + jnp.arange(7.0))

    def remainder(t, y, args):
        rate = jax.jvp(known, (t,), (1.0,))[1]
        nonlinear = jnp.sin(y[6]) * y[5] - jnp.sin(known(t)[6]) * known(t)[5]
        return rate.at[:6].add(-A @ known(t)[:6]) + nonlinear

    errors = []
    for n in steps:
        h = 1.0 / n
        linear = LinearPart.of(A, jnp.asarray(h))
        solution = dfx.diffeqsolve(
            dfx.MultiTerm(linear, dfx.ODETerm(remainder)),
            Exponential(),
            0.0,
            1.0,
            h,
            known(0.0),
            stepsize_controller=dfx.ConstantStepSize(),
        )
        assert solution.ys is not None
        errors.append(float(jnp.max(jnp.abs(solution.ys[-1] - known(1.0)))))
    return np.array(errors)


@pytest.mark.parametrize("fast", [20.0, 7e4])
def test_order_five_shows_as_slope(fast):
    steps = np.array([24, 48, 96])
    slopes = -np.diff(np.log2(one_step_errors(steps, fast)))
    assert np.all(slopes > 4.6), slopes  # also where the fast pole makes |h A| thousands


CHANNELS = ("theta", "Omega", "dR", "dR_elastic", "R_l", "a")


def worst(run, reference, channels=CHANNELS):
    """Largest error of each channel over that channel's largest size."""
    return {
        name: float(np.max(np.abs(getattr(run, name) - getattr(reference, name))))
        / float(np.max(np.abs(getattr(reference, name))))
        for name in channels
    }


@pytest.mark.parametrize(
    "drive",
    [
        torques([0.2, 0.5, -0.3], (0.1, 0.2, 0.3), initial_velocity=(0.2, -0.3, 0.1)),
        pytest.param(speeds([0.7, 5.2, 2.3]), marks=pytest.mark.full),
    ],
    ids=["torque", "speed"],
)
def test_default_settings_keep_a_millionth_at_every_damping(drive, capsys):
    """Against another method, explicit and of high order, at a tight tolerance."""
    ts = jnp.linspace(0, 0.12, 61)
    table = ["    C        steps  " + "  ".join(f"{c:>10}" for c in CHANNELS)]

    def run(damping, solver, **how):
        rig = machine(ORTHOGONAL, mass=0.25, contact_damping=damping * jnp.array([1, 1.1, 1.2]))
        return simulate(rig, drive, ts, solver=solver, **how)

    for damping in (0.0, 120.0, 8500.0, 20000.0):
        default, reference = run(damping, "exponential"), run(damping, "dopri8", rtol=1e-10)
        assert int(default.status) == int(reference.status) == 0
        errors = worst(default, reference)
        row = "  ".join(f"{errors[c]:10.1e}" for c in CHANNELS)
        table.append(f"{damping:9.0f} {int(default.steps):8d}  {row}")
        assert max(errors.values()) < 1e-6, errors
    with capsys.disabled():
        print("\n" + "\n".join(table))


def test_the_exponential_method_is_the_one_taken():
    drive = torques([0.2, 0.5, -0.3], initial_velocity=(0.2, -0.3, 0.1))
    assert simulate(machine(contact_damping=60.0), drive, [0.0, 0.005]).method == "exponential"


def test_steps_end_at_the_next_kink():
    one = jnp.asarray
    gap = Gap(one(1.22), one(0.0758), one(14.0), one(0.4))
    pitch, width = float(gap.pitch), float(gap.width)
    for angle, speed, expected in [
        (0.3 * width, 2.0, 0.2 * width),
        (0.7 * width, 2.0, 0.3 * width),
        (0.7 * width, -2.0, 0.2 * width),
        (0.3 * width, -2.0, 0.3 * width),
        (width + 5 * pitch, 1.0, pitch - width),
        (-0.1 * pitch, 1.0, 0.1 * pitch),
    ]:
        found = angle_to_edge(gap, one(angle), one(speed))
        np.testing.assert_allclose(found, expected, rtol=1e-7)
    time = time_to_edge(one(0.3), one(-0.2), one(-0.5))  # speeding up backwards
    np.testing.assert_allclose(0.2 * time + 0.25 * time**2, 0.3, rtol=1e-12)
    assert time_to_edge(one(0.3), one(0.2), one(-0.5)) == np.inf  # turns round before
    assert np.isfinite(jax.grad(lambda v: time_to_edge(one(0.3), v, one(0.0)))(0.7))


@pytest.mark.full  # in sweeps: test_sweep, test_one_evaluation
def test_fixed_steps_agree_with_adaptive_ones():
    ts = jnp.linspace(0, 0.1, 51)
    drive = torques([0.1, 0.5, -0.25])
    rigs = [
        machine(ORTHOGONAL, roundness=eta, contact_damping=c) for eta, c in [(0.3, 0.0), (0.5, 9e3)]
    ]
    stacked = jax.tree.map(lambda *x: jnp.stack(x), *rigs)
    many = simulate_many(stacked, drive, ts)
    for i, rig in enumerate(rigs):
        single = simulate(rig, drive, ts)
        run = jax.tree.map(lambda x, i=i: x[i], many)
        assert (
            max(worst(run, single, ("theta", "Omega", "dR")).values()) < 1e-3
        )  # no sample is spared the kinks inside its step
        assert int(run.status) == 0


def rigs_of_many_laws():
    """Four unlike wheels, contacts that stiffen, play and a wheel out of true: drawn designs."""
    rng = np.random.default_rng(7)
    ts, drive = jnp.linspace(0, 0.1, 51), torques([0.1, 0.3, -0.2, 0.05])
    turn = np.pi / 2 * np.arange(4) + rng.uniform(-0.2, 0.2, 4)
    low = rng.uniform(0.5, 0.9, 4)
    normals = np.stack([np.cos(turn) * np.cos(low), np.sin(turn) * np.cos(low), np.sin(low)], 1)
    layout = normals, np.stack([-np.sin(turn), np.cos(turn), 0 * turn], 1)

    def made(eta, stiffness):
        rig = machine(layout, roundness=eta, contact_stiffness=stiffness)
        rig = rig.add(laws.ContactHertz(), "all").add(laws.MountBacklash(jnp.asarray(1e-6)), "w2")
        return rig.add(laws.WheelRunout(jnp.asarray(3e-5), jnp.asarray(0.4)), "w3")

    rigs = [made(eta, K) for eta, K in rng.uniform((0.3, 1e5), (0.5, 2e5), (9, 2))]
    arrays, static = eqx.partition(rigs, eqx.is_array)
    stacked = eqx.combine(jax.tree.map(lambda *x: jnp.stack(x), *arrays), static[0])
    return rigs, stacked, drive, ts


def test_runge_kutta_steps_are_for_rigs_whose_fastest_mode_they_follow():
    rigs, stacked, drive, ts = rigs_of_many_laws()
    assert fixed_methods(rigs, 2e-3) == ("runge-kutta", "exponential")
    assert fixed_methods([rigs[0], machine(contact_damping=9e3)], 2e-3) == ("exponential",)
    with pytest.raises(ValueError, match=r"must be one of .*runge-kutta"):
        simulate_many(stacked, drive, ts, method="euler")


def test_many_runs_refuse_what_does_not_fit():
    """Uneven or falling times and no step at all went through without a word."""
    rigs, stacked, drive, ts = rigs_of_many_laws()
    n, needs = rigs[0].size, "`rigs` must be a `Rig` of which every number has one more axis"
    for change, says in (
        ({"rigs": rigs[0]}, needs),
        ({"rigs": rigs}, needs),
        ({"drive": speeds(np.ones(n))}, "`drive` must be motor torques, as `torques` makes them"),
        ({"drive": torques(np.ones(n + 1))}, f"the drive has {n + 1} wheels, but the rig has {n}"),
        ({"ts": ts**2}, "`ts` must be two times or more at even steps"),
        ({"ts": ts[:1]}, "`ts` must be two times or more at even steps"),
        ({"ts": ts[::-1]}, "`ts` must be finite and increase"),
        ({"substeps": 0}, "`substeps` must be a whole number of 1 and above, but is 0"),
        ({"substeps": 1.5}, "`substeps` must be a whole number of 1 and above, but is 1.5"),
    ):
        with pytest.raises(InputError, match=says):
            simulate_many(**({"rigs": stacked, "drive": drive, "ts": ts} | change))


@pytest.mark.full  # in the gate drawn rigs, by the method that a study chooses: test_one_evaluation
def test_runge_kutta_steps_of_many_rigs_agree_with_single_adaptive_runs():
    rigs, stacked, drive, ts = rigs_of_many_laws()
    many = simulate_many(stacked, drive, ts, substeps=32)
    assert many.method == "fixed runge-kutta"  # a quarter of a radian of the fastest mode a step
    for i in (0, 4, 8):
        single = simulate(rigs[i], drive, ts)
        run = jax.tree.map(lambda x, i=i: x[i], many)
        assert max(worst(run, single, ("theta", "Omega", "dR")).values()) < 1e-4
        assert int(run.status) == 0


@pytest.mark.full
def test_runge_kutta_steps_are_chosen_in_a_traced_function():
    _, stacked, drive, ts = rigs_of_many_laws()
    many = simulate_many(stacked, drive, ts, substeps=32)

    def inside(x):  # the numbers are known all the same
        return x * simulate_many(stacked, drive, ts, substeps=32).dR

    assert np.abs(jax.jit(inside)(1.0) - many.dR).max() < 1e-4 * np.abs(many.dR).max()
