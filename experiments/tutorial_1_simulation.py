# %% [markdown]
# # 1. First simulation
#
# **Question.** How far does the Atlas sphere shake when its wheels turn at 0.6, 1.2 and 0.9 rad/s,
# and which roller passings does the shaking come from?

# %%
import jax.numpy as jnp
import numpy as np

import omnijax

rig = omnijax.load_rig("atlas")
print(rig.names, "gap depth", 1e6 * rig.gaps.depth, "µm")

# %% [markdown]
# Two seconds from rest, with the wheel speeds prescribed.

# %%
drive = omnijax.speeds([0.6, 1.2, 0.9])
run = omnijax.simulate(rig, drive, jnp.linspace(0.0, 2.0, 1001))
print(run)
metrics = {
    k: float(v) for k, v in omnijax.evaluate(run, rig, ("peak", "rms", "elastic_rms")).items()
}
print({name: f"{1e6 * value:.1f} µm" for name, value in metrics.items()})

# %% [markdown]
# In the long run the same drive has a closed form: no time stepping, and the supremum over all
# phases of the wheels instead of the largest sample.

# %%
steady = omnijax.steady_state(rig, jnp.array([0.6, 1.2, 0.9]))
print(steady)
axes = steady.plot_orders()

# %% [markdown]
# **Answer.** The sphere moves by about one and a half gap depths at most. Almost all of it follows
# the wheels' shape; the elastic part is an order of magnitude smaller. The strongest lines are the
# first few roller passings (multiples of 14).

# %%
assert run.ok
depth = float(rig.gaps.depth[0])
assert depth < metrics["peak"] <= float(steady.peak) < np.sqrt(3) * depth * 1.2
assert metrics["elastic_rms"] < 0.2 * metrics["rms"]
strength = np.linalg.norm(np.abs(np.asarray(steady.spectrum)), axis=-1)
strength[np.asarray(steady.order) == 0] = 0.0  # the mean is no vibration
assert np.asarray(steady.order).ravel()[strength.argmax()] in (14.0, 28.0, 42.0)
