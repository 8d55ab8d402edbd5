"""The product's flows with every annotated shape checked at every call; a program of its own.

`python tests/every_shape.py FOLDER [FLOW ...]`: the check has to stand before omnijax is imported,
and slows what is traced, so that it does not stand over the whole suite.
"""

import os
import sys
import time
from pathlib import Path

os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("JAX_PLATFORMS", "cpu")

from jaxtyping import install_import_hook

CHECKED = ("laws", "rig", "recording", "dynamics", "simulation", "vibration", "study")
install_import_hook([f"omnijax.{name}" for name in CHECKED], "shapes.checked")

import jax
import numpy as np

import omnijax
from omnijax.cli._frame import run
from omnijax.rig import InputError
from omnijax.simulation import simulate_many
from omnijax.vibration import METRICS, modes, natural_frequencies

SPEEDS = {"ballbot": [3.0, -2.0, 1.0], "four-wheel": [3.0, 1.0, -2.0, 0.5]}


def command(*words):
    """One command; it must succeed."""
    assert run([str(word) for word in words]) == 0, words


def rig_file(folder, example):
    path = folder / f"{example}.toml"
    if not path.exists():
        command("init", path, "--example", example)
    return path


def runs(folder):
    """A run by speeds and one by torques: figures, files, orders."""
    for example, values in SPEEDS.items():
        rig = omnijax.load_rig(rig_file(folder, example))
        run = omnijax.simulate(rig, values, "0.3 s")
        omnijax.evaluate(run, rig, tuple(METRICS))
        assert run.summary()
        run.save(folder / f"{example}.nc")
        again = omnijax.load_run(folder / f"{example}.nc")
        np.testing.assert_array_equal(again.dR, run.dR)
        omnijax.evaluate(again, rig, "rms")
        again.to_xarray()
        omnijax.order_track(again)
        omnijax.rpm_order_map(again)


def torques(folder):
    """Runs under motor torques, one by one and in bulk, and their slopes."""
    rig = omnijax.load_rig(rig_file(folder, "ballbot"))
    drive = omnijax.torques([0.02, 0.01, 0.0])
    ts = np.arange(21) / 500
    run = omnijax.simulate(rig, drive, ts)
    omnijax.evaluate(run, rig, "rms")
    stiffer = omnijax.set_parameter(rig, "contact.stiffness", "300 kN/m")
    both = jax.tree.map(lambda *leaves: np.stack(leaves), rig, stiffer)
    simulate_many(both, drive, ts)

    def rms(mass):
        moved = omnijax.set_parameter(rig, "sphere.mass", mass)
        return omnijax.evaluate(omnijax.simulate(moved, drive, ts), moved, "rms")["rms"]

    assert np.isfinite(jax.grad(rms)(float(rig.sphere.mass)))


def steady(folder):
    """Steady states, modes and what the wheels can drive."""
    for example, values in SPEEDS.items():
        path = rig_file(folder, example)
        rig = omnijax.load_rig(path)
        state = omnijax.steady_state(rig, values)
        assert np.isfinite(state.rms)
        modes(rig)
        natural_frequencies(rig)
        command("check", path)
        words = ",".join(str(x) for x in values)
        command("orders", path, f"--speed={words}", "--out", folder / f"{example}-orders.html")


def sweeps(folder):
    """Sweeps by closed forms and by steps, in a store and in memory, with gradients."""
    path = rig_file(folder, "ballbot")
    vary = ["--vary", "contact.stiffness=1e5,2e5,4e5", "--metric", "rms,peak"]
    command("sweep", path, *vary, "--speed", "3,-2,1", "--duration", "0.2s",
            "--out", folder / "swept", "--gradient")  # fmt: skip
    command("sweep-status", folder / "swept")
    command("export", folder / "swept", folder / "swept.csv")
    command("sweep", path, *vary, "--speed", "3,-2,1", "--steady")
    command("sweep", path, *vary, "--torque", "0.02,0.01,0", "--duration", "0.04s")
    command("sensitivity", path, "--speed", "3,-2,1", "--metric", "rms,peak", "--check")


def studies(folder):
    """Designs, fronts, tolerances and global studies, from the templates."""
    path = rig_file(folder, "ballbot")
    for kind, short in {
        "design": [],
        "tolerances": ["--draws", "64"],
        "global-sensitivity": ["--metric", "rms"],
        "pareto": [],
    }.items():
        study = folder / f"{kind}.toml"
        command("init", study, "--study", kind, "--rig", path)
        text = study.read_text().replace("points = 6", "points = 1").replace("64 ", "8 ")
        study.write_text(text)
        command(kind, study, *short, "--report", folder / f"{kind}.html")


def refusals(folder):
    """The check itself: a wrong shape is an error of the checker, not of the user."""
    rig = omnijax.load_rig(rig_file(folder, "ballbot"))
    try:
        omnijax.propagate(rig, omnijax.speeds([1.0, 2.0, 3.0]), np.zeros((2, 3)))
    except InputError:
        raise
    except Exception as error:
        assert "type" in type(error).__name__.lower(), error
        return
    raise AssertionError("sample times of two axes were taken")


FLOWS = {f.__name__: f for f in (runs, torques, steady, sweeps, studies, refusals)}

if __name__ == "__main__":
    for name in sys.argv[2:] or FLOWS:
        begun = time.process_time()
        FLOWS[name](Path(sys.argv[1]))
        print(f"shapes hold: {name}, {time.process_time() - begun:.0f} CPU s", flush=True)
