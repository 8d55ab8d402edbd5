"""Where simulation and data disagree: lines in Hz and in orders, states, against a shuffled null.

Every question is a small orthonormal set of columns over the samples of one channel: the share is
how much of the residual's power lies in them.  Lines in Hz are looked for up to half the sampling
rate; one beyond it shows at its mirror frequency, which the answer says.  Orders are looked up at
the measured angle of every sample, so the sampling rate does not fold them.  The null shuffles and
signs blocks of the residual, which keeps its colour and breaks its tie to angle, speed or load.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import beta

SHUFFLES = 60
RATE = 0.01  # false discoveries that are accepted
ORDERS = 40
WIDTH = 0.5  # Hz, of a band: a line that stays put stays in it


@dataclasses.dataclass(frozen=True)
class Question:
    """One place to look: domain, value, what it refers to.

    `columns` (samples, k) are orthonormal; a band of lines in Hz has none, but `band`, its indices
    among the Fourier frequencies.
    """

    domain: str
    value: float
    reference: str
    columns: np.ndarray | None = None
    band: tuple[int, int] = (0, 0)

    @property
    def size(self) -> int:
        """Number of columns."""
        return 2 * (self.band[1] - self.band[0]) if self.columns is None else self.columns.shape[1]


def questions(time, angles: dict[str, np.ndarray], states: dict[str, np.ndarray]) -> list[Question]:
    """Bands up to half the sampling rate, orders of every angle, and bins of every state."""
    count, step = len(time), time[1] - time[0]
    width = max(1, round(WIDTH * count * step))
    out = []
    for k in range(1, (count - 1) // 2, width):
        end = min(k + width, (count - 1) // 2 + 1)
        middle = (k + end - 1) / 2 / (count * step)
        out.append(Question("frequency", middle, "Hz", band=(k, end)))
    orders = np.arange(1, ORDERS + 1)
    for name, angle in angles.items():
        phase = np.outer(orders, angle)
        pairs = np.linalg.qr(np.stack([np.cos(phase), np.sin(phase)], axis=2))[0]
        out += [Question("order", float(k), name, q) for k, q in zip(orders, pairs, strict=True)]
    for name, values in states.items():
        domain, _, reference = name.partition(" ")
        out.append(Question(domain, float("nan"), reference, _bins(values)))
    return out


def _bins(values: np.ndarray, count: int = 12) -> np.ndarray:
    """Membership of `count` equally filled bins, orthonormal."""
    edges = np.unique(np.quantile(values, np.linspace(0, 1, count + 1)[1:-1]))
    member = np.eye(len(edges) + 1)[np.searchsorted(edges, values)]
    member = member[:, member.any(axis=0)]
    return member / np.sqrt(member.sum(axis=0))


class Asked:
    """Questions gathered for many residuals: one product and one Fourier transform answer all."""

    def __init__(self, asked: Sequence[Question]):
        self.questions = list(asked)
        self.plain = [q for q in asked if q.columns is not None]
        self.bands = [q for q in asked if q.columns is None]
        columns = [q.columns for q in asked if q.columns is not None]
        self.columns = np.concatenate(columns, 1) if columns else None
        self.starts = np.cumsum([0, *(q.size for q in self.plain)])[:-1]

    def powers(self, residuals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Power of the plain questions and of the bands, of residuals (samples, m)."""
        plain = np.zeros((0, residuals.shape[1]))
        if self.columns is not None:
            plain = np.add.reduceat((self.columns.T @ residuals) ** 2, self.starts, axis=0)
        if not self.bands:
            return plain, np.zeros((0, residuals.shape[1]))
        spectrum = np.abs(np.fft.rfft(residuals, axis=0)) ** 2 * (2 / len(residuals))
        total = np.concatenate([np.zeros((1, residuals.shape[1])), np.cumsum(spectrum, axis=0)])
        ends = np.array([q.band for q in self.bands])
        return plain, total[ends[:, 1]] - total[ends[:, 0]]


