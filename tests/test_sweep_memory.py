"""Closed forms of a whole turn are large: designs side by side must fit into memory."""

import jax.numpy as jnp
import numpy as np

import omnijax
from omnijax import laws
from omnijax.simulation import pieces_traced
from omnijax.study._evaluation import Evaluation, Rows, rows
from omnijax.study._evaluation.methods import Question, choose


def damaged(rig):
    return rig.add(laws.DamagedRoller(jnp.asarray(3.0), jnp.asarray(0.5)), "w2")


def question(rig, count):
    drives = (omnijax.speeds([1.0, 2.0, 3.0]),)
    return Question(rig, drives, ("wheel.roundness",), ("rms", "peak"), "coupled", 1.0, rows=count)


def test_designs_side_by_side_fit_into_a_share_of_the_memory(monkeypatch):
    """As many as fit; the rows are all evaluated, a batch after the other."""
    plain, drive = omnijax.load_rig("atlas"), omnijax.speeds([1.0, 2.0, 3.0])
    rig = damaged(plain)
    assert pieces_traced(plain) == 6 and pieces_traced(rig) > 100
    how = Evaluation("propagation", ("rms",), times=np.linspace(0, 0.1, 11))
    asked = []

    def evaluated(self, part):
        asked.append(len(part))
        return jnp.zeros((len(part), 1)), jnp.zeros((len(part), 1, 0)), jnp.zeros(len(part))

    monkeypatch.setattr(Rows, "__call__", evaluated)
    design = np.linspace(0.1, 0.5, 20)[:, None]
    for machine, most in ((rig, 5), (plain, 20)):
        need = rows.BYTES_A_PIECE * pieces_traced(rig) / rows.SHARE
        monkeypatch.setattr(rows, "available", lambda need=need: 5.5 * need)
        asked.clear()
        found = Rows(how, machine, drive, ("wheel.roundness",)).all(design, 32)
        assert len(found[0]) == 20 and sum(asked) >= 20
        assert max(asked) == (most if most < 20 else 32)


def test_a_turn_of_many_pieces_pays_for_a_program_in_bulk_sooner():
    plain = omnijax.load_rig("atlas")
    rig = damaged(plain)
    assert choose(question(plain, 20))[0] == "propagation"
    assert choose(question(rig, 20))[0] == "bulk"
    assert choose(question(rig, 2))[0] == "propagation"
    assert choose(question(plain, 200))[0] == "bulk"
