"""A learned, uninterpreted term on one port, where no known effect closes the gap.

At every port a smooth basis, linear in its coefficients, is fitted together with the baseline; the
port whose term closes most of the held-out gap is the place to look.  There a small network joins
the basis, fitted by Gauss-Newton through the same transfer; it is kept where held-out runs gain by
it.  Either is a drawing, not a law.
"""

import dataclasses
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from ._learned_ports import ShaftPort, SpringPort
from ._model import Point
from ._rig_model import RigModel

ROUNDS, INNER, HIDDEN = 5, 5, 6
FAR = 10.0  # RMS: beyond that a term is not followed
KEPT = 0.01  # share of the held-out gap that the network has to add
RIDGE = {"basis": 1e-6, "network": 1e-3}  # on columns of length 1


@dataclasses.dataclass(frozen=True)
class Term:
    """Weights of the smooth basis, and a network beside it (or None): forces from scaled inputs."""

    port: SpringPort | ShaftPort
    scales: np.ndarray
    weights: np.ndarray
    network: eqx.nn.MLP | None = None
    size: float = 1.0  # of the network's output

    def force(self, u: np.ndarray) -> np.ndarray:
        """Forces (t, n) at scaled inputs (t, k)."""
        out = np.zeros((len(u), len(self.port.wheels)))
        for (i, _, x), w in zip(self.port.columns(u), self.weights, strict=True):
            out[:, i] += w * x
        if self.network is not None:
            out += self.size * np.asarray(_network(self.network, u))
        return out

    def tangents(self, u: np.ndarray) -> list[np.ndarray]:
        """Forces (t, n) per unit of every weight."""
        out = []
        for i, _, x in self.port.columns(u):
            out.append(np.zeros((len(u), len(self.port.wheels))))
            out[-1][:, i] = x
        if self.network is not None:
            J = np.asarray(_network_tangents(self.network, u))
            out += [self.size * J[:, :, k] for k in range(J.shape[2])]
        return out

    def moved(self, step: np.ndarray) -> "Term":
        """The term with its weights changed."""
        k = len(self.weights)
        network = self.network
        if network is not None:
            arrays, rest = eqx.partition(network, eqx.is_array)
            flat, unravel = ravel_pytree(arrays)
            network = eqx.combine(unravel(flat + jnp.asarray(step[k:])), rest)
        return dataclasses.replace(self, weights=self.weights + step[:k], network=network)


@eqx.filter_jit
def _network(network, u):
    return jax.vmap(network)(jnp.asarray(u))


@eqx.filter_jit
def _network_tangents(network, u):
    arrays, rest = eqx.partition(network, eqx.is_array)
    flat, unravel = ravel_pytree(arrays)
    return jax.vmap(jax.jacrev(lambda p, x: eqx.combine(unravel(p), rest)(x)), (None, 0))(
        flat, jnp.asarray(u)
    )


@dataclasses.dataclass(frozen=True)
class Learned:
    """The learned term, how much of the held-out gap it closes, and pictures of it.

    `smooth` and `network` are the shares closed by the basis alone and with the network beside it.
    """

    term: Term
    closed: float
    smooth: float
    network: float
    residual: np.ndarray  # held-out rows after the term
    curves: dict[str, tuple[np.ndarray, np.ndarray]]
    map: dict

    @property
    def port(self) -> str:
        """Where it acts."""
        return self.term.port.port

    @property
    def units(self) -> tuple[str, str]:
        """Of the curves' axes."""
        port = self.term.port
        return f"{port.labels()[0].split(' of ')[0]}, {port.own_unit}", f"term, {port.unit}"


def learn(model: RigModel, fit, tell: Callable[[str], None]) -> Learned:
    """The port and the term that close most of the held-out gap beside `fit`'s baseline."""
    names = model.rig.names
    ports = [SpringPort("contact", names), SpringPort("mount", names), ShaftPort(names)]
    found = []
    for port in ports:
        found.append(_Fitting(model, fit, port).run())
        tell(f"learned term at {port.port}: closes {100 * found[-1].closed:.0f} % of the gap")
    best = max(found, key=lambda f: f.closed)
    wide = _Fitting(model, fit, best.term.port).run(best)
    tell(f"with a network beside it: {100 * wide.closed:.0f} %")
    kept = wide if wide.closed > best.closed + KEPT else best
    curves, picture = _curves(kept.term), _map(kept)
    return Learned(
        kept.term, kept.closed, best.closed, wide.closed, kept.after["held-out"], curves, picture
    )


