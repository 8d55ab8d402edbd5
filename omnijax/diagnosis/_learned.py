"""A learned, uninterpreted term on one port: smooth functions of what that port feels.

Where no known effect closes the gap, the port whose free-form term closes most of it on held-out
runs is the place to look.  The term is linear in its coefficients (ridge), its signals are those
of the corrected trajectory, and its curve is a drawing, not a law.
"""

import dataclasses
from collections.abc import Callable

import numpy as np

from ._elastic import law_outputs
from ._modes import hold_weights, moments, observe, propagate
from ._rig_model import RigModel
from ._runs import FINE
from ._signatures import THIN, _torque

ROUNDS = 4


@dataclasses.dataclass(frozen=True)
class Learned:
    """The learned term: its port, how much it closes, and coefficients by (wheel, input)."""

    port: str
    closed: float
    names: list[tuple[str, str]]
    coefficients: np.ndarray
    scales: np.ndarray
    residual: np.ndarray  # held-out rows after the term
    curves: dict[str, tuple[np.ndarray, np.ndarray]]
    units: tuple[str, str]


def _spring_inputs(deflection, rate, names, letter):
    """Inputs of a spring's free-form term: every wheel's deflection and rate, powers of its own."""
    n = deflection.shape[1]
    out = {}
    size = np.sqrt(np.mean(deflection**2)) or 1.0
    for j in range(n):
        out[f"{letter} of {names[j]}"] = deflection[:, j] / size
        out[f"rate of {letter} of {names[j]}"] = rate[:, j] / (np.sqrt(np.mean(rate**2)) or 1.0)
    own = deflection / size
    return out, {
        "square": own**2, "cube": own**3, "|x| x": np.abs(own) * own, "fifth": own**5,
    }  # fmt: skip


def _spring_columns(base, port, extra):
    """Inputs of a contact or mount term: names, and (wheel, signal) corrected by `extra`."""
    n, names = base.rig.size, base.rig.names
    signals = base.contact if port == "contact" else base.mount
    deflection, rate = signals.deflection, signals.rate
    if extra is not None:
        deflection, rate = deflection + extra[port][0], rate + extra[port][1]
    shared, own = _spring_inputs(deflection, rate, names, "δ" if port == "contact" else "Δ")
    labels, forces = [], []
    for i in range(n):
        for label, x in shared.items():
            labels.append((names[i], label))
            forces.append((i, x))
        for label, x in own.items():
            labels.append((names[i], label))
            forces.append((i, x[:, i]))
    return labels, forces


def _push(base, port, force) -> np.ndarray:
    """dR and a of a tension (FINE points, n), from its static rest."""
    zero = np.zeros_like(force)
    pair = (force, zero) if port == "contact" else (zero, force)
    return law_outputs(base.modes, base.run, *pair, _rest(base, *pair))


def _rest(base, contact, mount):
    m = base.modes
    u = np.zeros(m.B.shape[1])
    u[m.inputs["contact"]], u[m.inputs["mount"]] = contact[0], mount[0]
    return -np.linalg.solve(m.A, m.B @ u)


def _felt(base, port, force):
    """What a tension changes in the deflections and rates at the ports, (FINE points, n) each."""
    m, run = base.modes, base.run
    weights = hold_weights(m.rates, run.step / FINE, 1)
    columns = m.gains[:, m.inputs[port]]
    total = sum(moments(force[:, c], weights) * columns[:, c] for c in range(force.shape[1]))
    pair = (force, 0 * force) if port == "contact" else (0 * force, force)
    z = propagate(m, run.step / FINE, total, m.inverse @ _rest(base, *pair))
    names = ("deflection", "mount", "mount_rate", "approach_rate")
    d, mount, mount_rate, approach_rate = np.split(observe(m, z, names), 4, axis=1)
    return {"contact": (d, approach_rate - mount_rate), "mount": (mount, mount_rate)}


def _shaft_columns(base):
    """Free-form shaft torques: of speed, command and angle of each wheel."""
    s, torque = base.slow, base.torque[::THIN]
    labels, forces = [], []
    for i, name in enumerate(base.rig.names):
        w = s.speed[:, i]
        terms = {
            "ω": w, "sign of ω": np.tanh(w / 0.05), "ω|ω|": w * np.abs(w), "ω cubed": w**3,
            "command": torque[:, i], "constant": np.ones_like(w),
        }  # fmt: skip
        for k in range(1, 5):
            terms[f"sin {k}θ"], terms[f"cos {k}θ"] = (
                np.sin(k * s.theta[:, i]),
                np.cos(k * s.theta[:, i]),
            )
        for label, x in terms.items():
            force = np.zeros_like(s.speed)
            force[:, i] = x
            labels.append((name, label))
            forces.append(force)
    return labels, forces


