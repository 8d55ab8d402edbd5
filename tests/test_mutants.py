"""A sample of `python -m tests.mutants`, drawn anew: changed laws that the formulas must notice."""

import pytest
from mutants.equations import all_mutants, outdated
from mutants.killing import prepare, tried
from seeds import drawn_anew
from test_formulas import CHECKS
from tiers import tiered

ELSEWHERE = ("in_series", "is_turn")  # no laws: what is checked of them stands in other files


@pytest.mark.parametrize("count", tiered([6, 24], (24).__eq__))  # mutants
def test_slips_of_the_pen_in_laws_are_noticed(count):
    rng = drawn_anew("mutants of laws")
    every = [
        m for m in all_mutants()
        if m.where.startswith("omnijax.laws.") and not m.where.endswith(ELSEWHERE)
    ]  # fmt: skip
    chosen = [every[i] for i in rng.choice(len(every), count, replace=False)]
    results = list(tried(chosen, prepare(CHECKS)))
    assert len(results) > count / 2
    survivors = [(r.mutant.where, r.mutant.text) for r in results if r.killer is None]
    assert not survivors


def test_what_is_not_tried_still_stands_in_an_equation():
    """An equation that was rewritten is tried again, whatever its old form was excused for."""
    assert not outdated()
