"""The modal core against the general closed form: random rigs of every class."""

import contextlib
import sys

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compilations import counted
from machines import ANY_SPEEDS, ORTHOGONAL, machine, operating_at
from seeds import drawn_anew
from tiers import tiered

from omnijax import _programs, laws
from omnijax.simulation import (
    BULK_METRICS,
    Operating,
    figures_obstacle,
    modal_figures,
    modal_obstacle,
    propagate,
    speeds,
)
from omnijax.simulation._exact import forced_system
from omnijax.simulation._modal import batch as _batch
from omnijax.simulation._modal.arithmetic import rows
from omnijax.simulation._modal.batch import SIZES, _size, effort_for
from omnijax.vibration import METRICS, evaluate, run_metrics

pytestmark = [pytest.mark.long, pytest.mark.brief, ANY_SPEEDS]

DURATION, STEP = 0.4, 0.002


def cone(rng, n: int, skew: float = 0.15):
    """n wheels around the sphere in a layout without symmetry."""
    around = 2 * np.pi * np.arange(n) / n + skew * rng.uniform(-1, 1, n)
    tilt = 0.8 + skew * rng.uniform(-1, 1, n)
    normal = np.stack(
        [-np.sin(tilt) * np.cos(around), -np.sin(tilt) * np.sin(around), np.cos(tilt)], axis=1
    )
    return normal, np.stack([-np.sin(around), np.cos(around), 0 * around], axis=1)


def mixed(rig):
    profiles = (laws.HalfSine(), laws.GatedSine(), laws.ContinuousSine(), laws.Rollers())
    return eqx.tree_at(lambda r: r.profiles, rig, profiles[: rig.size])


def hidden(rig):
    """Runout, a damaged roller, a contact that relaxes, a floor that shakes."""
    rig = rig.add(laws.WheelRunout(jnp.asarray(4e-5), jnp.asarray(0.7)), "w2")
    rig = rig.add(laws.DamagedRoller(jnp.asarray(3.0), jnp.asarray(0.6)), "w1")
    rig = rig.add(laws.ContactRelaxation(jnp.asarray(5e4), jnp.asarray(0.03)), "w1")
    floor = laws.FloorVibration(*map(jnp.asarray, (0.4, 7.0, 0.3)), jnp.array([0.2, 1.0, 0.4]))
    return rig.add(floor, "platform")


def kinds(rng):
    """(name, rig, variant) of every class that the core takes."""
    alike = {"roundness": 0.5, "contact_stiffness": 2e5, "contact_damping": 150.0, "mass": 0.25}
    alike |= {"mount_stiffness": 1e6, "mount_damping": 60.0, "closure_stiffness": 2e4}
    small = {"roundness": 0.0, "radius": 0.02}
    return {
        "orthogonal, unlike": (machine(ORTHOGONAL), "coupled"),
        "tripod, alike": (machine(cone(rng, 3, 0.0), **alike), "coupled"),
        "tripod, undamped": (
            machine(cone(rng, 3), contact_damping=0.0, mount_damping=0.0),
            "coupled",
        ),
        "orthogonal, stiff": (machine(ORTHOGONAL, contact_damping=20000.0), "coupled"),
        "four, mixed": (mixed(machine(cone(rng, 4))), "coupled"),
        "three, hidden effects": (hidden(machine(cone(rng, 3))), "coupled"),
        "two, paper": (machine(cone(rng, 2)), "paper"),
        "two, no edges": (machine(cone(rng, 2), profile=laws.ContinuousSine()), "paper"),
        "round": (machine(cone(rng, 3), **small), "coupled"),
    }


RNG = np.random.default_rng(16)
KINDS = kinds(RNG)


def points_of(rig, rng, count=3, still=True):
    """Speeds (one wheel at rest, one backwards), forces and start angles of some designs."""
    n = rig.size
    speed = rng.uniform(0.3, 12.0, (count, n)) * rng.choice([-1.0, 1.0], (count, n))
    if still:
        speed[0, 0] = 0.0
    return np.concatenate(
        [speed, rng.normal(0, 20.0, (count, 3)), rng.uniform(-4, 4, (count, n))], 1
    )


def maker(rig):
    return eqx.Partial(operating_at, rig)


