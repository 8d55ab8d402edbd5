"""Extremes of the steady state against a dense search that shares no search with them."""

import importlib

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from machines import ORTHOGONAL, SKEW, machine
from seeds import drawn_anew
from tiers import more

from omnijax._compiling import quick_jit
from omnijax._root import root
from omnijax.laws import WheelRunout
from omnijax.simulation import steady_state
from omnijax.simulation._exact.expm import points, whole
from omnijax.simulation._steady.long_run import LongRun

pytestmark = pytest.mark.brief

FEW, RIGS = 4, 8  # in the gate, and in the whole suite
BITS = 13
WHOLE = more((ORTHOGONAL, RIGS), (SKEW, RIGS))


def _cases(layout, count=RIGS):
    """Rigs from soft and round to stiff and damped, wheels that turn either way, slow and fast."""
    random, rig = np.random.default_rng(11), machine(layout)
    for _ in range(count):
        values = [10 ** random.uniform(low, high, 3) for low, high in ((5, 6.7), (2, 4.3), (2, 3))]
        values.append(random.uniform(0.05, 0.95, 3))
        yield (
            eqx.tree_at(
                lambda r: (
                    r.wheels.contact.stiffness,
                    r.wheels.contact.damping,
                    r.wheels.mount.damping,
                    r.wheels.roundness,
                ),
                rig,
                tuple(map(jnp.asarray, values)),
            ),
            jnp.asarray(random.choice([-1, 1], 3) * 10 ** random.uniform(-1, 1, 3)),
        )


@eqx.filter_jit
def _curves(rig, speeds):
    """Curves of dR, prepared for 2^BITS places a piece."""
    return LongRun(rig, speeds, jnp.zeros(3), "coupled", BITS).curves("dR")


def _dense(rig, speeds) -> list[np.ndarray]:
    """dR of every signal on 2^BITS even places a piece, and at the pieces' ends."""
    out = []
    for curves in _curves(rig, speeds):
        for g in range(len(curves.starts)):
            values = []
            for k in np.flatnonzero(np.asarray(curves.cycles.width[g]) > 0):
                piece, start, rows = jax.tree.map(
                    lambda x, g=g, k=k: x[g, k],
                    (curves.cycles.pieces, curves.starts, curves.rows),
                )
                values += [_grid(piece, start, rows), rows @ whole(piece) @ start[:, None]]
            out.append(np.concatenate([np.asarray(v).T.reshape(-1, 3) for v in values]))
    return out


@jax.jit
def _grid(piece, start, rows):
    return rows @ points(piece, start, BITS)


def _longest(signals: list[np.ndarray]) -> float:
    """Largest length of a sum of one row of each signal: ascent from many directions."""
    longest = 0.0
    for start in np.random.default_rng(0).normal(size=(300, 3)):
        total, before = start, -1.0
        for _ in range(20):
            total = sum(x[np.argmax(x @ total)] for x in signals)
            if np.linalg.norm(total) <= before:
                break
            before = np.linalg.norm(total)
        longest = max(longest, before)
    return longest


@eqx.filter_jit
def _lean(rig, speeds):
    run = LongRun(rig, speeds, jnp.zeros(3), "coupled")
    high, low = run.extremes("dR")
    return jnp.concatenate([run.suprema("dR")[0][None], high, low])


@pytest.mark.parametrize("layout, count", [(SKEW, FEW), *WHOLE])
def test_extremes_are_those_of_a_dense_search(layout, count):
    """Refined ones lie above those of any grid, by the grid's coarseness at most."""
    for rig, speeds in _cases(layout, count):
        signals = _dense(rig, speeds)
        want = [_longest(signals), *sum(x.max(axis=0) for x in signals)]
        want += [*sum((-x).max(axis=0) for x in signals)]
        above = np.asarray(_lean(rig, speeds)) / np.array(want) - 1
        assert above[0] > -1e-5 and np.all(above[1:] > -1e-6), (rig, speeds)
        assert np.all(above < 1e-5), (rig, speeds)


@pytest.mark.full  # in the gate a denser search that shares nothing with theirs, above
@pytest.mark.parametrize("layout, count", [(SKEW, FEW), (ORTHOGONAL, RIGS), (SKEW, RIGS)])
def test_peaks_are_those_of_a_finer_search(layout, count):
    for rig, speeds in _cases(layout, count):
        fine = steady_state(rig, speeds, grid_bits=10)
        want = jnp.concatenate([fine.peak[None], fine.peak_component, fine.peak_to_peak])
        peak, high, low = jnp.split(_lean(rig, speeds), [1, 4])
        found = jnp.concatenate([peak, jnp.maximum(high, low), high + low])
        assert np.allclose(found[1:], want[1:], rtol=1e-6), (rig, speeds)
        assert np.isclose(found[0], want[0], rtol=1e-5), (rig, speeds)  # two places nearly as high


@pytest.mark.full  # in the gate derivatives of steady peaks: test_sensitivity
def test_gradients_of_a_stiff_slow_rig_are_those_of_differences():
    rig, speeds = next(_cases(ORTHOGONAL))
    rig = eqx.tree_at(lambda r: r.wheels.contact.damping, rig, jnp.full(3, 2e4))

    def peak(scale):
        moved = eqx.tree_at(lambda r: r.wheels.roundness, rig, scale * rig.wheels.roundness)
        return LongRun(moved, 0.1 * speeds, jnp.zeros(3), "coupled").suprema("dR")[0]

    both = jax.jit(jax.value_and_grad(peak))
    difference = (both(1 + 1e-4)[0] - both(1 - 1e-4)[0]) / 2e-4
    assert np.isclose(both(1.0)[1], difference, rtol=1e-5)


@pytest.mark.full
def test_groups_of_like_signals_say_what_one_group_says(monkeypatch):
    """A runout gives one wheel pieces all around the turn; alone or with room for as many."""
    random = drawn_anew("groups of like signals")
    rig = eqx.tree_at(
        lambda r: (r.wheels.roundness, r.wheels.rollers),
        machine(SKEW),
        (jnp.asarray(random.uniform(0.2, 0.8, 3)), jnp.array([6.0, 8.0, 7.0])),
    )
    law = WheelRunout(jnp.asarray(2e-5), jnp.asarray(random.uniform(0, 6)))
    rig = rig.add(law, "w2")
    speeds, force = jnp.asarray(random.uniform(2, 9, 3)), jnp.asarray(random.normal(size=3))
    module = importlib.import_module("omnijax.simulation._exact.forcing")

    def figures(room):
        def values(speeds):
            run = LongRun(rig, speeds, jnp.zeros(3), "coupled", force=force)
            peak = run.suprema("dR")[0]
            return jnp.asarray(len(run.parts)), jnp.append(root(run.mean_square("dR")), peak)

        monkeypatch.setattr(module, "ROOM", room)
        return quick_jit(values)(speeds)

    (two, apart), (one, together) = figures(0.0), figures(np.inf)
    assert (two, one) == (2, 1)
    assert np.allclose(apart, together, rtol=1e-6)
