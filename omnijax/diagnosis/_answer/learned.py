"""A learned, uninterpreted term on one port, where no known effect closes the gap.

At every port a smooth basis, linear in its coefficients, is fitted together with the baseline; the
port whose term closes most of the held-out gap is the place to look.  There a small network joins
the basis, fitted by Gauss-Newton through the same transfer; it is kept where held-out runs gain by
it.  Either is a drawing, not a law.
"""

import copy
import dataclasses
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from .._machine import Linearisation, RigModel
from .._search import Fit, Point, refit
from .._settings import SETTINGS
from .._threads import each
from .learned_ports import ShaftPort, SpringPort

ROUNDS = SETTINGS.answer_learned.rounds
INNER = SETTINGS.answer_learned.inner
HIDDEN = SETTINGS.answer_learned.hidden
FAR = SETTINGS.answer_learned.far
KEPT = SETTINGS.answer_learned.kept
ENOUGH = SETTINGS.answer_learned.enough
DAMPINGS = SETTINGS.answer_learned.dampings
STEP = SETTINGS.answer_learned.step
SHOWN = SETTINGS.answer_learned.shown
POINTS = SETTINGS.answer_learned.points
GRID = SETTINGS.answer_learned.grid
DRAWN = SETTINGS.answer_learned.drawn
RIDGE = {"basis": SETTINGS.answer_learned.ridge, "network": SETTINGS.answer_learned.network}


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
            J = np.array(
                np.moveaxis(np.asarray(_network_tangents(self.network, u)), 2, 0), order="C"
            )
            J *= self.size
            out += list(J)
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

    `smooth` and `network` are the shares closed by the basis alone and with the network beside it,
    None where the basis left it too little to close.
    """

    term: Term
    closed: float
    smooth: float
    network: float | None
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

    def table(self) -> dict[str, Any]:
        """Numbers for diagnosis.json: port, what it closes, coefficients and map."""
        term = self.term
        labels = [(i, label) for i, label, _ in term.port.columns(np.zeros((1, len(term.scales))))]
        terms = [
            {"wheel": term.port.wheels[i], "input": label, "coefficient": float(c)}
            for (i, label), c in zip(labels, term.weights, strict=True)
        ]
        return {"port": self.port, "closed": self.closed, "uninterpreted": True,
                "closed_by_smooth_basis": self.smooth, "closed_with_network": self.network,
                "kind": "smooth basis" if term.network is None else "smooth basis and network",
                "terms": terms, "map": self.map}  # fmt: skip


def learn(model: RigModel, fit: Fit, tell: Callable[[str], None]) -> Learned | None:
    """The port and the term that close most of the held-out gap beside `fit`'s baseline.

    None where every term leaves more of it than the baseline does.
    """
    names = model.rig.names
    ports = [SpringPort("contact", names), SpringPort("mount", names), ShaftPort(names)]
    around, fittings = Unexplained.of(model, fit), []
    for port in ports:
        fittings.append(_Fitting(model, around, port).run())
        tell(f"learned term at {port.port}: closes {100 * fittings[-1].closed:.0f} % of the gap")
    best = max(fittings, key=lambda f: f.closed)
    kept, wide = best, None
    if best.closed < 1 - KEPT:  # else a network has too little to add
        wide = _Fitting(model, around, best.term.port).run(best)
        tell(f"with a network beside it: {100 * wide.closed:.0f} %")
        kept = wide if wide.closed > best.closed + KEPT else best
    if not kept.closed > 0:
        return None
    curves, picture = _curves(kept.term), _map(kept)
    network = None if wide is None else wide.closed
    return Learned(
        kept.term, kept.closed, best.closed, network, kept.after["held-out"], curves, picture
    )


@dataclasses.dataclass(frozen=True)
class Unexplained:
    """What every port's term is fitted around: the baseline's runs, residuals and tangents."""

    u: np.ndarray
    bases: dict[str, list[Linearisation]]
    rest: dict[str, np.ndarray]
    tangents: dict[str, np.ndarray]
    before: np.ndarray  # held-out rows of the fit itself

    @staticmethod
    def of(model: RigModel, fit: Fit) -> "Unexplained":
        """The baseline of a fit on train and held-out runs.

        What is `limited` (the offsets of clocks, driven about by what is unexplained) is held at
        what is stated, where the ports' responses are, the rest fitted beside it; it shifts with
        the term.
        """
        splits = ("train", "held-out")
        point = _with_limited_held(model, fit.point)
        return Unexplained(
            point.u,
            {s: model.bases(point, s) for s in splits},
            {s: model.residuals([point], s)[0] for s in splits},
            {s: _tangents(model, point, s) for s in splits},
            model.residuals([fit.point], "held-out")[0],
        )


class _Fitting:
    """Gauss-Newton of a term and the baseline's shift; the term feels what it does itself."""

    def __init__(self, model: RigModel, around: Unexplained, port: SpringPort | ShaftPort):
        self.model, self.around, self.port = model, around, port
        self.shift = np.zeros(len(model.priors))
        raw = np.concatenate([port.inputs(b) for b in around.bases["train"]])
        scales = np.sqrt(np.mean(raw**2, axis=0))
        scales[scales == 0] = 1.0
        self.term = Term(port, scales, np.zeros(len(port.columns(raw[:2]))))

    def run(self, start: "_Fitting | None" = None) -> "_Fitting":
        """Fit; from a `start` with a network beside its basis."""
        before = float(self.around.before @ self.around.before)
        if start is not None:
            self.term, self.shift = _with_network(start.term, start.inputs), start.shift
        here = self.left(self.term, "train")
        for _ in range(ROUNDS):
            gain, here = self.improve(*here)
            if gain < ENOUGH:
                break
        self.after = {"train": here[0], "held-out": self.left(self.term, "held-out")[0]}
        held = float(self.after["held-out"] @ self.after["held-out"])
        self.closed = (before - held) / max(before - self.model.dof("held-out"), 1.0)
        self.inputs = np.concatenate(here[1])
        return self

    def left(self, term: Term, split: str, shift=None):
        """Residual rows beside the term and the shift, and the term's scaled inputs by run."""

        def one(base: Linearisation):
            felt, force, u = None, np.zeros(0), np.zeros(0)
            for turn in range(INNER):
                u = np.clip(term.port.inputs(base, felt) / term.scales, -FAR, FAR)
                force = term.force(u)
                felt = term.port.felt(base, force) if turn < INNER - 1 else None
                if felt is None:
                    break
            rows = self.model.machine.rows[base.index]
            return rows.project(rows.vector(*term.port.push(base, force))), u

        parts, inputs = zip(*each(one, self.around.bases[split]), strict=True)
        shift = self.shift if shift is None else shift
        rest, tangents = self.around.rest[split], self.around.tangents[split]
        return rest - np.concatenate(parts) + tangents @ shift, list(inputs)

    def improve(self, now: np.ndarray, inputs: list[np.ndarray]):
        """One damped step from train rows `now` and the term's `inputs` there.

        The share of the misfit that it takes away, and rows and inputs after it.
        """
        table = self._columns(inputs)
        P, extra = len(self.shift), len(table) - len(self.shift)
        scale = np.linalg.norm(table[:extra], axis=1)
        scale[scale == 0] = 1.0
        table[:extra] /= scale[:, None]
        gram, right = table @ table.T, table @ now
        right[extra:] -= self.around.u + self.shift
        k = len(self.term.weights)
        ridge = np.repeat([RIDGE["basis"], RIDGE["network"]], [k, extra - k])
        for damping in DAMPINGS:
            weights = np.concatenate([ridge * damping, np.ones(P)])
            step = np.linalg.solve(gram + np.diag(weights), right)
            term, shift = self.term.moved(step[:extra] / scale), self.shift + step[extra:]
            new, felt = self.left(term, "train", shift)
            if new @ new <= now @ now:
                self.term, self.shift = term, shift
                return 1 - float(new @ new) / float(now @ now), (new, felt)
        return 0.0, (now, inputs)

    def _columns(self, inputs: list[np.ndarray]) -> np.ndarray:
        """Changes of the train rows (weights + priors, rows) with every weight and every prior."""
        bases, machine = self.around.bases["train"], self.model.machine
        ends = np.cumsum([0, *(machine.rows[base.index].size for base in bases)])
        forces = len(self.term.tangents(inputs[0][:1]))
        table = np.empty((forces + len(self.shift), ends[-1]))
        table[forces:] = -self.around.tangents["train"].T

        def fill(k: int) -> None:
            rows, part = machine.rows[bases[k].index], table[:forces, ends[k] : ends[k + 1]]
            for row, force in zip(part, self.term.tangents(inputs[k]), strict=True):
                row[:] = rows.vector(*self.port.push(bases[k], force))
            rows.take_off(part)

        each(fill, range(len(bases)))
        return table