# the profiles and effects of two are those of test_one_evaluation, in every quantity; the others
# are asked for their peaks below
DEAR = ("four, mixed", "three, hidden effects", "two, paper", "two, no edges", "tripod, alike")
DEAR += ("tripod, undamped",)


@pytest.mark.parametrize("name", tiered(KINDS, (*DEAR, "round").__contains__))
def test_figures_are_those_of_propagated_runs(name):
    rig, model = KINDS[name]
    rows = points_of(rig, np.random.default_rng(len(name)), count=2)
    assert modal_obstacle(rig, model) is None
    found = modal_figures(maker(rig), rows, duration=DURATION, step=STEP, model=model)
    ts = jnp.linspace(0, DURATION, round(DURATION / STEP) + 1)
    names = tuple(METRICS)
    every = run_metrics(maker(rig), rows, names, duration=DURATION, step=STEP, model=model)
    for row, values, normal, slip, metrics in zip(
        rows, found.values, found.normal, found.slip, every.values, strict=True
    ):
        n = rig.size
        drive = speeds(row[:n], row[n : n + 3], row[n + 3 :])
        run = propagate(rig, drive, ts, model=model)
        expected = evaluate(run, rig, names)
        np.testing.assert_allclose(
            values, [expected["rms"], expected["peak"]], rtol=1e-9, atol=1e-15
        )
        np.testing.assert_allclose(metrics, list(expected.values()), rtol=2e-8, atol=1e-15)
        for bound, margin in ((normal, "lift_off_margin"), (slip, "slip_margin")):
            exact = expected[margin]
            assert np.sign(bound) == np.sign(exact)
            assert bound <= exact + 1e-6 * abs(exact)


@pytest.mark.parametrize("name", tiered(KINDS, (*DEAR[:4], "tripod, alike").__contains__))
def test_peaks_of_few_samples_are_those_of_propagated_runs(name):
    """Several edges between two samples, and runs whose first samples are the largest."""
    rig, model = KINDS[name]
    n, rng = rig.size, drawn_anew(name)
    rows = points_of(rig, rng, count=64)
    for duration, step in ((1.0, 0.02), (1.5, 0.15)):
        peaks = modal_figures(maker(rig), rows, duration=duration, step=step, model=model).values
        for i in rng.choice(64, 3, replace=False):
            ts = step * jnp.arange(round(duration / step) + 1)
            drive = speeds(rows[i, :n], rows[i, n : n + 3], rows[i, n + 3 :])
            run = propagate(rig, drive, ts, model=model)
            expected = evaluate(run, rig, ("rms", "peak"))
            np.testing.assert_allclose(peaks[i], list(expected.values()), rtol=1e-9, atol=1e-15)


@pytest.mark.full
@pytest.mark.parametrize("gradient", [False, True])
def test_the_way_of_accelerators_gives_the_figures_of_a_cpu(gradient, monkeypatch):
    """Poles in step, one group of all designs, barriers in place of branches, wider batches."""
    rng = drawn_anew("accelerator")
    rig = machine(cone(rng, 3), contact_damping=10 ** rng.uniform(0, 4))
    rows = points_of(rig, rng, count=SIZES[0] + 6)

    def figures():
        return modal_figures(maker(rig), rows, duration=DURATION, step=STEP, gradient=gradient)

    expected = figures()
    monkeypatch.setenv("OMNIJAX_KEEP_PROGRAMS", "0")
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    sizes = []
    monkeypatch.setattr(_batch, "_size", lambda *a: sizes.append(size := _size(*a)) or size)
    ours = figures()
    assert sizes == [SIZES[-1]]
    pairs = [(ours.values, expected.values), (ours.slopes, expected.slopes)]
    for x, y in pairs[: 1 + gradient]:
        scale = np.abs(y).max(axis=0)
        np.testing.assert_allclose(x / scale, y / scale, atol=1e-10)
    for x, y in ((ours.normal, expected.normal), (ours.slip, expected.slip)):
        np.testing.assert_array_equal(np.sign(x), np.sign(y))
    assert np.all(ours.held) and np.all(expected.held)


