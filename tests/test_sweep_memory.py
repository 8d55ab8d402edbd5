"""Designs side by side must fit into memory; closed forms of a whole turn are large programs."""

import jax.numpy as jnp

import omnijax
from omnijax import laws
from omnijax.study._evaluation import Rows, batching, methods


def damaged(rig):
    return rig.add(laws.DamagedRoller(jnp.asarray(3.0), jnp.asarray(0.5)), "w2")


def test_designs_side_by_side_fit_into_a_share_of_the_memory(monkeypatch):
    """As many as fit, a power of two, also with gradients; closed forms go one by one anyway."""
    need = 8.0 * 1000 * batching.CHANNELS * 2 / batching.SHARE_OF_MEMORY
    monkeypatch.setattr(batching, "available", lambda: 5.5 * need)
    sizes = [batching.batch_size("fixed", 11, columns) for columns in (0, 1, 3, 9)]
    assert sizes == [4, 2, 1, 1]
    assert batching.batch_size("full", 11, 0, devices=8) == 8
    for method in ("propagation", "steady"):
        assert batching.batch_size(method, 11, 9) == batching.BATCH[method]


def test_a_sweep_evaluates_no_more_side_by_side(monkeypatch):
    """The rows are all evaluated, a batch after the other."""
    rig = damaged(omnijax.load_rig("atlas"))
    monkeypatch.setattr(methods, "MOST_SAMPLES", 10)  # longer runs go one by one
    monkeypatch.setitem(batching.BATCH, "propagation", 2)
    asked = []

    def evaluated(self, part):
        asked.append(len(part))
        return jnp.ones((len(part), 1)), jnp.zeros((len(part), 1, 0)), jnp.zeros(len(part), int)

    monkeypatch.setattr(Rows, "__call__", evaluated)
    found = omnijax.sweep(
        rig, {"wheel.roundness": [0.2, 0.3, 0.4]}, ["rms_x"], speeds=[1.0, 2.0, 3.0], duration=0.1
    )
    assert [found.status(i) for i in range(3)] == ["ok"] * 3
    assert asked and max(asked) == 2 and sum(asked) >= 3
