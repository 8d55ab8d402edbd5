"""Signatures beside a law that is stepped in time: what stands out is scored through it."""

import numpy as np
import pytest
from seeds import drawn_anew

from omnijax.diagnosis import Effect, Point, Search, SmallModel
from omnijax.diagnosis._search import through_laws
from omnijax.diagnosis._search.fit import refit
from omnijax.diagnosis._search.limits import BLOCKS, upper_limits
from omnijax.diagnosis._search.scan import Signatures, taken_up
from omnijax.laws import EFFECTS

LAWS = {k: EFFECTS[k] for k in ("bearing-viscous", "spin-resistance", "mount-cubic")}
CUBICS = ("contact-cubic", "mount-cubic")
ROWS = 50 * BLOCKS


class Beside(SmallModel):
    """Two laws whose changes are others beside a cubic mount; `columns` know the machine alone."""

    def __init__(self, rng):
        base = np.linalg.qr(rng.normal(size=(ROWS, 4)))[0].T
        alone = {"bearing-viscous": base[0], "spin-resistance": base[1]}
        right = {"bearing-viscous": 0.3 * base[0] + np.sqrt(0.91) * base[1],
                 "spin-resistance": base[3]}  # fmt: skip
        noise, self.asked = rng.normal(size=ROWS), []
        truth = {"bearing-viscous": 300.0, "mount-cubic": 900.0}

        def predicted(strengths):
            shapes = right if strengths.get("mount-cubic") else alone
            return sum(x * {**shapes, "mount-cubic": base[2]}[k] for k, x in strengths.items())

        def residual(values, laws, split):
            strengths = {x.id: float(next(iter(vars(x).values()))) for x in laws}
            return predicted(truth) + noise - predicted(strengths)

        super().__init__(residual, [], LAWS, "all")

    def columns(self, point, candidates):
        return super().columns(Point(point.u), candidates)

    def through_laws(self, point, candidates, steps):
        self.asked = [c.id for c in candidates]
        return [super(Beside, self).columns(point, [c]) for c in candidates]


@pytest.fixture(scope="module")
def scanned():
    model = Beside(drawn_anew("beside a law"))
    fit = refit(model, Point(np.zeros(0), (Effect("mount-cubic", "all", {"k3": 900.0}),)))
    return model, fit, Search(model)


def test_what_stands_out_is_scored_through_the_laws_of_the_fit(scanned):
    """Alone the wrong law explains 0.91 of the gap, the right one 0.09; beside it all and none."""
    model, fit, search = scanned
    scan, signatures = search.scan(fit)
    best = scan.best_per_name()[0]
    assert best.candidate.id == "bearing-viscous" and best.gain > 0.9 * 300.0**2
    assert float(best.coefficients[0]) == pytest.approx(300.0, rel=0.05)
    assert set(model.asked) == {"bearing-viscous", "spin-resistance"}  # none that the fit holds
    plain = signatures.scan(fit.residual, taken_up(fit.jacobian, 0), fit.point.u)
    assert plain.best_per_name()[0].candidate.id == "spin-resistance"


def test_nothing_is_asked_for_where_no_law_is_stepped_nor_more_columns_than_few(
    scanned, monkeypatch
):
    model, fit, search = scanned
    scan, _ = search.scan(fit)
    names = [s.candidate.name for s in scan.scores]
    assert through_laws.through_laws(model, Point(np.zeros(0)), scan, names) == {}
    monkeypatch.setattr(through_laws, "MOST_COLUMNS", 1)
    (only,) = through_laws.through_laws(model, fit.point, scan, names)
    assert scan.layout.candidates[only].name == names[0] != names[1]


def test_replaced_columns_count_within_the_block_alone():
    rng = drawn_anew("replaced columns")
    model = Beside(rng)
    candidates = model.candidates(Point(np.zeros(0)))
    table = model.columns(Point(np.zeros(0)), candidates)
    signatures, other = Signatures(candidates, table.copy()), rng.normal(size=(1, ROWS))
    residual, taken = rng.normal(size=ROWS), np.zeros((ROWS, 0))

    def gains():
        return [s.gain for s in signatures.scan(residual, taken, np.zeros(0)).scores]

    before = gains()
    with signatures.replaced({1: other}):
        first, second, *_ = gains()
        assert first == before[0]
        assert second == pytest.approx((other[0] @ residual) ** 2 / (other[0] @ other[0]))
    assert gains() == before


def test_a_model_whose_columns_are_through_the_laws_already_is_scanned_once():
    class Exact(Beside):
        columns = SmallModel.columns

        def through_laws(self, point, candidates, steps):
            return SmallModel.through_laws(self, point, candidates, steps)

    model = Exact(drawn_anew("columns through the laws"))
    fit = refit(model, Point(np.zeros(0), (Effect("mount-cubic", "all", {"k3": 900.0}),)))
    scan, _ = Search(model).scan(fit)
    assert scan.best_per_name()[0].candidate.id == "bearing-viscous"


def test_limits_of_what_a_stepped_law_bends_are_those_beside_it():
    """A relaxation beside a play had a third of its limit: what it changes alone is larger."""
    size = drawn_anew("beside a play").uniform(0.2, 0.5)  # of what it changes alone

    class Smaller(SmallModel):
        def __init__(self, rng):
            base, noise = np.linalg.qr(rng.normal(size=(ROWS, 2)))[0].T, rng.normal(size=ROWS)

            def residual(values, laws, split):
                k = {x.id: float(next(iter(vars(x).values()))) for x in laws}
                beside = size if "mount-cubic" in k else 1.0
                cubic = 900.0 - k.get("mount-cubic", 0.0)
                return noise + cubic * base[0] - beside * k.get("contact-cubic", 0.0) * base[1]

            super().__init__(residual, [], {k: EFFECTS[k] for k in CUBICS}, "all")

        def columns(self, point, candidates):
            return super().columns(Point(point.u), candidates)

        def through_laws(self, point, candidates, steps):
            return [super(Smaller, self).columns(point, [c]) for c in candidates]

    model = Smaller(drawn_anew("limits beside a play"))
    fit = refit(model, Point(np.zeros(0), (Effect("mount-cubic", "all", {"k3": 900.0}),)))
    _, signatures = Search(model).scan(fit)
    (column,), before = signatures.columns(slice(0, 1)), signatures.table.copy()
    (limit,) = upper_limits(model, fit, signatures, {"mount-cubic@all"})
    assert limit["id"] == signatures.layout.candidates[0].id == "contact-cubic"
    blocks = np.add.reduceat(column * fit.residual, np.arange(0, ROWS, ROWS // BLOCKS))
    sigma = max(1.0, np.sum((blocks - blocks.mean()) ** 2) ** 0.5) / size  # of the noise as drawn
    estimate = abs(float(column @ fit.residual)) / size  # of either sign
    assert limit["limit_95"] == pytest.approx(estimate + 1.645 * sigma, rel=1e-3)
    assert np.array_equal(before, signatures.table)