def shares(
    residual: np.ndarray, asked: Sequence[Question] | Asked, seed: int = 0
) -> list[dict[str, Any]]:
    """Share of the residual's power and its p-value for every question (1-D residual)."""
    power = float(residual @ residual)
    if power == 0:
        return []
    asked = asked if isinstance(asked, Asked) else Asked(asked)
    found = asked.powers(np.concatenate([residual[:, None], shuffle(residual, seed)], axis=1))
    out = []
    for group, rows in zip((asked.plain, asked.bands), found, strict=True):
        for q, row in zip(group, rows / power, strict=True):
            out.append({"domain": q.domain, "value": q.value, "reference": q.reference,
                        "share": float(row[0]), "p": p_value(float(row[0]), row[1:])})  # fmt: skip
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
    """Those that stand, with the rate of false discoveries shared by lines, orders and states.

    There are far more lines than states: asked together they would drown what hangs on a state.
    """
    kinds: dict[str, list[dict[str, Any]]] = {}
    for f in found:
        kind = f["domain"] if f["domain"] in ("frequency", "order") else "state"
        kinds.setdefault(kind, []).append(f)
    return [f for asked in kinds.values() for f in _standing(asked, rate / len(kinds))]


def _standing(found: list[dict[str, Any]], rate: float) -> list[dict[str, Any]]:
    """Those that stand after Benjamini and Yekutieli's control of the false-discovery rate.

    The questions overlap (an order is a line where the speed is steady), so they depend on each
    other in any way: the rate is divided by 1 + 1/2 + ... + 1/m.
    """
    ordered = sorted(found, key=lambda f: f["p"])
    m = len(ordered)
    rate = rate / float(np.sum(1 / np.arange(1, m + 1))) if m else rate
    keep = [k for k, f in enumerate(ordered) if f["p"] <= rate * (k + 1) / m]
    return ordered[: keep[-1] + 1] if keep else []


def locate(model, point, top: int = 12) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """`discovered` of the residual of a rig's model at `point` on a held-out run."""
    i = model.splits["held-out"][0]
    machine, rig = model.machine, model.rig_at(point)
    (vector,) = machine.residuals([rig], [i])
    tables = np.concatenate(machine.rows[i].split(vector), axis=1)
    labels = [f"dR_{c}" for c in "xyz"] + [f"a_{c}" for c in "xyz"]
    labels += [f"Omega_{c}" for c in "xyz"] + [f"theta_{k + 1}" for k in range(rig.size)]
    columns = dict(zip(labels, tables.T, strict=True))
    return discovered(machine.runs[i].time, columns, *_signals(machine, rig, i), top=top)


def discovered(
    time: np.ndarray,
    columns: dict[str, np.ndarray],
    angles: dict[str, np.ndarray],
    states: dict[str, np.ndarray],
    top: int = 12,
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """(the strongest discoveries, all answers) of residuals by channel, in sigma.

    Every answer says whether it `stands`; where none does, the likeliest three are returned so
    marked.
    """
    asked, everything, step = Asked(questions(time, angles, states)), [], time[1] - time[0]
    for label, column in columns.items():
        if not column.any():
            continue
        rms = float(np.sqrt(np.mean(column**2)))
        for answer in shares(column, asked, seed=len(everything)):
            mirror = 1 / step - answer["value"] if answer["domain"] == "frequency" else None
            everything.append(
                {"channel": label, "rms_over_noise": rms, **answer, "mirror": mirror,
                 "stands": False}
            )  # fmt: skip
    stand = discoveries(everything)
    for answer in stand:
        answer["stands"] = True
    stand.sort(key=lambda f: -f["share"] * max(0.0, f["rms_over_noise"] ** 2 - 1))
    return (stand or sorted(everything, key=lambda f: f["p"])[:3])[:top], everything


def _signals(machine, rig, i: int) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Angles of the wheels and of the sphere, and the states, at the samples of run `i`."""
    run, rotated = machine.runs[i], machine.rotated(rig, [i])[i]
    m = rotated.motion
    fine = (len(m.theta) - 1) // (run.samples - 1)
    theta, speed, turning = m.theta[::fine], m.speed[::fine], m.turning[::fine]
    angles = {n: theta[:, k] for k, n in enumerate(rig.names)}
    size = np.linalg.norm(turning, axis=1)
    angles["sphere"] = np.concatenate([[0.0], np.cumsum((size[1:] + size[:-1]) / 2) * run.step])
    felt = machine.signals(rig, i, machine.ports(rig, run, m, rotated.drive))
    states: dict[str, np.ndarray] = {"time s": run.time}
    for k, n in enumerate(rig.names):
        states[f"phase {n}"] = np.mod(theta[:, k], 2 * np.pi)
        states[f"speed {n}"] = np.abs(speed[:, k])
        states[f"direction {n}"] = np.sign(np.round(speed[:, k], 3))
        states[f"load {n}"] = rotated.drive[::fine, k]
        states[f"deflection {n}"] = felt[::fine, k]
    return angles, states
