"""Design points: ranges as text, grids, Latin hypercubes and Sobol points by index."""

import math

import numpy as np
import pytest

from omnijax import InputError, load_rig
from omnijax.study._axes import SweepAxis, read_axis, split_vary
from omnijax.study._parameters import checked_parameters
from omnijax.study._points import Grid, build_points
from omnijax.study._sweep.plan import Numerics, Sampling, read_numbers


def axis(text, path="contact.stiffness", unit="N/m") -> SweepAxis:
    return read_axis(path, text, unit)


def test_levels_of_the_forms():
    np.testing.assert_allclose(axis("1:3:5").levels(), [1, 1.5, 2, 2.5, 3], rtol=1e-15)
    np.testing.assert_allclose(axis("log:1e4:1e6:3").levels(), [1e4, 1e5, 1e6], rtol=1e-14)
    assert axis("log:5e4:1e6:40").levels()[-1] == 1e6  # the ends are met exactly
    np.testing.assert_array_equal(axis("3,1,2").levels(), [3, 1, 2])
    np.testing.assert_allclose(axis("50 kN/m:0.1 MN/m:2").levels(), [5e4, 1e5], rtol=1e-15)
    np.testing.assert_array_equal(axis([5.0, 7.0]).levels(), [5, 7])


@pytest.mark.parametrize("text", ["0.1:0.30000000000000004:7", "log:5e4:1e6:40", "3,1,2", "1:2"])
def test_text_reads_back_to_the_last_bit(text):
    assert axis(axis(text).text) == axis(text)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("3:1:5", "reversed range"),
        ("2:2:5", "empty range"),
        ("1:3:1", "at least 2 levels"),
        ("1:3:2.5", "whole number"),
        ("log:0:3:4", "start above 0"),
        ("1:2:3:4", "must be low:high:count"),
        ("1,1", "a value twice"),
        ("1:many:3", "must be a number"),
        ("1 kg:3 kg:4", "in N/m"),
        ("nan:3:4", "finite"),
    ],
)
def test_wrong_ranges_are_refused_by_name(text, words):
    with pytest.raises(InputError, match=words) as error:
        axis(text)
    assert "`contact.stiffness`" in str(error.value)


def test_vary_texts():
    assert split_vary(["a.b=1:2:3", "c = 4,5"]) == {"a.b": "1:2:3", "c": "4,5"}
    with pytest.raises(InputError, match="varied twice"):
        split_vary(["a=1:2:3", "a=4,5"])
    with pytest.raises(InputError, match="path=range"):
        split_vary(["a"])


def test_grid_is_every_combination_last_axis_fastest():
    grid = build_points([axis("1,2"), axis("10:30:3", "b")], "grid", None, 0)
    expected = [[1, 10], [1, 20], [1, 30], [2, 10], [2, 20], [2, 30]]
    assert grid.size == 6
    np.testing.assert_array_equal(grid.at(np.arange(6)), expected)
    assert isinstance(grid, Grid) and grid.shape == (2, 3)


@pytest.mark.parametrize("size", [1, 2, 5, 64, 1000, 1025])
def test_latin_hypercube_has_one_design_in_each_stratum(size):
    points = build_points([axis("0:1"), axis("0:1", "b")], "lhs", size, 7)
    x = points.at(np.arange(size))
    for j in range(2):
        np.testing.assert_array_equal(np.sort(np.floor(x[:, j] * size)), np.arange(size))
    if size >= 1000:  # the columns are independent: |r| of n pairs is below 5/sqrt(n)
        assert abs(np.corrcoef(x.T)[0, 1]) < 5 / math.sqrt(size)
        assert abs(np.corrcoef(x[1:, 0], x[:-1, 0])[0, 1]) < 5 / math.sqrt(size)


@pytest.mark.parametrize("sampler", ["lhs", "sobol"])
def test_points_follow_from_seed_and_index_alone(sampler):
    axes = [axis("2:5"), axis("log:1:100", "b")]
    whole = build_points(axes, sampler, 100, 3).at(np.arange(100))
    points = build_points(axes, sampler, 100, 3)
    for part in (np.arange(60, 100), np.arange(0, 10), np.array([5]), np.arange(10, 60)):
        np.testing.assert_array_equal(points.at(part), whole[part])
    assert (whole >= [2, 1]).all() and (whole < [5, 100]).all()
    other = build_points(axes, sampler, 100, 4).at(np.arange(100))
    assert not np.isclose(other, whole).any(axis=1).all()


def test_a_billion_points_cost_no_memory():
    points = build_points([axis("0:1"), axis("5:6", "b")], "lhs", 10**9, 0)
    x = points.at(np.array([10**9 - 1, 17]))
    assert ((x >= [0, 5]) & (x < [1, 6])).all()


@pytest.mark.parametrize(
    ("text", "sampler", "samples", "words"),
    [
        ("1:2", "grid", None, "low:high:count"),
        ("1:2:3", "grid", 5, "belongs to the samplers"),
        ("1:2:3", "lhs", 5, "takes low:high"),
        ("1:2", "sobol", None, "needs `samples`"),
        ("1:2", "random", 5, "must be one of"),
        ("1:2", "sobol", 2**33, "must lie in"),
    ],
)
def test_contradictions_are_refused(text, sampler, samples, words):
    with pytest.raises(InputError, match=words):
        build_points([axis(text)], sampler, samples, 0)


def test_counts_may_be_numbers_of_numpy_and_all_that_are_none_are_named():
    """NumPy's integers could not be written into the store, others ended in a TypeError."""
    numerics = Numerics("coupled", "auto", None, None, "1e-6", np.int64(500))
    counts = np.int64(4), np.int32(3), False, np.int8(2), np.int16(1)
    sampling, numbers = read_numbers(Sampling("lhs", *counts), numerics)
    assert [type(x) for x in (*sampling[1:3], *sampling[4:])] == [int] * 4
    assert (numbers.rtol, numbers.max_steps) == (1e-6, 500) and type(numbers.max_steps) is int
    wrong = Sampling("lhs", 4.0, "1", False, True, 0)  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError) as error:
        read_numbers(wrong, numerics._replace(rtol=-1.0, max_steps=1.5))
    assert error.value.problems == (
        "`samples` must be a whole number in [1, inf), but is 4.0.",
        "`chunk` must be a whole number in [1, inf), but is True.",
        "`devices` must be a whole number in [1, inf), but is 0.",
        "`seed` must be a whole number in [0, inf), but is '1'.",
        "`rtol` must lie in (0, inf), but is -1.",
        "`max_steps` must be a whole number in [1, inf), but is 1.5.",
    )


def test_paths_may_be_words_of_numpy():
    """Taken from an array of names, a path had been refused by jax as no number."""
    path = np.array(["wheel.w2.roundness", "sphere.mass"])[0]
    rig = load_rig("atlas")
    assert {type(p) for p in (*split_vary({path: [0.1]}), *checked_parameters(rig, [path]))} == {
        str
    }
    assert checked_parameters(rig, [path]) == ("wheel.w2.roundness",)