def test_statuses_are_those_of_propagated_runs():
    """Preloads and friction between those at which drawn designs lift off or slip."""
    rig, model = KINDS["tripod, undamped"]
    rows = points_of(rig, np.random.default_rng(7), count=8) * ([0.3] * 3 + [0.2] * 3 + [1.0] * 3)
    ts = jnp.linspace(0, DURATION, round(DURATION / STEP) + 1)
    runs = [propagate(rig, speeds(r[:3], r[3:6], r[6:]), ts, model=model) for r in rows]
    normal = np.array([run.normal_force for run in runs]) - np.asarray(rig.wheels.closure.preload)
    drive = np.abs(np.array([run.drive_force for run in runs]))
    seen = set()
    for preload in np.quantile(-normal.min(axis=(1, 2)), [0.4, 0.8]):
        ratio = np.median((drive / np.abs(normal + preload)).max(axis=(1, 2)))
        for friction in (0.9, 0.3 * ratio):
            held = eqx.tree_at(
                lambda r: (r.wheels.closure.preload, r.wheels.contact.friction),
                rig,
                (jnp.full(3, preload), jnp.full(3, friction)),
            )
            found = modal_figures(maker(held), rows, duration=DURATION, step=STEP, model=model)
            lifted = (normal + preload).min(axis=(1, 2)) <= 0
            slipped = (friction * (normal + preload) - drive).min(axis=(1, 2)) < 0
            np.testing.assert_array_equal(found.normal <= 0, lifted)
            np.testing.assert_array_equal((found.slip < 0)[~lifted], slipped[~lifted])
            seen |= {"lift"} if lifted.any() else set()
            seen |= {"slip" if bad else "ok" for bad in slipped[~lifted]}
    assert seen == {"lift", "slip", "ok"}


def varied(rig):
    """row -> the design with that many times some numbers of `rig`, of one wheel and of all."""
    n = rig.size
    base = points_of(rig, np.random.default_rng(3), count=1, still=False)[0]

    def make(factor):
        changed = eqx.tree_at(
            lambda r: (
                r.wheels.roundness,
                r.wheels.contact.stiffness,
                r.wheels.contact.damping,
                r.platform.mass,
            ),
            rig,
            (
                rig.wheels.roundness.at[1].multiply(factor[0]),
                rig.wheels.contact.stiffness.at[0].multiply(factor[1]),
                rig.wheels.contact.damping * factor[2],
                rig.platform.mass * factor[3],
            ),
        )
        speed, angle = jnp.asarray(base[:n]), jnp.asarray(base[n + 3 :])
        return Operating(
            changed,
            speed.at[0].multiply(factor[4]),
            jnp.asarray(base[n : n + 3]),
            angle.at[1].multiply(factor[5]),
        )

    return make


@pytest.mark.full
@pytest.mark.parametrize("name", ["tripod, alike"])
def test_gradients_are_the_slopes_between_designs(name):
    """Six numbers, at equal wheels too, whose poles are exactly degenerate; sixth order."""
    rig, model = KINDS[name]
    rows, h = np.ones((2, 6)), 2e-5  # small: an edge that passes a sample is a kink
    rows[1] = [0.9, 1.1, 0.7, 1.2, 0.9, 1.1]
    shifts = np.array([-3, -2, -1, 1, 2, 3])
    near = (rows[:, None, None] + h * shifts[:, None] * np.eye(6)[:, None]).reshape(-1, 6)
    settings = {"duration": DURATION, "step": STEP, "model": model, "gradient": True}
    found = modal_figures(varied(rig), np.concatenate([rows, near]), **settings)
    values = found.values[2:].reshape(2, 6, 6, 2)
    weights = np.array([-1, 9, -45, 45, -9, 1]) / (60 * h)
    expected = np.einsum("idkm,k->imd", values, weights)
    scale = np.abs(expected).max(axis=2, keepdims=True)
    np.testing.assert_allclose(found.slopes[:2] / scale, expected / scale, rtol=0, atol=1e-5)


def poles_of(make):
    """row -> the poles of the design, rad/s."""

    @jax.jit
    def matrix(row):
        at = make(row)
        return forced_system(at.rig, "coupled", at.speeds, tuple(range(at.rig.size))).A

    return lambda row: np.linalg.eigvals(np.asarray(matrix(row)))


