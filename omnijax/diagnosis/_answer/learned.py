"""A learned, uninterpreted term on one port, where no known effect closes the gap.

At every port a smooth basis, linear in its coefficients, is fitted together with the baseline: one
function after the other, as long as the next is worth its price, for of many that are nearly alike
all together would foretell nothing.  The port whose term explains the fitted runs best, each
coefficient at that price, is the place to look.
There a small network may join the basis, fitted by Gauss-Newton through the same transfer; it is
kept where held-out runs gain by it.  Either is a drawing, not a law; its band says how well it is
known, and the library's nearest laws are drawn beside it.
"""

import copy
import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from .._machine import Linearisation, RigModel
from .._search import Effect, Fit, Point, Score, refit
from .._settings import SETTINGS
from .._threads import each
from .channels import channel_names
from .learned_ports import ShaftPort, SpherePort, SpringPort
from .learned_sensors import SensorPort
from .learned_shapes import ShapePort, SurfacePort
from .near_laws import NearLaw, near_laws
from .term_port import AbstractPort, TermGrid

ROUNDS = SETTINGS.answer_learned.rounds
INNER = SETTINGS.answer_learned.inner
HIDDEN = SETTINGS.answer_learned.hidden
FAR = SETTINGS.answer_learned.far
KEPT = SETTINGS.answer_learned.kept
ENOUGH = SETTINGS.answer_learned.enough
DAMPINGS = SETTINGS.answer_learned.dampings
STEP = SETTINGS.answer_learned.step
SHOWN = SETTINGS.answer_learned.shown
MATTERS = SETTINGS.answer_learned.matters
APART = SETTINGS.answer_learned.apart
GRID = SETTINGS.answer_learned.grid
DRAWN = SETTINGS.answer_learned.drawn
OTHERS = SETTINGS.answer_learned.others
RIDGE = {"basis": SETTINGS.answer_learned.ridge, "network": SETTINGS.answer_learned.network}


@dataclasses.dataclass(frozen=True)
class Term:
    """Weights of the smooth basis, and a network beside it (or None): forces from scaled inputs."""

    port: AbstractPort
    scales: np.ndarray
    weights: np.ndarray
    network: eqx.nn.MLP | None = None
    size: float = 1.0  # of the network's output

    def force(self, u: np.ndarray) -> np.ndarray:
        """Outputs (t, parts) at scaled inputs (t, k)."""
        out = np.zeros((len(u), len(self.port.parts)))
        for (i, _, x), w in zip(self.port.columns(u), self.weights, strict=True):
            out[:, i] += w * x
        if self.network is not None:
            out += self.size * np.asarray(_network(self.network, u))
        return out

    def tangents(self, u: np.ndarray) -> list[np.ndarray]:
        """Outputs (t, parts) per unit of every weight."""
        out = []
        for i, _, x in self.port.columns(u):
            out.append(np.zeros((len(u), len(self.port.parts))))
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


class Curve(NamedTuple):
    """A part of a term over its own input, with 1-sigma of it, in the port's units."""

    x: np.ndarray
    y: np.ndarray
    sigma: np.ndarray


@dataclasses.dataclass(frozen=True)
class Learned:
    """The learned term, how much of the held-out gap it closes, and pictures of it.

    `smooth` and `network` are the shares closed by the basis alone and with the network beside it,
    None where none was tried.  `sigma` (weights,) is that of the basis' coefficients.
    """

    term: Term
    closed: float
    smooth: float
    network: float | None
    residual: np.ndarray  # held-out rows after the term
    sigma: np.ndarray
    curves: dict[str, Curve]
    nearest: list[NearLaw]
    map: dict | None

    @property
    def port(self) -> str:
        """Where it acts."""
        return self.term.port.port

    @property
    def axes(self) -> tuple[tuple[str, str], tuple[str, str]]:
        """Names and units of the curves' axes."""
        port = self.term.port
        starts = [name.split(" over ")[0] for name in self.curves]
        part = port.parts.index(starts[0]) if starts else 0
        own, unit = port.units(part)
        return (_own_label(port, part), own), ("term", unit)

    @property
    def terms(self) -> list[dict[str, Any]]:
        """Coefficients of what is in with 1-sigma, of inputs of RMS 1, in their part's unit."""
        term = self.term
        labels = term.port.columns(np.zeros((1, len(term.scales))))
        return [
            {"place": term.port.parts[i], "input": label, "coefficient": float(c),
             "sigma": float(s), "unit": term.port.units(i)[1]}
            for (i, label, _), c, s in zip(labels, term.weights, self.sigma, strict=True) if s > 0
        ]  # fmt: skip

    def table(self) -> dict[str, Any]:
        """Numbers for diagnosis.json: port, what it closes, coefficients, nearest laws, map."""
        network = self.term.network is not None
        nearest = [x.table() for x in self.nearest]
        return {"port": self.port, "closed": self.closed, "uninterpreted": True,
                "closed_by_smooth_basis": self.smooth, "closed_with_network": self.network,
                "kind": "smooth basis and network" if network else "smooth basis",
                "terms": self.terms, "nearest": nearest, "map": self.map}  # fmt: skip


