# %% [markdown]
# # 4. Design
#
# **Question.** Which contact stiffness and damping shake the sphere least at these speeds, if
# neither may leave what the workshop can build?

# %%
import omnijax

STUDY = {
    "rig": "atlas",
    "drive": [{"speed": [3.0, 5.1, 7.3]}],
    "objective": {"metric": "rms"},
    "variable": [
        {"path": "contact.stiffness", "low": "60 kN/m", "high": "400 kN/m"},
        {"path": "contact.damping", "low": 30, "high": 600},
    ],
    "search": {"starts": 4},
}
design = omnijax.design(STUDY)
print(design)

# %% [markdown]
# The answer is compared with a grid of the same two variables.

# %%
grid = omnijax.sweep(
    "atlas",
    {"contact.stiffness": "log:60e3:400e3:5", "contact.damping": "log:30:600:5"},
    "rms",
    speeds=STUDY["drive"][0]["speed"],
)
best = grid["rms"].min()
print(f"best of the grid {1e6 * best:.2f} µm, design {1e6 * design.objective:.2f} µm")

# %% [markdown]
# **Answer.** The design beats every point of the grid, and it says which bounds hold it back.

# %%
assert design.objective <= best * (1 + 1e-6)
assert design.status == "optimal"
assert any("contact.stiffness" in sentence for sentence in design.active)