def critical(make, row):
    """The row with that many times its contacts' damping at which two poles meet."""
    poles = poles_of(make)

    def real(share) -> int:
        value = poles(row * np.array([1, 1, share, 1, 1, 1]))
        return int(np.sum(np.abs(value.imag) < 1e-9 * np.abs(value).max()))

    shares = np.geomspace(0.1, 300, 30)
    count = [real(share) for share in shares]
    i = next(i for i in range(29) if count[i] < count[i + 1])
    low, high = shares[i : i + 2]
    while low < (middle := (low + high) / 2) < high:
        low, high = (middle, high) if real(middle) == count[i] else (low, middle)
    return row * np.array([1, 1, high, 1, 1, 1])


NEAR = np.array([0.0, 1e-12, -1e-9, 1e-7, -1e-5, 1e-4])  # of a number, where poles coincide
WIDE = 2e-3 * np.array([-4, -3, -2, -1, 1, 2, 3, 4])  # and where they do not


def beside(make, row, figures):
    """Errors of values and slopes by the damping at `NEAR` distances from poles that coincide.

    Against the polynomial through what `figures` gives at `WIDE` ones; errors of slopes as shares
    of the largest one by any number.
    """
    distance = np.concatenate([NEAR, WIDE])
    rows = critical(make, row) * (1 + distance[:, None] * (np.arange(6) == 2))
    got = figures(make, rows)
    own, wide = np.split(got.values, [len(NEAR)])
    fit = np.polynomial.Polynomial.fit
    values = np.stack([fit(WIDE, y, 7)(NEAR) for y in wide.T], 1)
    slopes = np.stack([fit(WIDE, y, 7)(NEAR) for y in got.slopes[len(NEAR) :, :, 2].T], 1)
    rises = np.stack([fit(WIDE, y, 7).deriv()(0.0) for y in wide.T]) / rows[0, 2]
    size = np.abs(got.slopes[len(NEAR) :]).max(axis=(0, 2))
    shares = (got.slopes[: len(NEAR), :, 2] - slopes) / size
    return own / values - 1, shares, (rises - got.slopes[0, :, 2]) / size


def alike_machine(rng, **changes):
    """Three equal wheels around the sphere, of drawn stiffness and mass."""
    drawn = {
        "roundness": rng.uniform(0.3, 0.6),
        "contact_stiffness": 2e5 * rng.uniform(0.5, 2),
        "mass": rng.uniform(0.15, 0.4),
        "mount_stiffness": 1e6 * rng.uniform(0.5, 2),
    }
    fixed = {"contact_damping": 150.0, "mount_damping": 60.0, "closure_stiffness": 2e4}
    return machine(cone(rng, 3, 0.0), **drawn | fixed | changes)


def test_figures_and_gradients_where_poles_meet():
    """Critical damping of drawn rigs and distances down to none from it.

    A peak that another sample or oscillation takes over is a kink: those count by their median.
    """
    rng = drawn_anew("damping at which poles meet")
    settings = {"duration": DURATION, "step": STEP, "gradient": True}
    make = varied(alike_machine(rng))

    def figures(make, rows):
        return modal_figures(make, rows, **settings)

    every = [beside(make, row, figures) for row in rng.uniform(0.8, 1.2, (5, 6))]
    for errors, least in zip(zip(*every, strict=True), (1e-10, 1e-7, 1e-7), strict=True):
        sizes = np.abs(errors)
        assert sizes[..., 0].max() < least, sizes
        assert np.median(sizes[..., 1], axis=0).max() < least, sizes


def damped_machine(rng):
    """(equal wheels with dampers drawn over two decades as `varied`, a row where poles meet)."""
    while True:
        changes = {"mount_damping": 10 ** rng.uniform(1.5, 3.5), "contact_damping": 1000.0}
        changes["mount_stiffness"] = 10 ** rng.uniform(4.5, 6.5)
        make = varied(alike_machine(rng, **changes))
        with contextlib.suppress(StopIteration):
            return make, critical(make, np.ones(6))