def learn(model: RigModel, fit, tell: Callable[[str], None]) -> Learned:
    """The port and free-form term that close most of the held-out gap beside `fit`'s baseline."""
    best = None
    for port in ("contact", "mount", "shaft"):
        found = _learn_at(model, fit, port)
        tell(f"learned term at {port}: closes {100 * found.closed:.0f} % of the held-out gap")
        if best is None or found.closed > best.closed:
            best = found
    assert best is not None
    return best


def _learn_at(model: RigModel, fit, port: str) -> Learned:
    bases = {s: model.bases(fit.point, s) for s in ("train", "held-out")}
    rest = {s: model.residuals([fit.point], s)[0] for s in bases}
    tangents = {"train": fit.jacobian[:, : len(model.priors)],
                "held-out": _baseline_tangents(model, fit, "held-out")}  # fmt: skip
    extra = {s: [None] * len(b) for s, b in bases.items()}
    for _ in range(ROUNDS if port != "shaft" else 1):
        labels, columns, forces = _all_columns(model, bases, extra, port)
        weights, shift = _ridge(columns["train"], tangents["train"], rest["train"], fit.point.u)
        if port == "shaft":
            break
        for s, group in bases.items():
            for k, base in enumerate(group):
                total = np.zeros_like(base.motion.theta)
                for (i, x), w in zip(forces[s][k], weights, strict=True):
                    total[:, i] += w * x
                extra[s][k] = _felt(base, port, total)
    after = rest["held-out"] - columns["held-out"] @ weights - tangents["held-out"] @ shift
    before = float(rest["held-out"] @ rest["held-out"])
    dof = model.dof("held-out")
    closed = (before - float(after @ after)) / max(before - dof, 1.0)
    curves = _curves(model, labels, weights, port)
    units = (
        ("deflection, rms", "tension, N") if port != "shaft" else ("speed, rad/s", "torque, N m")
    )
    return Learned(port, closed, labels, weights, np.ones(len(weights)), after, curves, units)


def _all_columns(model, bases, extra, port):
    columns, forces, labels = {}, {}, []
    for s, group in bases.items():
        parts, kept = [], []
        for base, more in zip(group, extra[s], strict=True):
            rows = model.machine.rows[base.index]
            if port == "shaft":
                labels, torques = _shaft_columns(base)
                tables = [_torque(base, shaft=x) for x in torques]
                kept.append(None)
            else:
                labels, items = _spring_columns(base, port, more)
                tables = []
                for i, x in items:
                    force = np.zeros_like(base.motion.theta)
                    force[:, i] = x
                    tables.append((_push(base, port, force), None))
                kept.append(items)
            stacked = np.stack([rows.vector(*t) for t in tables], axis=1)
            parts.append(rows.project(stacked))
        columns[s], forces[s] = np.concatenate(parts), kept
    return labels, columns, forces


def _baseline_tangents(model, fit, split):
    from ._model import Point

    (residual,) = model.residuals([fit.point], split)
    P = len(fit.point.u)
    points = [Point(fit.point.u + 1e-3 * e, fit.point.effects) for e in np.eye(P)]
    found = model.residuals(points, split) if P else []
    return (
        np.stack([(r - residual) / 1e-3 for r in found], 1) if P else np.zeros((len(residual), 0))
    )


def _ridge(columns, tangents, rest, u):
    """Coefficients of the term and the shift of the baseline, by ridge on scaled columns.

    `columns` are predicted changes, `tangents` changes of the residual: their signs differ.
    """
    scale = np.linalg.norm(columns, axis=0)
    scale[scale == 0] = 1.0
    both = np.concatenate([columns / scale, tangents], axis=1)
    k, P = columns.shape[1], tangents.shape[1]
    gram = both.T @ both
    right = both.T @ rest
    ridge = np.concatenate([np.full(k, 1e-6), np.ones(P)])
    right[k:] += u
    x = np.linalg.solve(gram + np.diag(ridge), right)
    return x[:k] / scale, x[k:]


def _curves(model, labels, weights, port):
    """Force over the wheel's own input, by wheel: a drawing of the learned term."""
    x = np.linspace(-2.5, 2.5, 101)
    shapes = {"square": x**2, "cube": x**3, "|x| x": np.abs(x) * x, "fifth": x**5,
              "ω": 4 * x, "sign of ω": np.tanh(4 * x / 0.05), "ω|ω|": 16 * x * np.abs(x),
              "ω cubed": 64 * x**3}  # fmt: skip
    letter = "δ" if port == "contact" else "Δ"
    curves = {}
    for name in model.rig.names:
        total = np.zeros_like(x)
        for (wheel, label), w in zip(labels, weights, strict=True):
            if wheel == name:
                total = total + w * shapes.get(
                    label, x if label == f"{letter} of {name}" else 0 * x
                )
        curves[name] = (4 * x if port == "shaft" else x, total)
    return curves
