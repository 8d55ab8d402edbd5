"""Where simulation and data disagree: lines in Hz and in orders, states, against a shuffled null.

Every question is a small set of orthonormal columns over the samples of one channel: the share is
how much of the residual's power lies in them.  Orders are looked up at the measured angle of every
sample, so they need no resampling and are not folded by the sampling rate.  The null shuffles and
signs blocks of the residual, which keeps its colour and breaks its tie to angle, speed or load.
"""

import dataclasses
from typing import Any

import numpy as np
from scipy.stats import beta

BLOCK = 0.25  # s
SHUFFLES = 60
RATE = 0.01  # false discoveries that are accepted
ORDERS = 40


@dataclasses.dataclass(frozen=True)
class Question:
    """One place to look: domain, value, what it refers to, and columns (samples, k)."""

    domain: str
    value: float
    reference: str
    columns: np.ndarray


def questions(time, angles: dict[str, np.ndarray], states: dict[str, np.ndarray]) -> list[Question]:
    """Lines in Hz up to half the sampling rate, orders of every angle, and bins of every state."""
    out = []
    length, step = time[-1] - time[0], time[1] - time[0]
    count = len(time)
    width = max(1, int(0.5 * length))  # bins of about half a hertz: a line in Hz stays in its bin
    for k in range(1, count // 2 - width, width):
        f = np.arange(k, k + width) / (count * step)
        phase = 2 * np.pi * np.outer(time, f)
        out.append(
            Question("frequency", float(f.mean()), "Hz", np.c_[np.cos(phase), np.sin(phase)])
        )
        if f.mean() > 60:
            break
    for name, angle in angles.items():
        for order in range(1, ORDERS + 1):
            out.append(
                Question(
                    "order", float(order), name, np.c_[np.cos(order * angle), np.sin(order * angle)]
                )
            )
    for name, values in states.items():
        domain, _, reference = name.partition(" ")
        out.append(Question(domain, float("nan"), reference, _bins(values)))
    return out


def _bins(values: np.ndarray, count: int = 12) -> np.ndarray:
    """Membership of `count` equally filled bins."""
    edges = np.unique(np.quantile(values, np.linspace(0, 1, count + 1)[1:-1]))
    index = np.searchsorted(edges, values)
    return np.eye(len(edges) + 1)[index]


def shares(residual: np.ndarray, asked: list[Question], seed: int = 0) -> list[dict[str, Any]]:
    """Share of the residual's power and its p-value for every question (1-D residual)."""
    power = float(residual @ residual)
    if power == 0:
        return []
    shuffled = shuffle(residual, seed)
    out = []
    for q in asked:
        basis, _ = np.linalg.qr(q.columns)
        share = float(np.sum((basis.T @ residual) ** 2)) / power
        null = np.sum((basis.T @ shuffled) ** 2, axis=0) / power
        out.append(
            {"domain": q.domain, "value": q.value, "reference": q.reference, "share": share,
             "p": p_value(share, null)}
        )  # fmt: skip
    return out


def shuffle(residual: np.ndarray, seed: int, block: int = 125, count: int = SHUFFLES) -> np.ndarray:
    """Block-shuffled copies (samples, count), every block with a random sign and a random shift."""
    rng = np.random.default_rng(seed)
    n = len(residual)
    out = np.empty((n, count))
    for c in range(count):
        rolled = np.roll(residual, rng.integers(n))
        pieces = np.array_split(rolled, max(1, n // block))
        order = rng.permutation(len(pieces))
        signs = rng.choice([-1.0, 1.0], len(pieces))
        out[:, c] = np.concatenate([signs[k] * pieces[k] for k in order])
    return out


def p_value(share: float, null: np.ndarray) -> float:
    """Probability of such a share under the null: a beta law of the null's mean and variance."""
    mean, variance = float(np.mean(null)), float(np.var(null, ddof=1))
    if not 0 < mean < 1 or variance <= 0:
        return 1.0
    size = max(mean * (1 - mean) / variance - 1, 1e-3)
    return float(beta.sf(min(share, 1.0), mean * size, (1 - mean) * size))


def discoveries(found: list[dict[str, Any]], rate: float = RATE) -> list[dict[str, Any]]:
    """Those that stand after Benjamini and Hochberg's control of the false-discovery rate."""
    ordered = sorted(found, key=lambda f: f["p"])
    m = len(ordered)
    keep = [k for k, f in enumerate(ordered) if f["p"] <= rate * (k + 1) / m]
    return ordered[: keep[-1] + 1] if keep else []


def locate(model, point, top: int = 12) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """(the strongest discoveries, all answers) of the residual at `point` on a held-out run."""
    i = model.splits["held-out"][0]
    (vector,) = model.machine.residuals([model.rig_at(point)], [i])
    machine, rows = model.machine, model.machine.rows[i]
    elastic, rotation = rows.split(vector)
    rig = model.rig_at(point)
    run, m = machine.runs[i], machine.rotated(rig, [i])[i].motion
    fine = (len(m.theta) - 1) // (run.samples - 1)
    theta, speed, turning = m.theta[::fine], m.speed[::fine], m.turning[::fine]
    drive = machine.rotated(rig, [i])[i].drive[::fine]
    names = rig.names
    angles = {n: theta[:, k] for k, n in enumerate(names)}
    size = np.linalg.norm(turning, axis=1)
    angles["sphere"] = np.concatenate([[0.0], np.cumsum((size[1:] + size[:-1]) / 2) * run.step])
    base_signals = machine.signals(
        rig, run, m, machine.ports(rig, run, m, machine.rotated(rig, [i])[i].drive)
    )
    deflection = base_signals[::fine, : rig.size]
    states: dict[str, np.ndarray] = {"time s": run.time}
    for k, n in enumerate(names):
        states[f"phase {n}"] = np.mod(theta[:, k], 2 * np.pi)
        states[f"speed {n}"] = np.abs(speed[:, k])
        states[f"direction {n}"] = np.sign(np.round(speed[:, k], 3))
        states[f"load {n}"] = drive[:, k]
        states[f"deflection {n}"] = deflection[:, k]
    asked = questions(run.time, angles, states)
    labels = [f"dR_{c}" for c in "xyz"] + [f"a_{c}" for c in "xyz"]
    labels += [f"Omega_{c}" for c in "xyz"] + [f"theta_{k + 1}" for k in range(rig.size)]
    everything = []
    for label, column in zip(labels, np.concatenate([elastic, rotation], axis=1).T, strict=True):
        if not column.any():
            continue
        rms = float(np.sqrt(np.mean(column**2)))
        for answer in shares(column, asked, seed=len(everything)):
            everything.append({"channel": label, "rms_over_noise": rms, **answer})
    stand = discoveries(everything)
    stand.sort(key=lambda f: -f["share"] * max(0.0, f["rms_over_noise"] ** 2 - 1))
    if not stand:  # a gap without a clear line: the likeliest places, their p-values say so
        stand = sorted(everything, key=lambda f: f["p"])[:3]
    return stand[:top], everything