def _with_network(term: Term, inputs: np.ndarray) -> Term:
    """The term with a small network beside it that puts out nothing yet."""
    network = eqx.nn.MLP(
        inputs.shape[1], len(term.port.wheels), HIDDEN, 1, jnp.tanh, key=jax.random.key(0)
    )
    network = eqx.tree_at(lambda n: n.layers[-1].weight, network, replace_fn=lambda w: 0 * w)
    network = eqx.tree_at(lambda n: n.layers[-1].bias, network, replace_fn=lambda b: 0 * b)
    size = float(np.sqrt(np.mean(term.force(inputs) ** 2))) or 1.0
    return dataclasses.replace(term, network=network, size=size)


def _with_limited_held(model: RigModel, point: Point) -> Point:
    """The point fitted again with what is `limited` at what is stated."""
    limited = [p.limited for p in model.priors]
    if not np.any(point.u[limited]):
        return point
    held = copy.copy(model)
    held.priors = [dataclasses.replace(p, hard=0.0) if p.limited else p for p in model.priors]
    return refit(held, Point(np.where(limited, 0.0, point.u), point.effects)).point


def _tangents(model: RigModel, point: Point, split: str) -> np.ndarray:
    """d residual / du on the runs of a split."""
    (residual,) = model.residuals([point], split)
    P = len(point.u)
    points = [Point(point.u + STEP * e, point.effects) for e in np.eye(P)]
    with model.aside():
        moved = model.residuals(points, split) if P else []
    return np.stack([(r - residual) / STEP for r in moved], 1) if P else residual[:, None][:, :0]