class _Fitting:
    """Gauss-Newton of a term and the baseline's shift; the term feels what it does itself."""

    def __init__(self, model: RigModel, fit, port):
        self.model, self.port = model, port
        self.point, self.jacobian = fit.point, fit.jacobian[:, : len(model.priors)]
        self.shift = np.zeros(len(model.priors))
        self.base()
        raw = np.concatenate([port.inputs(b) for b in self.bases["train"]])
        scales = np.sqrt(np.mean(raw**2, axis=0))
        scales[scales == 0] = 1.0
        self.term = Term(port, scales, np.zeros(len(port.columns(raw[:2]))))

    def base(self) -> None:
        """Base runs, residuals and the baseline's tangents at the point."""
        splits = ("train", "held-out")
        self.bases = {s: self.model.bases(self.point, s) for s in splits}
        self.rest = {s: self.model.residuals([self.point], s)[0] for s in splits}
        self.tangents = {"train": self.jacobian, "held-out": _tangents(self.model, self.point)}

    def run(self, start: "_Fitting | None" = None) -> "_Fitting":
        """Fit; from a `start` with a network beside its basis."""
        before = float(self.rest["held-out"] @ self.rest["held-out"])
        if start is not None:
            self.term, self.shift = _with_network(start.term, start.inputs), start.shift
        for _ in range(ROUNDS):
            self.improve()
        self.after = {s: self.left(self.term, s)[0] for s in self.bases}
        held = float(self.after["held-out"] @ self.after["held-out"])
        self.closed = (before - held) / max(before - self.model.dof("held-out"), 1.0)
        self.inputs = np.concatenate(self.left(self.term, "train")[1])
        return self

    def left(self, term: Term, split: str, shift=None):
        """Residual rows beside the term and the shift, and the term's scaled inputs by run."""
        parts, inputs = [], []
        for base in self.bases[split]:
            felt, force, u = None, np.zeros(0), np.zeros(0)
            for _ in range(INNER):
                u = np.clip(term.port.inputs(base, felt) / term.scales, -FAR, FAR)
                force = term.force(u)
                felt = term.port.felt(base, force)
                if felt is None:
                    break
            rows = self.model.machine.rows[base.index]
            parts.append(rows.project(rows.vector(*term.port.push(base, force))))
            inputs.append(u)
        shift = self.shift if shift is None else shift
        return self.rest[split] - np.concatenate(parts) + self.tangents[split] @ shift, inputs

    def improve(self) -> None:
        """One damped step."""
        now, inputs = self.left(self.term, "train")
        parts = []
        for base, u in zip(self.bases["train"], inputs, strict=True):
            rows = self.model.machine.rows[base.index]
            tables = [self.port.push(base, f) for f in self.term.tangents(u)]
            parts.append(rows.project(np.stack([rows.vector(*t) for t in tables], axis=1)))
        columns, P = np.concatenate(parts), len(self.shift)
        scale = np.linalg.norm(columns, axis=0)
        scale[scale == 0] = 1.0
        both = np.concatenate([columns / scale, -self.jacobian], axis=1)
        k, extra = len(self.term.weights), columns.shape[1] - len(self.term.weights)
        gram, right = both.T @ both, both.T @ now
        right[k + extra :] -= self.point.u + self.shift
        ridge = [np.full(k, RIDGE["basis"]), np.full(extra, RIDGE["network"]), np.ones(P)]
        for damping in (1.0, 30.0, 1e3):
            weights = np.concatenate([ridge[0] * damping, ridge[1] * damping, ridge[2]])
            step = np.linalg.solve(gram + np.diag(weights), right)
            term, shift = self.term.moved(step[: k + extra] / scale), self.shift + step[k + extra :]
            new = self.left(term, "train", shift)[0]
            if new @ new <= now @ now:
                self.term, self.shift = term, shift
                return


def _with_network(term: Term, inputs: np.ndarray) -> Term:
    """The term with a small network beside it that puts out nothing yet."""
    network = eqx.nn.MLP(
        inputs.shape[1], len(term.port.wheels), HIDDEN, 1, jnp.tanh, key=jax.random.key(0)
    )
    network = eqx.tree_at(lambda n: n.layers[-1].weight, network, replace_fn=lambda w: 0 * w)
    network = eqx.tree_at(lambda n: n.layers[-1].bias, network, replace_fn=lambda b: 0 * b)
    size = float(np.sqrt(np.mean(term.force(inputs) ** 2))) or 1.0
    return dataclasses.replace(term, network=network, size=size)


def _tangents(model: RigModel, point: Point) -> np.ndarray:
    """d residual / du on the held-out runs."""
    (residual,) = model.residuals([point], "held-out")
    P = len(point.u)
    points = [Point(point.u + 1e-3 * e, point.effects) for e in np.eye(P)]
    found = model.residuals(points, "held-out") if P else []
    return np.stack([(r - residual) / 1e-3 for r in found], 1) if P else residual[:, None][:, :0]


def _curves(term: Term) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Force over each wheel's own input, the others at zero, in physical units."""
    x, curves = np.linspace(-2.5, 2.5, 101), {}
    for i, name in enumerate(term.port.wheels):
        u = np.zeros((len(x), len(term.scales)))
        u[:, term.port.own(i)] = x
        curves[name] = (x * term.scales[term.port.own(i)], term.force(u)[:, i])
    return curves


def _map(found: _Fitting) -> dict:
    """Force of the wheel with most of it, over the two inputs that it hangs on most."""
    term, u = found.term, found.inputs[:: max(1, len(found.inputs) // 4000)]
    force = term.force(u)
    i = int(np.argmax(np.sum(force**2, axis=0)))
    without = [term.force(u * (np.arange(u.shape[1]) != k))[:, i] for k in range(u.shape[1])]
    missed = [float(np.sum((force[:, i] - f) ** 2)) for f in without]
    a, b = np.argsort(missed)[::-1][:2]
    x = np.linspace(-2.5, 2.5, 41)
    grid = np.zeros((x.size**2, u.shape[1]))
    grid[:, a], grid[:, b] = np.repeat(x, x.size), np.tile(x, x.size)
    labels = term.port.labels()
    return {"wheel": term.port.wheels[i], "x": x * term.scales[a], "y": x * term.scales[b],
            "x label": labels[a], "y label": labels[b], "unit": term.port.unit,
            "force": term.force(grid)[:, i].reshape(x.size, x.size)}  # fmt: skip
