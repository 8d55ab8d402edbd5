"""Effects, alone and with others, on rigs drawn anew: the plant's steps close in on `simulate`.

The plant of the benchmarks shares no code with the package.  Its error falls with its step; what is
left at the finer one is far below what the effect does.  Each run draws some of the effects; the
full suite takes all of them.
"""

from itertools import pairwise

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from planted import EFFECTS, PROFILES, drawn_machine, in_plants_words, placed
from seeds import drawn_anew
from test_plant import load_plant

from omnijax.simulation import simulate, table, torques

PLANT = load_plant()
LENGTH, RATE, STEPS = 0.12, 250.0, (1e4, 2e4)  # s, samples and steps a second
KINKED = {"mount-backlash", "lift-off", "actuator-delay", "actuator-saturation", "load-friction",
          "friction-asymmetry", "damaged-roller"}  # fmt: skip
GAPPED = {"damaged-roller", "lift-off"}  # without gaps they do nothing
COUNT, SEVERAL = 4, 1  # effects alone, cases of four of them at once


class Case:
    """A machine, what is on, and torques and force in time."""

    def __init__(self, rng, kinds, wheel, names):
        n, gaps = len(kinds), bool(GAPPED & {*names}) or rng.random() < 0.4
        self.wheel, self.names, self.smooth = wheel, names, not gaps and not KINKED & {*names}
        self.machine = drawn_machine(rng, kinds, gaps, light="lift-off" in names)
        self.values = {name: EFFECTS[name].draw(rng) for name in names}
        if "damaged-roller" in names:
            plant, angle = self.machine.plant, self.machine.angle
            gap = rng.integers(0, plant["n"][wheel])
            angle[wheel] = 2 * np.pi / plant["n"][wheel] * (gap + plant["eta"][wheel] / 2)
            self.values["damaged-roller"]["roller"] = float(gap)
        self.time = np.arange(round(LENGTH * RATE) + 1) / RATE
        self.torque = rng.uniform(-4, 4, n) + rng.uniform(-1, 1, (len(self.time), n))
        self.force = rng.uniform(-30, 30, 3) + rng.uniform(-9, 9, (len(self.time), 3))

    def drive(self):
        """Torques, force and where the wheels start, as the package takes them."""
        force = table(self.time, self.force)
        return torques(table(self.time, self.torque), force, self.machine.angle)

    def planted(self, nothing, on=True):
        """The same in the plant's words, with the effects or without."""
        values = self.values if on else {}
        words = in_plants_words(nothing, values, len(self.machine.angle), self.wheel)
        return self.machine.angle, self.torque, self.force, self.machine.plant, words


def of_plant(cases, steps, on=True):
    """The plant's outputs of all cases (cases, samples, columns)."""
    nothing = PLANT.nothing(len(cases[0].machine.angle))
    each = [case.planted(nothing, on) for case in cases]
    stacked = jax.tree.map(lambda *x: np.stack([np.asarray(v, float) for v in x]), *each)
    return np.asarray(PLANT.side_by_side(*stacked, rate=RATE, steps=steps))


@eqx.filter_jit
def run_of(rig, drive, ts):
    """The package's run at a tolerance at which it counts as exact."""
    return simulate(rig, drive, ts, solver="dopri8", rtol=1e-10)


def distance(found, expected, n):
    """The largest error of a group of outputs over the group's largest change."""
    ends = np.cumsum([0, 3, n, 3, 3])
    errors = []
    for i, j in pairwise(ends):
        size = np.abs(expected[:, i:j] - expected[0, i:j] * (i == 3)).max()
        errors.append(np.abs(found[:, i:j] - expected[:, i:j]).max() / size)
    return max(errors)


@pytest.mark.parametrize("count", [COUNT, pytest.param(len(EFFECTS), marks=pytest.mark.full)])
def test_the_plant_closes_in_on_every_effect(count):
    rng = drawn_anew(f"plant against {count} effects")
    n = int(rng.integers(2, 7))
    kinds, wheel = tuple(rng.choice([*PROFILES], n).tolist()), int(rng.integers(n))
    drawn = rng.permutation([*EFFECTS]).tolist()[:count]
    together = [tuple(rng.choice(drawn, 4, replace=False).tolist()) for _ in range(SEVERAL)]
    cases = [Case(rng, kinds, wheel, names) for names in (*((name,) for name in drawn), *together)]
    coarse, fine = (of_plant(cases, steps) for steps in STEPS)
    without = of_plant(cases, STEPS[1], on=False)
    shrinks = []
    for k, case in enumerate(cases):
        rig = placed(case.machine, case.values, wheel, drawn)
        run = run_of(rig, case.drive(), jnp.asarray(case.time))
        ours = np.concatenate([np.asarray(run[g]) for g in ("dR", "theta", "Omega", "a")], axis=1)
        before, after = distance(coarse[k], ours, n), distance(fine[k], ours, n)
        effect = distance(without[k], ours, n)
        told = f"{case.names}: {before:.1e} -> {after:.1e}, effect {effect:.1e}, {kinds}"
        assert run.ok, told
        if case.smooth:  # fourth order: a sixteenth
            assert after < 1e-5 and before > 7 * after, told
        else:  # what lies between two steps at an edge
            bound = 5e-2 if "lift-off" in case.names else 2e-3
            if "damaged-roller" in case.names:  # on an endless wave its shape jumps
                bound = max(bound, 2e-2)
            assert after < bound, told
        flown = run.normal_force.min() <= 0
        assert effect > 20 * after or (case.names == ("lift-off",) and not flown), told
        shrinks.append(before / after)
    assert np.median(shrinks) > 3
