"""The plant of the benchmarks against noise-free trajectories of yet another program."""

import importlib.util
from pathlib import Path

import jax
import numpy as np
from references import reference

from omnijax.diagnosis._machine.runs import Run

GROUPS = ("dR", "theta", "Omega", "a")
LIMITS = {"ref-2 theta_1": 0.3, "ref-2 theta_2": 0.3}  # of a sigma; their wheels hardly turn: the
# steep part of the rolling resistance's tanh holds them, where both programs' steps show


def load_plant():
    """`benchmarks/plant.py` as a module of its own, whose constants a test may set."""
    path = Path(__file__).parents[1] / "benchmarks" / "plant.py"
    spec = importlib.util.spec_from_file_location("plant", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def recorded(folder: Path, seed: int, seconds: float, *, effects=None, off=False, **how):
    """(plant, generator, tables) of two runs of a drawn machine; its case is written to `folder`.

    `effects` are planted; if it is `off`, its numbers are, from those that the rig file states.
    """
    plant, rng = load_plant(), np.random.default_rng(seed)
    machine = plant.machine(rng)
    true = plant.perturbed(rng, machine) if off else machine
    torque = np.stack([plant.torques(true, plant.wander(rng, seconds)) for _ in range(2)])
    tables = plant.record(machine, true, effects or {}, torque, rng, **how)
    plant.write_case(folder, machine, tables)
    return plant, rng, tables


def runs_of(tables, roles=("train", "held-out")) -> list[Run]:
    """Recorded tables of three wheels as runs of the diagnosis."""
    runs = []
    for k, (table, role) in enumerate(zip(tables, roles, strict=True)):
        outputs = {
            g: np.stack([v for c, v in table.items() if c.startswith(f"{g}_")], 1) for g in GROUPS
        }
        torque = np.stack([table[f"torque_{i}"] for i in (1, 2, 3)], 1)
        n = len(torque)
        runs.append(Run(f"run-{k}", role, table["t"], torque, np.zeros((n, 3)), outputs,
                        np.ones(n, bool)))  # fmt: skip
    return runs


def test_the_plant_agrees_with_both_references_within_a_tenth_of_the_noise():
    plant = load_plant()
    plant.EPS = 3e-3  # rad/s, the width in the references
    first, second = reference("ref-1"), reference("ref-2")
    rigs = stated(first.rig) | {"half": np.array(0.0)}, stated(second.rig) | {"half": np.array(1.0)}
    effects = plant.nothing(), plant.nothing() | {"arm": 8e-4, "lever": 4e-4}
    runs = jax.tree.map(
        lambda *both: np.stack(both),
        *(
            (run.angles, run.torque, run.force, rig, effect)
            for run, rig, effect in zip((first, second), rigs, effects, strict=True)
        ),
    )
    found = plant.side_by_side(*runs)
    for name, run, out in zip(("ref-1", "ref-2"), (first, second), found, strict=True):
        for j, column in enumerate(plant.columns(3)):
            error = np.sqrt(np.mean((out[:, j] - run.outputs[column]) ** 2))
            share = error / plant.NOISE[column.split("_")[0]]
            assert share < LIMITS.get(f"{name} {column}", 0.1), (name, column, share)


def stated(rig) -> dict:
    """A loaded rig in the plant's own words."""
    w, s = rig.wheels, rig.sphere
    words = {"R": s.radius, "M": s.mass, "I": np.asarray(s.inertia_matrix)[0, 0],
             "Ml": rig.platform.mass, "g": rig.platform.gravity, "normal": w.normal,
             "drive": w.drive, "r": w.radius, "m": w.mass, "Iw": w.inertia, "n": w.rollers[0],
             "eta": w.roundness[0], "half": 0.0, "wave": 0.0, "pivot": 0.0,
             "K": w.contact.stiffness, "C": w.contact.damping,
             "k": w.mount.stiffness, "c": w.mount.damping, "Kc": w.closure.stiffness,
             "N0": w.closure.preload, "mu": w.contact.friction}  # fmt: skip
    return {k: np.asarray(v, float) for k, v in words.items()}