@pytest.mark.full  # in the gate beside such dampings, above, and undamped rigs against runs, below
def test_figures_where_poles_meet_are_those_of_runs():
    """Dampers that hold the slow poles by their differences: values were 1e-4, slopes 12 % off."""
    rng, off = drawn_anew("dampers at which poles meet"), []
    near, h = np.array([0.0, 1e-9, -1e-5, 5e-4, -1e-3]), 1e-3
    shifts, weights = np.array([-3, -2, -1, 1, 2, 3]), np.array([-1, 9, -45, 45, -9, 1]) / 60
    ts = jnp.linspace(0, DURATION, round(DURATION / STEP) + 1)
    for _ in range(3):
        make, row = damped_machine(rng)
        damping = np.arange(6) == 2

        def run(distance, make=make, row=row, damping=damping):
            at = make(row * (1 + distance * damping))
            gone = propagate(at.rig, speeds(at.speeds, at.force, at.angles), ts)
            return np.array(list(evaluate(gone, at.rig, ("rms", "peak")).values()))

        rows = row * (1 + near[:, None] * damping)
        got = modal_figures(make, rows, duration=DURATION, step=STEP, gradient=True)
        expected = np.array([run(distance) for distance in near])
        np.testing.assert_allclose(got.values, expected, rtol=3e-9)
        rise = weights @ [run(near[3] + h * k)[0] for k in shifts] / (h * row[2])
        off.append((got.slopes[3, 0, 2] - rise) / np.abs(got.slopes[3, 0]).max())
    assert np.abs(off).max() < 1e-6


@pytest.mark.full  # in the gate those that meet, above
def test_poles_of_unlike_wheels_that_do_not_meet_are_left_alone():
    """Light parts beside heavy ones make vectors as unlike as poles that meet do.

    They were moved as if they did: a peak of 1e130 m with status ok for a wheel of 10 mg.
    """
    rng, model = drawn_anew("very unlike wheels"), "coupled"
    base = machine(cone(rng, 3), mass=0.3)
    leaves = _parts_of_wheels(base)
    factors = 10 ** rng.uniform(-2.5, 2.5, (24, len(leaves), 3))
    factors[:4] = 1.0
    factors[:4, 0, 0] = [1e-3, 3e-4, 1e-4, 3e-5]  # mass of one wheel
    speed = rng.uniform(0.3, 2.0, 3)

    def make(row):
        parts = tuple(x * f for x, f in zip(leaves, row.reshape(len(leaves), 3), strict=True))
        rig = eqx.tree_at(_parts_of_wheels, base, parts)
        return Operating(rig, jnp.asarray(speed), jnp.zeros(3), jnp.zeros(3))

    rows = factors.reshape(len(factors), -1)
    got = modal_figures(make, rows, duration=DURATION, step=STEP, model=model).values
    ts = jnp.linspace(0, DURATION, round(DURATION / STEP) + 1)
    for row, values in zip(rows, got, strict=True):
        at = make(row)
        run = propagate(at.rig, speeds(at.speeds), ts)
        expected = np.array(list(evaluate(run, at.rig, ("rms", "peak")).values()))
        np.testing.assert_allclose(values, expected, rtol=1e-6)


def _parts_of_wheels(rig):
    w = rig.wheels
    return (w.mass, w.contact.stiffness, w.contact.damping, w.mount.stiffness, w.mount.damping)


@pytest.mark.full
def test_runs_where_poles_meet_are_those_gathered_on_the_way():
    """RMS, peak and slopes, in a batch with designs whose poles do not meet."""
    rng = drawn_anew("damping at which poles meet")
    make = varied(hidden(machine(cone(rng, 3))))
    rows = rng.uniform(0.8, 1.2, (8, 6))
    rows[:4] = [critical(make, row) for row in rows[:4]]
    rows[2:4] *= 1 + 1e-9 * (np.arange(6) == 2)
    settings = {"duration": DURATION, "step": STEP, "gradient": True}
    own = modal_figures(make, rows, **settings)
    every = run_metrics(make, rows, BULK_METRICS, **settings)
    np.testing.assert_allclose(own.values, every.values, rtol=1e-10)
    size = np.abs(every.slopes).max(axis=2, keepdims=True)
    assert np.abs((own.slopes - every.slopes) / size).max() < 1e-8


