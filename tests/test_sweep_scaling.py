"""The prediction of `benchmarks/scaling.py` in cases that are known by hand."""

import importlib.util
from pathlib import Path

import pytest

FILE = Path(__file__).parents[1] / "benchmarks" / "scaling.py"


@pytest.fixture(scope="module")
def scaling():
    spec = importlib.util.spec_from_file_location("scaling", FILE)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def costs(**others):
    free = dict.fromkeys(("fixed", "each", "store_fixed", "store_each", "task"), 0.0)
    return {**free, "design": 1e-3, **others}


def test_without_overhead_a_thousand_workers_are_a_thousand_times_faster(scaling):
    found = scaling.predict(costs(), 1e6, 1000, 100)
    assert found == {
        "seconds": pytest.approx(1.0),
        "efficiency": pytest.approx(1),
        "limit": "workers",
    }


def test_each_overhead_limits_where_it_must(scaling):
    assert scaling.predict(costs(fixed=0.1), 1e6, 10, 100)["efficiency"] == pytest.approx(0.5)
    found = scaling.predict(costs(task=1e-3), 1e6, 1000, 100)  # 1e4 tasks of 1 ms: 10 s for 1 s
    assert found["limit"] == "scheduler" and found["efficiency"] == pytest.approx(0.1)
    found = scaling.predict(costs(store_fixed=5e-3), 1e6, 1000, 100)
    assert found["limit"] == "store" and found["seconds"] == pytest.approx(50)
    few = scaling.predict(costs(), 1e6, 1000, 10_000)  # 100 chunks keep 100 workers busy
    assert few["efficiency"] == pytest.approx(0.1)


def test_bounds_are_where_the_limits_meet(scaling):
    known = costs(task=2e-3, fixed=1e-2, store_fixed=1e-2)
    found = scaling.bounds(known, 100)
    assert found["scheduler"] == pytest.approx((100 * 2e-3 - 1e-2) / 1e-3)
    for name, chunk in found.items():
        smaller = scaling.predict(known, 1e8, 100, int(chunk * 0.9))["limit"]
        larger = scaling.predict(known, 1e8, 100, int(chunk * 1.1))["limit"]
        assert smaller != "workers" and (larger == "workers" or name == "scheduler")


def test_fit_of_the_overhead(scaling):
    assert scaling._affine([1, 2, 4], [3, 5, 9]) == pytest.approx((1, 2))
