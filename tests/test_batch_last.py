"""`vmap_last` against `jax.vmap`: every rule, loops, choices, derivatives, a whole run."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from seeds import drawn_anew
from tiers import tiered

from omnijax.simulation import side_by_side
from omnijax.simulation._batch_last import in_parts
from omnijax.simulation._batch_last.transform import LANES

TABLE = jnp.asarray(np.random.default_rng(0).normal(size=(5, 3)))
WIDE = jnp.asarray(np.random.default_rng(1).normal(size=(5, 20)))


def products(x, m):
    """Matrices by vectors and by matrices, either side, one of them alike for all designs."""
    many = jnp.einsum("tij,tj->ti", jnp.stack([m, 2 * m]), jnp.stack([x, x**2]))
    long = jnp.sin(jnp.arange(60.0)).reshape(20, 3)
    wide = [jnp.sin(jnp.arange(k, dtype=float))[:, None] * x for k in (8, 13, 16, 20)]
    sums = [(WIDE[:, : len(w)] @ w, w.T @ w, w.T @ WIDE[:, : len(w)].T) for w in wide]
    return (
        m @ x, x @ m, m.T @ m, TABLE @ m, m @ TABLE.T, jnp.outer(x, x), many, long @ x, x @ x, sums
    )  # fmt: skip


def shapes(x, m):
    """Slices, gathers, scatters, stacks, reductions and orders along an axis."""
    at, start = jnp.asarray([2, 0, 2]), (jnp.int32(1), jnp.int32(0))
    return (
        m[1], m[:, ::2], m[at], m.at[at].add(x[:, None]), m.at[1].set(x), jnp.stack([x, x], 1),
        jnp.concatenate([m, TABLE]), jnp.sum(m, 0), jnp.max(m, 1), jnp.argmax(m, 0),
        jnp.cumsum(m, 0), jnp.sort(m, 1), m.T.reshape(-1), jnp.where(x > 0, x, TABLE[0]),
        jnp.linalg.solve(m + 4 * jnp.eye(3), x), jnp.cross(x, m[0]), x[::-1], jnp.pad(x, 1),
        jax.lax.dynamic_slice(m, (1, 0), (2, 3)), jax.lax.dynamic_update_slice(m, m[:1], (1, 0)),
        jax.lax.dynamic_slice(m, start, (2, 3)), jax.lax.dynamic_update_slice(m, m[:1], start),
    )  # fmt: skip


def functions(x, m):
    """Functions of one number."""
    one = jnp.abs(x) + 0.1
    return [
        f(one)
        for f in (jnp.sin, jnp.cos, jnp.exp, jnp.log, jnp.sqrt, jnp.tanh, jnp.floor, jnp.sign,
                  jnp.cbrt, lambda v: v**3, lambda v: v**1.7, lambda v: jnp.arctan2(v, 2.0))
    ]  # fmt: skip


def loops(x, m):
    """Steps counted alike and by each design, a scan with rows of either kind, a choice."""
    walked = jax.lax.fori_loop(0, 5, lambda i, y: jnp.tanh(m @ y) + i * x, x)
    until = jax.lax.while_loop(lambda y: y[0] < 30.0, lambda y: 1.5 * y, jnp.abs(x) + 0.1)

    def step(carry, row):
        count, y = carry
        return (count + 1, y * row[1] + TABLE[count]), (y + row[0], count)

    (count, end), rows = jax.lax.scan(step, (0, x), (TABLE[:3], m))
    chosen = jax.lax.cond(jnp.sum(TABLE) > 0, lambda v: v + 1, lambda v: v - 1, x)
    by_design = jax.lax.cond(x[0] > 0, lambda v: v * 2, lambda v: v + m[0], x)
    return walked, until, count, end, rows, chosen, by_design


def slopes(x, m):
    """Derivatives taken inside."""
    return jax.jacfwd(lambda v: jnp.stack(functions(v, m)) @ (m @ v))(x), jax.grad(
        lambda v: jnp.sum(jnp.sin(m @ v) ** 2)
    )(x)


@pytest.mark.parametrize(
    "function",
    tiered([products, shapes, functions, loops, slopes], (products, shapes, slopes).__contains__),
)  # in the gate products over any axes, below, and whole runs: test_one_evaluation
@pytest.mark.parametrize("size", tiered([1, 7], lambda size: size == 1))
def test_the_batch_last_gives_what_the_batch_first_gives(function, size):
    rng = np.random.default_rng(size)
    x, m = (jnp.asarray(rng.normal(size=s)) for s in ((size, 3), (size, 3, 3)))
    wanted, found = jax.vmap(function)(x, m), side_by_side(function)(x, m)
    assert jax.tree.structure(wanted) == jax.tree.structure(found)
    for a, b in zip(jax.tree.leaves(wanted), jax.tree.leaves(found), strict=True):
        assert a.shape == b.shape and a.dtype == b.dtype
        np.testing.assert_allclose(b, a, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("size", [LANES, LANES + 1, 3 * LANES - 5])
@pytest.mark.parametrize("mapped", [side_by_side, lambda f: in_parts(jax.vmap(f))])
def test_a_large_batch_is_worked_out_in_parts_and_in_order(mapped, size):
    widths = []

    def function(tree):
        return {"power": tree["a"] ** 2 @ tree["b"], "same": TABLE, "count": jnp.argmax(tree["a"])}

    def seen(x):  # how many rows a part has
        widths.append(len(x["a"]))
        return jax.vmap(function)(x)

    rng = np.random.default_rng(size)
    tree = {"a": rng.normal(size=(size, 3)), "b": rng.normal(size=(size, 3, 2))}
    wanted, found = jax.vmap(function)(tree), jax.jit(mapped(function))(tree)
    for a, b in zip(jax.tree.leaves(wanted), jax.tree.leaves(found), strict=True):
        assert a.shape == b.shape and a.dtype == b.dtype
        np.testing.assert_allclose(b, a, rtol=1e-12, atol=1e-12)
    in_parts(lambda x: seen({"a": x, "b": jnp.ones((*x.shape, 2))}))(tree["a"])
    assert max(widths) <= LANES


@pytest.mark.parametrize("seed", tiered(range(6), lambda seed: seed > 2))
def test_sums_of_products_over_any_axes(seed):
    """Drawn: kept, free and summed axes in any order, 0 to hundreds of terms, one side fixed."""
    rng = np.random.default_rng(seed)
    sizes = dict(zip("abcdef", rng.integers(1, 14, 6), strict=True))
    sizes["f"] = rng.integers(0, 40)
    left = "".join(rng.permutation(["a", "b", "d", "f"][: rng.integers(1, 5)]))
    right = "".join(rng.permutation(["a", "c", "d", "f"][: rng.integers(1, 5)]))
    kept = [k for k in {*left, *right} if k in "abc"]
    rule = f"{left},{right}->{''.join(rng.permutation(kept)) if kept else ''}"
    x, y = (jnp.asarray(rng.normal(size=[9, *(sizes[k] for k in side)])) for side in (left, right))

    def both(x, y):
        return jnp.einsum(rule, x, y), jnp.einsum(rule, x, y + 0 * x.ravel()[:1].sum()), jnp.sum(x)

    def fixed(x):
        return jnp.einsum(rule, x, y[0])

    for f, given in ((both, (x, y)), (fixed, (x,))):
        wanted, found = jax.vmap(f)(*given), side_by_side(f)(*given)
        for a, b in zip(jax.tree.leaves(wanted), jax.tree.leaves(found), strict=True):
            assert a.shape == b.shape
            np.testing.assert_allclose(b, a, rtol=1e-12, atol=1e-10)


def test_logarithms_are_those_of_libm():
    rng = drawn_anew("a batch last")
    wide, near = np.exp(rng.uniform(-708, 709, 20_000)), 1 + rng.normal(size=20_000) * 1e-4
    odd = [0.0, -0.0, -1.0, np.inf, -np.inf, np.nan, 1.0, 2.3e-308, 1.7e308, 0.5, 2.0]
    x = jnp.asarray(np.concatenate([wide, near, rng.uniform(0.4, 3, 20_000), odd]))
    with np.errstate(all="ignore"):
        wanted = np.log(np.asarray(x))
    found = np.asarray(side_by_side(jnp.log)(x))
    np.testing.assert_array_equal(np.isfinite(found), np.isfinite(wanted))
    np.testing.assert_allclose(found, wanted, rtol=4e-16)


def test_several_arrays_of_one_design_and_none_of_its_own():
    """A tree of arguments; an output that no design changes; whole numbers."""

    def function(tree, count):
        return {"same": TABLE, "sum": tree["a"] + tree["b"][0], "count": count // 2 + 1}

    tree = {"a": jnp.arange(12.0).reshape(4, 3), "b": jnp.ones((4, 2, 3))}
    count = jnp.arange(4)
    wanted, found = jax.vmap(function)(tree, count), side_by_side(function)(tree, count)
    assert set(found) == set(wanted)
    for key, value in wanted.items():
        np.testing.assert_array_equal(found[key], value)
        assert found[key].dtype == value.dtype