def test_undamped_rigs_driven_at_a_natural_frequency():
    """Values as those of propagated runs, slopes by the speed as between designs."""
    rng = drawn_anew("natural frequencies")
    make, h = varied(alike_machine(rng, mount_damping=0.0)), 3e-6
    row = rng.uniform(0.8, 1.2, 6) * (np.arange(6) != 2)
    at = make(row)
    rate = 2 * np.pi / at.rig.gaps.width[0] * abs(at.speeds[0])
    natural = rng.choice(np.abs(poles_of(make)(row).imag))
    distance = np.array([0.0, 1e-15, -1e-12, 1e-9, -1e-7, 1e-6, -2 * h, -h, h, 2 * h])
    rows = row * np.where(np.arange(6) == 4, natural / rate * (1 + distance[:, None]), 1.0)
    settings = {"duration": DURATION, "step": STEP, "gradient": True}
    got = modal_figures(make, rows, **settings)
    ts = jnp.linspace(0, DURATION, round(DURATION / STEP) + 1)
    for row, values in zip(rows[:6], got.values, strict=False):
        at = make(row)
        run = propagate(at.rig, speeds(at.speeds, at.force, at.angles), ts)
        expected = evaluate(run, at.rig, ("rms", "peak"))
        np.testing.assert_allclose(values, list(expected.values()), rtol=1e-8)
    rise = np.array([1, -8, 8, -1]) @ got.values[-4:] / (12 * h * rows[0, 4])
    size = np.abs(got.slopes[-1]).max(axis=1)
    assert np.abs((got.slopes[:4, :, 4] - rise) / size).max() < 1e-4


@pytest.mark.full  # in the gate their values, above; a search by slopes: test_design_in_bulk
@pytest.mark.parametrize("count", [1, 3])
def test_metrics_read_from_samples(count):
    """Slopes along a drawn direction are those between designs, of unlike wheels, and with effects.

    RMS and peak are those that are gathered on the way; of more than one group.
    """
    rng, h, some = drawn_anew("metrics read from samples"), 1e-6, 4
    rig = machine(cone(rng, 3))
    rig = rig if count == 1 else hidden(rig)
    rows, along = rng.uniform(0.8, 1.2, (70, 6)), rng.normal(size=(some, 6))
    rows[-2 * some :] = np.concatenate([rows[:some] + h * along, rows[:some] - h * along])
    names = (
        "rms",
        "peak",
        *rng.choice([n for n in METRICS if n not in BULK_METRICS], count, False).tolist(),
    )
    settings = {"duration": DURATION, "step": STEP, "gradient": True}
    own, every = (
        f(varied(rig), rows, names[:end], **settings)
        for f, end in ((modal_figures, 2), (run_metrics, None))
    )
    ahead, behind = np.split(every.values[-2 * some :], 2)
    size = np.abs(every.slopes).max(axis=2)
    assert (size > 0).all()
    found = np.einsum("bmd,bd->bm", every.slopes[:some], along)
    error = np.abs(found - (ahead - behind) / (2 * h)) / size[:some]
    assert np.median(error, axis=0).max() < 1e-5, (names, error)

    np.testing.assert_allclose(own.values, every.values[:, :2], rtol=1e-10)
    difference = (own.slopes - every.slopes[:, :2]) / size[:, :2, None]
    assert np.abs(difference).max() < 1e-8
    np.testing.assert_array_equal(own.normal <= 0, every.normal <= 0)
    np.testing.assert_array_equal(own.held, every.held)


def test_a_design_that_is_no_number_leaves_the_others_of_its_batch_alone():
    make = varied(KINDS["tripod, alike"][0])
    rows = drawn_anew("no number").uniform(0.7, 1.4, (8, 6))
    broken = rows.copy()
    broken[3, 1] = np.nan  # a stiffness
    settings = {"duration": DURATION, "step": STEP, "gradient": True}  # a program of those above
    every, some = (modal_figures(make, x, **settings) for x in (rows, broken))
    assert np.all(np.isnan(some.values[3]))  # a figure of 0 would be one that is right
    others = np.arange(8) != 3
    # one that has no poles in closed form sends its batch to LAPACK: equal to rounding
    np.testing.assert_allclose(some.values[others], every.values[others], rtol=1e-10)
    size = np.abs(every.slopes[others]).max(axis=2, keepdims=True)
    np.testing.assert_allclose(some.slopes[others] / size, every.slopes[others] / size, atol=1e-8)
    assert np.all(every.values > 0)


