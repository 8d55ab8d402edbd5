"""The plant of the benchmarks against noise-free trajectories of yet another program."""

import csv
import gzip
import importlib.util
from pathlib import Path

import numpy as np
from machines import shared

import omnijax

SAMPLES = 751  # 1.5 s


def load_plant():
    """`benchmarks/plant.py` as a module."""
    path = Path(__file__).parents[1] / "benchmarks" / "plant.py"
    spec = importlib.util.spec_from_file_location("plant", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_plant_agrees_with_a_reference_within_a_tenth_of_the_noise():
    plant, folder = load_plant(), shared("reference", "ref-1")
    with gzip.open(folder / "run-1.csv.gz", "rt") as file:
        header, *rows = csv.reader(file)
    column = dict(zip(header, np.array(rows[:SAMPLES], float).T, strict=True))
    torque = np.stack([column[f"torque_{i}"] for i in (1, 2, 3)], 1)
    force = np.stack([column.get(f"force_{a}", 0 * column["t"]) for a in "xyz"], 1)
    start = np.array([column[f"theta_{i}"][0] for i in (1, 2, 3)])
    rig = stated(omnijax.load_rig(folder / "rig.toml"))
    (out,) = np.asarray(
        plant.simulate(start[None], torque[None], force[None], rig, plant.nothing())
    )
    for j, name in enumerate(plant.columns(3)):
        error = np.sqrt(np.mean((out[:, j] - column[name]) ** 2))
        assert error < 0.1 * plant.NOISE[name.split("_")[0]], name


def stated(rig) -> dict:
    """A loaded rig in the plant's own words."""
    w, s = rig.wheels, rig.sphere
    words = {"R": s.radius, "M": s.mass, "I": np.asarray(s.inertia_matrix)[0, 0],
             "Ml": rig.platform.mass, "g": rig.platform.gravity, "normal": w.normal,
             "drive": w.drive, "r": w.radius, "m": w.mass, "Iw": w.inertia, "n": w.rollers[0],
             "eta": w.roundness[0], "half": 0.0, "K": w.contact.stiffness, "C": w.contact.damping,
             "k": w.mount.stiffness, "c": w.mount.damping, "Kc": w.closure.stiffness,
             "N0": w.closure.preload, "mu": w.contact.friction}  # fmt: skip
    return {k: np.asarray(v, float) for k, v in words.items()}
