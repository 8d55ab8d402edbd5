# %% [markdown]
# # 2. A sweep
#
# **Question.** The paper says that the vibration grows with the roundness ratio, and that the
# contact's stiffness is "dominant" in one place and of little influence in another. What does a
# whole map say?

# %%
import numpy as np

import omnijax

result = omnijax.sweep(
    "atlas",
    {"wheel.roundness": "0.1:0.6:6", "contact.stiffness": "log:5e4:1e6:5"},
    ("peak", "rms", "elastic_rms"),
    speeds=[0.1, 1.2, 0.3],
)
print(result)
print(result.to_xarray())

# %% [markdown]
# One figure for the map, one for the family of curves.

# %%
axes = result.plot_heatmap("peak")
axes = result.plot_lines("elastic_rms")

# %% [markdown]
# **Answer.** The peak grows with the roundness ratio at every stiffness, as the depth of the
# gap does. A factor of twenty in stiffness changes the peak by less than half, but the elastic part
# of the motion, the small remainder, changes up to sixfold. Both sentences of the paper are
# true, of different figures.

# %%
assert result.counts()["ok"] == result.size == 30
data = result.to_xarray()
peak = data["peak"].transpose("wheel.roundness", "contact.stiffness").values
elastic = data["elastic_rms"].transpose("wheel.roundness", "contact.stiffness").values
assert np.all(np.diff(peak, axis=0) > 0)
assert np.all(peak.max(axis=1) / peak.min(axis=1) < 1.5)
assert np.all(elastic.max(axis=1) / elastic.min(axis=1) > 2)
assert np.max(elastic.max(axis=1) / elastic.min(axis=1)) > 5
