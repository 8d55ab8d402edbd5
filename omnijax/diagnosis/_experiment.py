"""The next experiment: the feasible drive under which two rivals differ most."""

import numpy as np

from ..dynamics import rolling, wheel_speeds  # noqa: F401
from ..simulate import simulate, table, torques

SECONDS, RATE = 5.0, 250.0


def feasible_drives(wheels: int, peak: np.ndarray, seconds: float = SECONDS):
    """Named torque histories (t, n) within the torques that the runs have shown."""
    t = np.linspace(0.0, seconds, int(seconds * 50) + 1)
    rise = np.clip(t / 0.5, 0, 1) * np.clip((seconds - t) / 0.5, 0, 1)
    drives = {}
    for k in range(wheels):
        one = np.zeros((len(t), wheels))
        one[:, k] = 0.5 * peak[k] * rise * np.sin(2 * np.pi * 0.4 * t)
        drives[f"wheel {k + 1} alone, slow reversals at half torque"] = one
    phase = 2 * np.pi * np.arange(wheels) / wheels
    slow = np.sin(2 * np.pi * 0.3 * t[:, None] + phase)
    fast = np.sin(2 * np.pi * (0.2 + 0.2 * t[:, None]) * t[:, None] + phase)
    drives["all wheels, slow reversals at 0.3 Hz"] = 0.5 * peak * rise[:, None] * slow
    drives["all wheels, sweep from 0.2 to 2 Hz at full torque"] = peak * rise[:, None] * fast
    drives["all wheels, gentle start and coasting"] = (
        np.where(t[:, None] < 1.5, 0.3, 0.0) * peak * rise[:, None]
    )
    return t, drives


def next_experiment(rigs, runs, noise) -> dict:
    """Simulates every feasible drive with both rivals; the drive with the largest difference."""
    peak = np.max([np.abs(r.torque).max(axis=0) for r in runs], axis=0)
    t, drives = feasible_drives(peak.size, peak)
    ts = np.linspace(0.0, SECONDS, int(SECONDS * RATE) + 1)
    best = {"drive": "", "separation": -1.0}
    rows = []
    for name, torque in drives.items():
        drive = torques(table(t, torque))
        a, b = (simulate(rig, drive, ts, rtol=1e-7) for rig in rigs)
        parts = {
            g: float(np.sqrt(np.mean(np.square(getattr(a, g) - getattr(b, g)))) / noise[g])
            for g in ("dR", "Omega", "a") if g in noise
        }  # fmt: skip
        separation = float(np.sqrt(sum(v**2 for v in parts.values())))
        rows.append({"drive": name, "separation": separation, "by_group": parts})
        if np.isfinite(separation) and separation > best["separation"]:
            best = {"drive": name, "separation": separation, "by_group": parts,
                    "torque": {"time": t[::5].tolist(), "values": torque[::5].tolist()},
                    }  # fmt: skip
    return {**best, "unit": "sigma, rms difference of the rivals", "compared": rows}
