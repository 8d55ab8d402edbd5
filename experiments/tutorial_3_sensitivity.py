# %% [markdown]
# # 3. Sensitivities
#
# **Question.** Which of the machine's parameters decide how much the sphere shakes, and is the
# contact's stiffness one of them?

# %%
import omnijax

SPEEDS = [0.1, 1.2, 0.3]
found = omnijax.sensitivity("atlas", SPEEDS, ("rms", "elastic_rms"))
print(found)

# %% [markdown]
# Per cent of the metric per per cent of a parameter, all wheels together, largest first.

# %%
total = found.together("rms")
elastic = found.together("elastic_rms")
for path, value in list(total.items())[:5]:
    print(f"{path:24s} {value:+.3f} of RMS, {elastic[path]:+.3f} of the elastic part")
axes = found.plot_tornado("rms")

# %% [markdown]
# Parameters without any influence are named, so that nobody tunes them in vain.

# %%
for sentence in found.sentences():
    print(sentence)

# %% [markdown]
# **Answer.** The wheel's geometry decides: roundness, radius and the number of rollers. The
# contact's stiffness matters many times more to the elastic part than to the whole motion.

# %%
assert next(iter(total)).endswith(("roundness", "rollers"))
stiffness = next(path for path in total if path.endswith("contact.stiffness"))
assert abs(elastic[stiffness]) > 3 * abs(total[stiffness])
assert any("friction" in sentence for sentence in found.sentences())
