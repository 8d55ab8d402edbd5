"""A sample of `python -m tests.mutants`, drawn anew: changed laws that the formulas must notice."""

from mutants.equations import all_mutants, outdated
from mutants.killing import prepare, tried
from seeds import drawn_anew
from test_formulas import CHECKS

COUNT = 24  # mutants
ELSEWHERE = ("in_series", "is_turn")  # no laws: what is checked of them stands in other files


def test_slips_of_the_pen_in_laws_are_noticed():
    rng = drawn_anew("mutants of laws")
    every = [
        m for m in all_mutants()
        if m.where.startswith("omnijax.laws.") and not m.where.endswith(ELSEWHERE)
    ]  # fmt: skip
    chosen = [every[i] for i in rng.choice(len(every), COUNT, replace=False)]
    results = list(tried(chosen, prepare(CHECKS)))
    assert len(results) > COUNT / 2
    survivors = [(r.mutant.where, r.mutant.text) for r in results if r.killer is None]
    assert not survivors


def test_what_is_not_tried_still_stands_in_an_equation():
    """An equation that was rewritten is tried again, whatever its old form was excused for."""
    assert not outdated()
