"""Recordings for tests: a short, noisy run of three wheels in a file, and ways to spoil it."""

import gzip

import numpy as np

STEP = 2e-3


def columns(samples=600, seed=1, rolling_from=200):
    """Columns of a run that rests first; nothing here needs to obey the equations of motion."""
    rng = np.random.default_rng(seed)
    t = STEP * np.arange(samples)
    since = np.maximum(t - STEP * rolling_from, 0.0)
    table = {"t": t}
    for i in range(3):
        table[f"torque_{i + 1}"] = np.where(since > 0, 0.1 + 0.01 * i, 0.0)
    for i in range(3):
        table[f"theta_{i + 1}"] = 0.3 * i + (1 + i) * since**2 + 1e-4 * rng.standard_normal(samples)
    for i, axis in enumerate("xyz"):
        table[f"dR_{axis}"] = 1e-4 * np.sin((3 + i) * since) + 2e-6 * rng.standard_normal(samples)
    return table


def write(path, table, sidecar=None):
    """Write a table as text, numbers with nine digits; `sidecar` is the text of NAME.toml."""
    rows = zip(*table.values(), strict=True)
    lines = [",".join(x if isinstance(x, str) else f"{x:.9g}" for x in row) for row in rows]
    text = "\n".join([",".join(table), *lines]) + "\n"
    if path.suffix == ".gz":
        path.write_bytes(gzip.compress(text.encode()))
    else:
        path.write_text(text, encoding="utf-8")
    if sidecar is not None:
        path.with_name(path.name.split(".")[0] + ".toml").write_text(sidecar, encoding="utf-8")
    return path