def _drawn_as(port: AbstractPort, grid: TermGrid) -> str:
    """The name of a curve."""
    return port.parts[grid.part] + (f" over {grid.input}" if grid.input else "")


def _own_label(port: AbstractPort, part: int) -> str:
    return port.labels()[port.own(part)].split(" of ")[0]


def learn(
    model: RigModel, fit: Fit, scores: Sequence[Score], tell: Callable[[str], None]
) -> Learned | None:
    """The port and the term that explain most of the fitted runs' gap beside `fit`'s baseline.

    `scores` are those of the library's laws there.  None where every term leaves more of the
    held-out gap than the baseline does.
    """
    around, fittings = Unexplained.of(model, fit), []
    for port in ports_of(model):
        fittings.append(_Fitting(model, around, port).run())
        tell(f"learned term at {port.port}: closes {100 * fittings[-1].closed:.0f} % of the gap")
    fittings = [f for f in fittings if f.closed > 0]
    if not fittings:
        return None
    best = min(fittings, key=lambda f: f.cost)
    kept, wide = best, None
    if best.closed < 1 - KEPT and best.port.networked:  # else it has too little to add
        wide = _Fitting(model, around, best.term.port).run(best)
        tell(f"with a network beside it: {100 * wide.closed:.0f} %")
        kept = wide if wide.closed > best.closed + KEPT else best
    network = None if wide is None else wide.closed
    grids = [kept.grid(i) for i in kept.strongest()]
    curves = {_drawn_as(kept.port, grid): kept.curve(grid) for grid in grids}
    tell("comparing it with the library's laws")
    return Learned(
        kept.term, kept.closed, best.closed, network, kept.after["held-out"], kept.sigma, curves,
        _nearest(kept, scores, grids), _map(kept) if kept.port.networked else None,
    )  # fmt: skip


