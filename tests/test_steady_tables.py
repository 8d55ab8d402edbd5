"""Long runs of wheels with measured tables in the modal core, on machines drawn anew."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from drawn_rigs import any_table
from machines import ANY_SPEEDS, ORTHOGONAL, SKEW, machine, operating_at
from seeds import drawn_anew
from test_modal_tables import rows_of, scaled, tabled, with_effects
from tiers import tiered

from omnijax.simulation import modal_steady_obstacle
from omnijax.simulation._modal._long_run.curves import ModalCurves, TableCurves, values_at
from omnijax.simulation._modal._long_run.moments import Moments, moments_of
from omnijax.simulation._modal._long_run.pass_tables import along_tables, highest
from omnijax.simulation._modal._long_run.phases import PhaseCycle, spot_on
from omnijax.simulation._modal._long_run.table_wave import (
    TableWave,
    starts_of,
    table_level,
    table_line,
)
from omnijax.simulation._modal._poles import PolePairs
from omnijax.vibration import SteadyRun, long_run_metrics, steady_metric

pytestmark = [pytest.mark.long, ANY_SPEEDS]

FIGURES = ("rms", "peak", "slip_margin", "sphere_acceleration_rms")
POLES = {  # times the period
    "fast": (1.0, -20.0, 300.0),
    "faster": (0.0, -1e4, -2e6),
    "slow": (1.0, -1e-4, 1e-3),
    "undamped": (1.0, -1e-6, 47.0),
    "two real": (0.0, -0.3, -50.0),
    "near a harmonic": (1.0, -1e-3, 4 * np.pi),
}


GATE = ("fast", "slow")  # the others stay out of `make test`


def _wave(rng) -> TableWave:
    shape = any_table(rng, 14.0, 1.0)
    rho = shape.coefficients * jnp.array([1.0, 1.0, 2.0, 6.0])
    return TableWave(jnp.diff(shape.knots)[:, None, None], rho[:, :, None, None])


def _pairs(where: str, period: float) -> PolePairs:
    kind, l0, l1 = POLES[where]
    none = jnp.zeros((1, 1, 1))
    kind, l0, l1 = (jnp.full((1, 1, 1), x) for x in (kind, l0 / period, l1 / period))
    return PolePairs(kind, l0, l1, none, none, none, none)


def table_means(m: PolePairs, wave: TableWave) -> Moments:
    """Means over the period of a phase of tables alone."""
    return moments_of(m, PhaseCycle((), (), wave.period, wave))


def _levels(wave: TableWave, time):
    """rho and its slope at times within a period."""
    begin = np.asarray(wave.begin)[:, 0, 0]
    k = np.searchsorted(begin, time, side="right") - 1
    v, (a, b, c, d) = time - begin[k], np.asarray(wave.rho)[k, :, 0, 0].T
    return a + v * (b + v * (c / 2 + v * d / 6)), b + v * (c + v * d / 2)


def _nodes(wave: TableWave, parts: int):
    """Gauss nodes and weights of one period, on pieces on which rho is smooth."""
    node, weight = np.polynomial.legendre.leggauss(10)
    begin, length = np.asarray(wave.begin)[:, 0, 0], np.asarray(wave.duration)[:, 0, 0]
    half = np.repeat(length / parts / 2, parts)[:, None]
    first = (begin[:, None] + length[:, None] / parts * np.arange(parts)).reshape(-1, 1)
    return (first + half * (1 + node)).ravel(), (half * weight).ravel()


@pytest.mark.parametrize("where", tiered(POLES, lambda where: where not in GATE))
def test_means_are_those_of_sums_of_harmonics(where):
    """Of the work, by the Fourier series; of level, squares and a line by quadrature."""
    wave = _wave(drawn_anew(f"means of tables, {where}"))
    period = float(wave.period[0, 0])
    time, weight = _nodes(wave, 40)
    rho, slope = _levels(wave, time)
    weight = weight / period
    harmonics = 2 * np.pi / period * np.arange(1, 400)
    lines = np.exp(-1j * harmonics[:, None] * time) @ (weight * rho)
    level = weight @ rho
    means = table_means(_pairs(where, period), wave)
    kind, *poles = POLES[where]
    works = [float(x[0, 0, 0]) for x in means.work]
    if kind:
        poles, works = [complex(*poles)], [complex(*works)]
    for pole, work in zip(poles, works, strict=True):
        z = np.asarray(pole) / period
        both = 1 / (1j * harmonics - z) + 1 / (-1j * harmonics - z)
        expected = np.sum(np.abs(lines) ** 2 * both) - level**2 / z
        np.testing.assert_allclose(work, expected, rtol=1e-9)
    size = np.sqrt(weight @ rho**2)
    np.testing.assert_allclose(means.level, level, atol=1e-14 * size)
    np.testing.assert_allclose(table_level(wave), level, atol=1e-14 * size)
    np.testing.assert_allclose(means.square, weight @ rho**2, rtol=1e-12)
    turned = table_means(_pairs(where, period), wave.rates())
    np.testing.assert_allclose(turned.square, weight @ slope**2, rtol=1e-12)
    line = table_line(wave, jnp.full((1, 1), harmonics[1]))
    expected = lines[1].real, -lines[1].imag
    np.testing.assert_allclose(np.ravel(line), expected, atol=1e-12 * size)


@pytest.mark.parametrize("where", tiered(POLES, lambda where: where not in GATE))
def test_slopes_of_means_are_differences(where):
    """By poles, and by durations and cubics, those of poles that stay."""
    rng = drawn_anew(f"slopes of means of tables, {where}")
    wave = _wave(rng)
    m = _pairs(where, float(wave.period[0, 0]))
    along = jax.tree.map(lambda x: x * jnp.asarray(rng.normal(size=x.shape)), wave)

    def moved(h) -> TableWave:
        return jax.tree.map(lambda x, y: x + h * y, wave, along)

    def work(h):
        return jnp.stack(table_means(m, moved(h)).work)

    h = 1e-6
    near, far = ((work(x) - work(-x)) / (2 * x) for x in (h, 2 * h))
    value, slope = jax.jvp(work, (0.0,), (1.0,))
    scale = np.linalg.norm(value) + np.linalg.norm(slope)
    np.testing.assert_allclose(slope / scale, (4 * near - far) / 3 / scale, atol=1e-6)


@pytest.mark.parametrize("where", tiered(POLES, lambda where: where not in GATE))
def test_outputs_come_back_after_a_period_and_their_top_is_found(where):
    """Of one pole: the pass over all pieces against samples that are close."""
    wave = _wave(drawn_anew(f"tops of tables, {where}"))
    period = float(wave.period[0, 0])
    m = _pairs(where, period)
    kind, l0, l1 = (x[None] for x in (m.kind, m.l0, m.l1))  # (r, q, s, c)
    start = starts_of(m, wave)
    one, none = jnp.ones_like(kind), jnp.zeros((1, 1, 1))
    pole = jnp.abs(l0) + jnp.abs(l1)
    weight = pole, jnp.where(kind > 0, 0.0, pole)
    start = start[0][:, None], start[1][:, None]
    table = TableCurves(wave, start, weight, none + 0.3, none)
    f = ModalCurves(kind, (l0, l1), (0 * one, 0 * one), PhaseCycle((), (), wave.period, wave),
                    (), (), (), table)  # fmt: skip

    @jax.jit
    def at(time):
        return jax.vmap(lambda t: values_at(f, spot_on(f.cycle, t, t), 2)[0][0])(
            time[:, None, None]
        )

    time = jnp.linspace(0, period, 200_001)
    x = np.asarray(at(time)).ravel()
    size = np.abs(x).max()
    np.testing.assert_allclose(x[0], x[-1], atol=1e-9 * size)

    def gather(top, interval):
        return jnp.maximum(top, highest(interval, lambda x: x)[0])

    top = jax.jit(lambda: along_tables(f, gather, jnp.full((1, 1, 1), -jnp.inf)))()
    np.testing.assert_allclose(top.ravel(), x.max(), atol=3e-4 * size)


def _drawn(kind: str, rng):
    if kind == "four":
        return with_effects(tabled(rng, 4), rng)
    rig = machine(ORTHOGONAL if kind == "orthogonal" else SKEW)
    measured = [any_table(rng, 14.0, 2e-4) for _ in range(1 if kind == "orthogonal" else 3)]
    return eqx.tree_at(lambda r: r.profiles, rig, (*measured, *rig.profiles[len(measured) :]))


@pytest.mark.parametrize("kind", tiered(["orthogonal", "tripod", "four"], "orthogonal".__ne__))
def test_figures_are_those_of_each_design(kind):
    """Backwards and at rest too; several tables, or one beside gaps, runout and relaxation.

    A design without numbers has none, and takes none from the others.
    """
    rng = drawn_anew(f"long runs of tables, {kind}")
    rig = _drawn(kind, rng)
    assert modal_steady_obstacle(rig) is None
    rows = rows_of(rng, rig.size, 3, still=True)
    lost = np.where(np.arange(rows.shape[1]) == 0, np.nan, rows[:1])
    every = np.concatenate([rows, lost])
    *values, none = long_run_metrics(eqx.Partial(operating_at, rig), every, FIGURES).values
    assert np.isnan(none).all()

    @jax.jit
    def one(row):
        at = operating_at(rig, row)
        run = SteadyRun(at.rig, at.speeds, at.angles, "coupled", force=at.force)
        return jnp.stack([steady_metric(run, name) for name in FIGURES])

    for row, got in zip(rows, values, strict=True):
        expected = np.asarray(one(row))
        np.testing.assert_allclose(got, expected, rtol=1e-6)
        np.testing.assert_allclose(got[[0, 3]], expected[[0, 3]], rtol=1e-9)


@pytest.mark.full
@pytest.mark.parametrize("names", [("rms",), ("peak", "slip_margin")])
def test_gradients_are_differences_of_figures(names):
    """By stiffness, damping, speeds, force and start angles."""
    rng = drawn_anew("gradients of long runs of tables")
    rig = _drawn("tripod", rng)
    rows = np.column_stack([np.ones((1, 2)), rows_of(rng, rig.size, 1)])
    make, h = eqx.Partial(scaled, rig), 1e-4

    def figures(rows):
        return long_run_metrics(make, rows, names).values

    exact = long_run_metrics(make, rows, names, gradient=True)
    assert exact.slopes is not None

    def slope(h):
        step = h * np.eye(rows.shape[1])
        up, down = np.split(figures(rows + np.concatenate([step, -step])), 2)
        return (up - down).T / (2 * h)

    expected = (4 * slope(h) - slope(2 * h)) / 3
    size = np.abs(expected).max(axis=1, keepdims=True)
    np.testing.assert_allclose(exact.slopes[0] / size, expected / size, atol=2e-6)