def test_obstacles_are_said():
    rig = machine(ORTHOGONAL)
    assert figures_obstacle(rig, "coupled", ("rms", "weighted_acceleration")) == (
        "the modal core does not give weighted_acceleration"
    )
    dual = eqx.tree_at(lambda r: r.profiles, rig, (laws.DualRow(jnp.asarray(0.01)),) * 3)
    with pytest.raises(ValueError, match=r"no figures from the modal form: wheel w1's profile"):
        rows = points_of(dual, RNG)
        modal_figures(maker(dual), rows, duration=DURATION, step=STEP)


def test_other_numbers_and_another_rig_of_as_many_wheels_compile_nothing():
    settings = {"duration": DURATION, "step": STEP}
    first, second = (KINDS[name][0] for name in ("round", "tripod, undamped"))
    modal_figures(maker(first), points_of(first, np.random.default_rng(1)), **settings)
    compiled = counted()
    rows = points_of(second, np.random.default_rng(2), count=40)
    modal_figures(maker(second), rows, duration=0.3, step=0.003)
    rows[:, 1] = 0.0  # a wheel that stands still in every design
    modal_figures(maker(second), rows, duration=0.3, step=0.003)
    assert compiled == []
    jax.jit(lambda x: x + len(compiled))(jnp.ones(7))  # what does compile is counted
    assert compiled


def test_runs_of_other_rates_share_the_program_of_their_samples():
    """What is read from the samples is a small program for each number of them."""
    rig, rows = KINDS["round"][0], points_of(KINDS["round"][0], drawn_anew("rates"))
    for i, rate in enumerate((1000, 700)):
        compiled = counted()
        asked = {"duration": 1.0, "step": 1 / rate}
        figures = run_metrics(maker(rig), rows, ("sphere_acceleration_rms",), **asked)
        assert len(compiled) <= (1 if i else np.inf) and np.all(np.isfinite(figures.values))


@pytest.mark.parametrize("total", tiered([1, 2000, 1_000_000], (2000).__ne__))
def test_programs_for_few_and_for_many_give_the_same_figures(total, monkeypatch, tmp_path):
    """They are other code of one formula; the least optimised one with gradients.

    Beside a program that is kept stands one that is not, for another number of designs.
    """
    if len(jax.devices()) > 1 or not sys.platform.startswith("linux"):
        pytest.skip("programs are kept for one CPU device under Linux")
    monkeypatch.setenv("OMNIJAX_CACHE_DIR", str(tmp_path))
    name, gradient = ("two, paper", True) if total == 1 else ("round", False)
    rig, model = KINDS[name]
    rows = points_of(rig, np.random.default_rng(total), count=64 if gradient else 3, still=False)
    makes = []

    def figures(keep: str, total: int):
        monkeypatch.setenv("OMNIJAX_KEEP_PROGRAMS", keep)
        return modal_figures(
            maker(rig), rows, duration=DURATION, step=STEP, model=model, gradient=gradient,
            total=total,
        )  # fmt: skip

    monkeypatch.setattr(_programs, "_make", _told(_programs._make, makes))
    few, many = figures("0", 2000 if total == 1 else 1), figures("1", total)
    assert {effort for *_, effort in makes} == {effort_for(max(total, len(rows)))}
    for a, b in zip(few, many, strict=True):
        if a is not None:
            scale = np.abs(a).max() if a.dtype == float else 0
            np.testing.assert_allclose(a, b, rtol=1e-10, atol=1e-13 * scale)


def _told(make, calls: list):
    """`make`, which tells its arguments and keeps nothing."""

    def told(*args):
        calls.append(args)
        return make(*args)

    return told


@pytest.mark.parametrize(
    "index", [[], [0, 1, 2], [0, 1, 2, 0, 1, 2], [1, 2], [2], [2, 0, 0], [0, 1, 2, 0]]
)
def test_rows_are_those_of_an_index(index):
    """Whichever of them need no copy."""
    x = np.random.default_rng(0).normal(size=(2, 3, 4))
    np.testing.assert_array_equal(rows(jnp.asarray(x), index, 1), x[:, np.array(index, int)])


def test_wheels_that_leave_a_direction_free_are_an_obstacle():
    normal = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    rig = machine((normal, np.cross([[0.0, 0.0, 1.0]] * 3, normal)))
    reason = "the wheels do not hold the sphere in every direction"
    assert modal_obstacle(rig) == reason
    with pytest.raises(ValueError, match=reason):
        modal_figures(maker(rig), points_of(rig, RNG), duration=DURATION, step=STEP)
