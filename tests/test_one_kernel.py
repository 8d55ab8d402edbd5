"""Loops as one kernel give what they give by themselves, and XLA makes one kernel of them."""

import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from seeds import drawn_anew

from omnijax.simulation import _one_kernel
from omnijax.simulation._batch_last import vmap_last
from omnijax.simulation._one_kernel import one_kernel

known = pytest.mark.skipif(not _one_kernel.KNOWN, reason="a version of XLA that is not asked")


def oscillated(x, rate, unused):
    """A loop over small kernels; `unused` and what is closed over do nothing in it."""

    def step(i, carry):
        y, v = carry
        v = v - rate[0] * jnp.sin(y) + 0.0 * jnp.roll(unused, i)
        return y + 0.01 * v, v

    return jax.lax.fori_loop(0, 50, step, (x, jnp.zeros_like(x)))


def kernels(program) -> int:
    """Calls that were asked to be kernels; XLA asks for some of its own without the first word."""
    return program.as_text().count('inlineable="false",xla_cpu_small_call="true"')


@known
def test_one_call_stands_for_the_loop():
    numbers = [jnp.ones(64)] * 3
    plain = jax.jit(oscillated).lower(*numbers).compile()
    kernel = jax.jit(lambda *x: one_kernel(oscillated, *x)).lower(*numbers).compile()
    assert " while(" in plain.as_text()
    assert kernels(plain) == 0 < kernels(kernel)


def test_values_and_slopes_are_those_of_the_loop():
    rng = drawn_anew("one kernel")
    x, rate, unused = rng.normal(size=(3, 64))
    size = rng.normal()

    def figure(of):
        def f(x, rate):
            return sum(
                jnp.sum(y * y) for y in of(lambda *z: oscillated(size * x, *z), rate, unused)
            )

        return f

    plain, kernel = figure(lambda f, *z: f(*z)), figure(one_kernel)
    both = [jax.jit(jax.value_and_grad(f, (0, 1)))(x, rate) for f in (plain, kernel)]
    for a, b in zip(*map(jax.tree.leaves, both), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12)


def test_many_at_once():
    x = drawn_anew("one kernel").normal(size=(3, 5, 8))
    each = jax.jit(jax.vmap(lambda *x: one_kernel(oscillated, *x)))(*x)
    np.testing.assert_allclose(each, jax.vmap(oscillated)(*x), rtol=1e-12, atol=1e-14)


def test_many_with_the_batch_last():
    """Loops of `vmap_last` are kernels, with sums of few and of many terms in them."""
    x = drawn_anew("one kernel").normal(size=(3, 5, 8))

    def summed(y, *_):
        def turn(_, y):
            return jnp.tanh(
                jnp.sum(jnp.outer(y, y), axis=1) + jnp.ones(25) @ jnp.concatenate([y] * 5)
            )

        return jax.lax.fori_loop(0, 4, turn, y)

    for f in (oscillated, summed):
        program = jax.jit(vmap_last(f)).lower(*x).compile()
        assert kernels(program) > 0 or not _one_kernel.KNOWN
        expected = jax.vmap(f, -1, -1)(*x)
        for a, b in zip(*map(jax.tree.leaves, (program(*x), expected)), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-13)


def test_what_it_is_given_may_be_constant_or_empty():
    """In a process of its own: XLA ends the one in which it is wrong."""
    text = """
import jax, jax.numpy as jnp, numpy as np
from omnijax.simulation._one_kernel import one_kernel
large = jnp.asarray(np.linspace(0.0, 1.0, 20_000))

def loop(x, large, empty, flag):
    step = lambda _, y: jnp.sin(y) + large[3] + jnp.where(flag, jnp.sum(empty), 0.0)
    return jax.lax.fori_loop(0, 9, step, x)

def run(x, large, empty, flag):
    return one_kernel(loop, x, large, empty, flag)

given = jnp.ones(4), large, jnp.zeros((0, 3)), jnp.asarray(True)
every = jax.jit(lambda: jax.jit(run)(*given))()
some = jax.jit(lambda x: jax.jit(run)(x, *given[1:]))(given[0])
assert np.array_equal(every, some) and np.array_equal(some, run(*given))
print("as one")
"""
    ended = subprocess.run(
        [sys.executable, "-c", text], capture_output=True, text=True, check=False
    )
    assert ended.stdout.strip() == "as one", ended.stderr[-2000:]


@pytest.mark.parametrize(
    "left",
    [
        jnp.sort,
        lambda x: jnp.zeros(9).at[jnp.argsort(x)].add(1.0)[:8],
        lambda x: jnp.linalg.solve(jnp.eye(8) + jnp.outer(x, x), x),
        lambda x: jnp.sum(x.reshape(4, 2), axis=1).repeat(2),
        lambda x: x - jnp.max(x),
    ],
    ids=["sorting", "scatter", "LAPACK", "sums", "maxima"],
)
def test_loops_with_what_libraries_do_stay_as_they_are(left):
    x = jnp.asarray(drawn_anew("one kernel").normal(size=8))

    def loop(x):
        return jax.lax.fori_loop(0, 3, lambda _, y: jnp.tanh(left(y)), x)

    program = jax.jit(lambda x: one_kernel(loop, x)).lower(x).compile()
    assert kernels(program) == 0
    np.testing.assert_allclose(program(x), jax.jit(loop)(x), rtol=1e-12)
