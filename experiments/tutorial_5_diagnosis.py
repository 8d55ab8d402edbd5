# %% [markdown]
# # 5. Diagnosis of your own measurement
#
# **Question.** The machine shakes otherwise than its simulation. Which effect did the model leave
# out, where, and how large is it?
#
# A case is a folder with the rig file, as you know the machine, and recordings of two or more runs:
# motor torques, wheel angles, the sphere's displacement. Here a simulated machine with a wheel that
# runs out of true writes the files; put your own in their place and keep the rest.

# %%
import dataclasses
import tempfile
from pathlib import Path

import jax.numpy as jnp
import numpy as np

import omnijax
from omnijax.laws import WheelRunout
from omnijax.simulation import table, to_recording

NOISE = {"dR": 2e-6, "theta": 1e-4, "Omega": 1e-4, "a": 5e-3}  # 1 sigma of the sensors, SI
folder = Path(tempfile.mkdtemp()) / "my-machine"
folder.mkdir()
known = omnijax.load_rig("atlas-tripod")
omnijax.save_rig(known, folder / "rig.toml")
machine = known.add(WheelRunout(amplitude=jnp.asarray(6e-5), phase=jnp.asarray(0.7)), "w2")
time = np.arange(0.0, 4.0, 2e-3)
for number in (1, 2, 3):
    rng = np.random.default_rng(number)
    steps = 0.15 * rng.uniform(-1, 1, (6, 3))
    steps[0] = 0.25, 0.2, -0.25
    drive = omnijax.torques(table(np.linspace(0.0, 4.0, 6), steps))
    run = omnijax.simulate(machine, drive, time)
    path = folder / f"run-{number}.csv.gz"
    recording = to_recording(run, path, machine, folder / "rig.toml")
    measured = {
        name: values + NOISE.get(name.rsplit("_", 1)[0], 0.0) * rng.standard_normal(len(time))
        for name, values in recording.channels.items()
    }
    role = "held-out" if number == 3 else "train"
    omnijax.write_recording(
        path, dataclasses.replace(recording, channels=measured, noise=NOISE, role=role)
    )
print(*sorted(path.name for path in folder.iterdir()))

# %% [markdown]
# One call; `omnijax diagnose my-machine --out answer` does the same and writes the report.

# %%
found = omnijax.diagnose(folder)
print(found)

# %% [markdown]
# **Answer.** The runout of wheel w2, with its size and its standard deviation; what is left on the
# run that was held out is the sensors' noise. The rig with the effect simulates like any other.

# %%
(effect,) = found.effects
amplitude = effect.parameters["amplitude"]
print(f"{effect.id} at {effect.place}: {1e6 * amplitude['value']:.1f} µm")
assert (found.verdict, effect.id, effect.place) == ("named", "wheel-runout", "w2")
assert abs(amplitude["value"] - 6e-5) < 4 * amplitude["sigma"]
assert found.gap["dR"].after < 1.2 * found.gap["dR"].noise_floor
print(omnijax.evaluate(omnijax.simulate(found.rig, drive, time[:500]), found.rig, ("peak", "rms")))