def ports_of(model: RigModel) -> list[AbstractPort]:
    """The ports of the model's rig, with the channels that count in its fitted runs."""
    rig, machine = model.rig, model.machine
    rows = [machine.rows[i] for i in model.splits["train"]]
    counts = [np.any([np.any(t > 0, axis=0) for t in some], axis=0)
              for some in ([r.elastic for r in rows], [r.rotation for r in rows])]  # fmt: skip
    names = [c for c, some in zip(channel_names(rig.size), np.concatenate(counts), strict=True)
             if some]  # fmt: skip
    pitches = np.round(2 * np.pi / np.asarray(rig.gaps.pitch)).astype(int).tolist()
    return [
        SpringPort("contact", rig.names), SpringPort("mount", rig.names), ShaftPort(rig.names),
        ShapePort(rig.names, tuple(pitches)), SpherePort(), SurfacePort(rig.names),
        SensorPort(tuple(names), rig.size),
    ]  # fmt: skip


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

    def __init__(self, model: RigModel, around: Unexplained, port: AbstractPort):
        self.model, self.around, self.port = model, around, port
        self.shift = np.zeros(len(model.priors))
        raw = np.concatenate([port.inputs(b) for b in around.bases["train"]])
        weights = np.zeros(len(port.columns(raw[:2])))
        self.term = Term(port, port.scales(raw), weights)
        self.active = np.zeros(len(weights), bool)  # which functions of the basis are in
        self.spread = np.zeros((0, 0))  # covariance of all weights, before what is left counts

    def run(self, start: "_Fitting | None" = None) -> "_Fitting":
        """Fit; from a `start` with a network beside its basis."""
        before = float(self.around.before @ self.around.before)
        if start is not None:
            self.term, self.shift = _with_network(start.term, start.inputs), start.shift
            self.active = start.active
        here = self.left(self.term, "train")
        for _ in range(ROUNDS):
            gain, here = self.improve(*here)
            if gain < ENOUGH:
                break
        self.after = {"train": here[0], "held-out": self.left(self.term, "held-out")[0]}
        held = float(self.after["held-out"] @ self.after["held-out"])
        self.closed = (before - held) / max(before - self.model.dof("held-out"), 1.0)
        self.inputs = np.concatenate(here[1])
        chi2, u = float(here[0] @ here[0]), self.around.u + self.shift
        self.cost = chi2 + float(u @ u) + float(np.log(len(here[0]))) * int(self.active.sum())
        self.spread *= max(1.0, chi2 / self.model.dof("train"))
        return self

    @property
    def sigma(self) -> np.ndarray:
        """1-sigma (weights,) of the basis' coefficients."""
        return np.sqrt(np.diag(self.spread)[: len(self.term.weights)])

    def curve(self, grid: TermGrid) -> Curve:
        """A part of the term along a grid, with its band: the mean over what else varies.

        Source: partial dependence (Friedman, Greedy function approximation, 2001).
        """
        some = self.inputs[:: max(1, len(self.inputs) // OTHERS)]
        u = np.repeat(some[:, None], len(grid.x), axis=1)  # (others, points, k)
        for k, values in grid.varied.items():
            u[:, :, k] = values
        flat = u.reshape(-1, u.shape[2])

        def mean(x: np.ndarray) -> np.ndarray:
            return x[:, grid.part].reshape(len(some), -1).mean(axis=0)

        J = np.stack([mean(x) for x in self.term.tangents(flat)])
        band = np.sqrt(np.maximum(np.einsum("kt,kl,lt->t", J, self.spread, J), 0.0))
        return Curve(grid.x, mean(self.term.force(flat)), band)

    def grid(self, part: int) -> TermGrid:
        """The grid of the input that a part hangs on most, of those like its own."""
        port, some = self.port, self.inputs[:: max(1, len(self.inputs) // DRAWN)]
        inputs = port.like_own(part)
        missed = self.missed(some, part, inputs)
        return port.grid(part, self.term.scales, inputs[int(np.argmax(missed))])

    def missed(self, u: np.ndarray, part: int, inputs: Sequence[int]) -> list[float]:
        """What a part of the term loses of its square by each of some inputs being 0."""
        whole = self.term.force(u)[:, part]
        without = (self.term.force(u * (np.arange(u.shape[1]) != k))[:, part] for k in inputs)
        return [float(np.sum((whole - x) ** 2)) for x in without]

    def change(self, parts: Sequence[int] | None = None) -> np.ndarray:
        """What the term, or some of its parts, changes of the fitted runs' rows."""
        out = []
        for base, u in zip(self.around.bases["train"], self._inputs_by_run(), strict=True):
            force = self.term.force(u)
            if parts is not None:
                force = force * np.isin(np.arange(force.shape[1]), parts)
            rows = self.model.machine.rows[base.index]
            out.append(rows.project(rows.vector(*self.port.push(base, force))))
        return np.concatenate(out)

    def _inputs_by_run(self) -> list[np.ndarray]:
        counts = [len(self.port.inputs(base)) for base in self.around.bases["train"]]
        return np.split(self.inputs, np.cumsum(counts)[:-1])

    def strongest(self) -> list[int]:
        """The parts that change the rows most, of one unit, the strongest first."""
        sizes = [np.linalg.norm(self.change([i])) for i in range(len(self.port.parts))]
        order = [int(i) for i in np.argsort(sizes)[::-1] if sizes[i] >= MATTERS * max(sizes)]
        return [i for i in order if self.port.units(i) == self.port.units(order[0])]

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
        k, free = len(self.term.weights), np.ones(len(table), bool)
        ridge = np.repeat([RIDGE["basis"], RIDGE["network"]], [k, extra - k])
        price = float(np.log(len(now))) * max(1.0, float(now @ now) / self.model.dof("train"))
        free[:k] = self.active
        prior = np.diag(np.concatenate([ridge, np.ones(P)]))
        free = worthwhile(gram + prior, right, free, price)
        self.active, free = free[:k], np.flatnonzero(free)
        inner = np.ix_(free, free)
        self.spread, step = np.zeros((len(table), len(table))), np.zeros(len(table))
        self.spread[inner] = np.linalg.inv((gram + prior)[inner])
        self.spread = self.spread[:extra, :extra] / np.outer(scale, scale)
        for damping in DAMPINGS:
            weights = np.diag(np.concatenate([ridge * damping, np.ones(P)]))
            step[free] = np.linalg.solve((gram + weights)[inner], right[free])
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
            part = table[:forces, ends[k] : ends[k + 1]]
            pushed(self.model, self.port, bases[k], self.term.tangents(inputs[k]), part)

        each(fill, range(len(bases)))
        return table


def pushed(
    model: RigModel, port: AbstractPort, base: Linearisation, outputs: Sequence[np.ndarray],
    into: np.ndarray,
) -> None:  # fmt: skip
    """What `outputs` (k of (points, parts)) of a port change of a run's rows, `into` (k, rows)."""
    rows = model.machine.rows[base.index]
    for row, output in zip(into, outputs, strict=True):
        row[:] = rows.vector(*port.push(base, output))
    rows.take_off(into)


def worthwhile(gram: np.ndarray, right: np.ndarray, free: np.ndarray, price: float) -> np.ndarray:
    """Which columns a least-squares step may use: `free` ones, and others as they pay their price.

    `gram` (k, k) and `right` (k,) are its normal equations.  One after the other joins, by more
    than `price`, that lowers the cost most; of those within the price of it the first.
    """
    free = free.copy()
    length = np.diag(gram)
    while not free.all():
        rest, apart = right, length
        if free.any():
            inner = np.linalg.inv(gram[np.ix_(free, free)])
            rest = right - gram[:, free] @ (inner @ right[free])
            apart = length - np.einsum("ka,ab,kb->k", gram[:, free], inner, gram[:, free])
        new = ~free & (apart > APART * length)
        gain = np.where(new, rest**2 / np.where(new, apart, 1.0), 0.0)
        if gain.max() < price:
            break
        free[int(np.argmax(gain >= max(price, gain.max() - price)))] = True
    return free


def _with_network(term: Term, inputs: np.ndarray) -> Term:
    """The term with a small network beside it that puts out nothing yet."""
    network = eqx.nn.MLP(
        inputs.shape[1], len(term.port.parts), HIDDEN, 1, jnp.tanh, key=jax.random.key(0)
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


def _nearest(
    fitting: _Fitting, scores: Sequence[Score], grids: Sequence[TermGrid]
) -> list[NearLaw]:
    """The library's laws at the port that come nearest to what the term does, nearest first."""
    model, around = fitting.model, fitting.around
    here = [s for s in scores if fitting.port.hosts(model.laws[s.candidate.id].port)]
    tangents = around.tangents["train"]
    near = near_laws(model, Point(around.u), tangents, fitting.change(), here)
    return [dataclasses.replace(x, curve=_drawn(fitting, x, grids)) for x in near]


def _drawn(
    fitting: _Fitting, law: NearLaw, grids: Sequence[TermGrid]
) -> tuple[np.ndarray, np.ndarray] | None:
    """A law along the first of the grids on which it acts; None where it is no function of it."""
    base, u = fitting.around.bases["train"][0], fitting.around.u
    placed = fitting.model.rig_at(Point(u, (Effect(law.id, law.place, law.values),))).effects[-1]
    for grid in grids:
        y = None if grid.input else fitting.port.of_law(base, placed, grid)
        if y is not None:
            return grid.x, np.asarray(y)
    return None


def _map(fitting: _Fitting) -> dict | None:
    """Output of the part with most of it, over the two inputs that it hangs on most.

    None where it hangs on one alone.
    """
    term, u = fitting.term, fitting.inputs[:: max(1, len(fitting.inputs) // DRAWN)]
    force = term.force(u)
    i = int(np.argmax(np.sum(force**2, axis=0)))
    missed = fitting.missed(u, i, range(u.shape[1]))
    a, b = np.argsort(missed)[::-1][:2]
    if not missed[b] > MATTERS**2 * missed[a]:
        return None
    x = np.linspace(-SHOWN, SHOWN, GRID)
    grid = np.zeros((x.size**2, u.shape[1]))
    grid[:, a], grid[:, b] = np.repeat(x, x.size), np.tile(x, x.size)
    labels, units = term.port.labels(), term.port.input_units()
    return {"place": term.port.parts[i], "x": x * term.scales[a], "y": x * term.scales[b],
            "x unit": units[a], "y unit": units[b],
            "x label": labels[a], "y label": labels[b], "unit": term.port.units(i)[1],
            "force": term.force(grid)[:, i].reshape(x.size, x.size)}  # fmt: skip