def _curves(term: Term) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Force over each wheel's own input, the others at zero, in physical units."""
    x, curves = np.linspace(-SHOWN, SHOWN, POINTS), {}
    for i, name in enumerate(term.port.wheels):
        u = np.zeros((len(x), len(term.scales)))
        u[:, term.port.own(i)] = x
        curves[name] = (x * term.scales[term.port.own(i)], term.force(u)[:, i])
    return curves


def _map(fitting: _Fitting) -> dict:
    """Force of the wheel with most of it, over the two inputs that it hangs on most."""
    term, u = fitting.term, fitting.inputs[:: max(1, len(fitting.inputs) // DRAWN)]
    force = term.force(u)
    i = int(np.argmax(np.sum(force**2, axis=0)))
    without = [term.force(u * (np.arange(u.shape[1]) != k))[:, i] for k in range(u.shape[1])]
    missed = [float(np.sum((force[:, i] - f) ** 2)) for f in without]
    a, b = np.argsort(missed)[::-1][:2]
    x = np.linspace(-SHOWN, SHOWN, GRID)
    grid = np.zeros((x.size**2, u.shape[1]))
    grid[:, a], grid[:, b] = np.repeat(x, x.size), np.tile(x, x.size)
    labels = term.port.labels()
    return {"wheel": term.port.wheels[i], "x": x * term.scales[a], "y": x * term.scales[b],
            "x label": labels[a], "y label": labels[b], "unit": term.port.unit,
            "force": term.force(grid)[:, i].reshape(x.size, x.size)}  # fmt: skip
