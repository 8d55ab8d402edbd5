"""Noise-free trajectories of a separate program, every channel."""

import csv
import gzip
import tomllib

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from machines import shared

import omnijax
from omnijax.simulation import simulate, table, torques


@pytest.mark.parametrize("name", ["ref-1", "ref-2"])
def test_agrees_with_a_separate_program(name):
    folder = shared("reference", name)
    with gzip.open(folder / "run-1.csv.gz", "rt") as file:
        header, *rows = csv.reader(file)
    column = dict(zip(header, np.array(rows, float).T, strict=True))
    assert tomllib.loads((folder / "rig.toml").read_text())["wheel"]
    rig = omnijax.load_rig(folder / "rig.toml")
    t = column["t"]
    force = np.zeros((len(t), 3))
    if "force_x" in column:
        force = np.stack([column[f"force_{a}"] for a in "xyz"], 1)
    torque = np.stack([column[f"torque_{i}"] for i in (1, 2, 3)], 1)
    start = [column[f"theta_{i}"][0] for i in (1, 2, 3)]
    drive = torques(table(t, torque), table(t, force), start)
    run = eqx.filter_jit(simulate)(rig, drive, jnp.asarray(t))
    assert run.ok
    outputs = {f"theta_{i + 1}": run.theta[:, i] for i in range(3)}
    for group in ("Omega", "dR", "a"):
        outputs |= {f"{group}_{a}": getattr(run, group)[:, i] for i, a in enumerate("xyz")}
    worst = {
        key: float(np.max(np.abs(value - column[key])) / np.ptp(column[key]))
        for key, value in outputs.items()
    }
    assert max(worst.values()) < 1e-4, worst
    assert float(jnp.min(run.normal_force)) > 0
