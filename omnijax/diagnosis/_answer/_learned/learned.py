"""A learned, uninterpreted term on one port, where no known effect closes the gap.

At every port a smooth basis, linear in its coefficients, is fitted together with the baseline: one
function after the other, as long as the next is worth its price, for of many that are nearly alike
all together would foretell nothing.  The port whose term explains the fitted runs best, each
coefficient at that price, is the place to look.  There a small network may join the basis, fitted
by Gauss-Newton through the same transfer; it is kept where held-out runs gain by it.  Either is a
drawing, not a law; its band says how well it is known, and the library's nearest laws are drawn
beside it.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..._machine import RigModel
from ..._search import Effect, Fit, Point, Score
from ..._settings import SETTINGS
from ..channels import channel_names
from .near_laws import NearLaw, near_laws
from .ports import ShaftPort, SpherePort, SpringPort
from .sensors import SensorPort
from .shapes import ShapePort, SurfacePort
from .term import Term
from .term_fit import Curve, TermFit, Unexplained
from .term_port import AbstractPort, TermGrid, axes_of

NETWORK_SHARE = SETTINGS.answer_learned.network_share
DRAWN_TO = SETTINGS.answer_learned.drawn_to
DRAWN_PART = SETTINGS.answer_learned.drawn_part
GRID = SETTINGS.answer_learned.grid
DRAWN_ROWS = SETTINGS.answer_learned.drawn_rows


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
    axes: tuple[tuple[str, str], tuple[str, str]]  # names and units, of the curves'
    curves: dict[str, Curve]
    nearest: list[NearLaw]
    map: dict | None

    @property
    def port(self) -> str:
        """Where it acts."""
        return self.term.port.port

    @property
    def kind(self) -> str:
        """What it is made of."""
        return "smooth basis" if self.term.network is None else "smooth basis and network"

    @property
    def coefficients(self) -> str:
        """What the coefficients of `terms` are."""
        return "coefficients of inputs of RMS 1"

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
        nearest = [x.table() for x in self.nearest]
        return {"port": self.port, "closed": self.closed, "uninterpreted": True,
                "closed_by_smooth_basis": self.smooth, "closed_with_network": self.network,
                "kind": self.kind,
                "terms": self.terms, "nearest": nearest, "map": self.map}  # fmt: skip


def learn(
    model: RigModel, fit: Fit, scores: Sequence[Score], tell: Callable[[str], None]
) -> Learned | None:
    """The port and the term that explain most of the fitted runs' gap beside `fit`'s baseline.

    `scores` are those of the library's laws there.  None where every term leaves more of the
    held-out gap than the baseline does.
    """
    around, fittings = Unexplained.of(model, fit), []
    for port in ports_of(model):
        fittings.append(TermFit(model, around, port).run())
        tell(f"learned term at {port.port}: closes {100 * fittings[-1].closed:.0f} % of the gap")
    fittings = [f for f in fittings if f.closed > 0 and f.active.any()]
    if not fittings:
        return None
    best = min(fittings, key=lambda f: f.cost)
    kept, wide = best, None
    if best.closed < 1 - NETWORK_SHARE and best.port.networked:  # else it has too little to add
        wide = TermFit(model, around, best.term.port).run(best)
        tell(f"with a network beside it: {100 * wide.closed:.0f} %")
        kept = wide if wide.closed > best.closed + NETWORK_SHARE else best
    network = None if wide is None else wide.closed
    grids = [kept.grid(i) for i in kept.strongest()]
    curves = {_drawn_as(kept.port, grid): kept.curve(grid) for grid in grids}
    tell("comparing it with the library's laws")
    return Learned(
        kept.term, kept.closed, best.closed, network, kept.after["held-out"], kept.sigma,
        axes_of(kept.port, grids[0]), curves,
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
        SpringPort(rig.names, "contact"), SpringPort(rig.names, "mount"), ShaftPort(rig.names),
        ShapePort(rig.names, tuple(pitches)), SpherePort(), SurfacePort(rig.names),
        SensorPort(tuple(names), rig.size),
    ]  # fmt: skip


def _drawn_as(port: AbstractPort, grid: TermGrid) -> str:
    """The name of a curve."""
    part = port.parts[grid.part]
    return part + (f" over {grid.input.removesuffix(f' of {part}')}" if grid.input else "")


def _nearest(fitting: TermFit, scores: Sequence[Score], grids: Sequence[TermGrid]) -> list[NearLaw]:
    """The library's laws at the port that come nearest to what the term does, nearest first."""
    model, around = fitting.model, fitting.around
    here = [s for s in scores if fitting.port.hosts(model.laws[s.candidate.id].port)]
    tangents = around.tangents["train"]
    near = near_laws(model, Point(around.u), tangents, fitting.change(), here)
    return [dataclasses.replace(x, curve=_drawn(fitting, x, grids)) for x in near]


def _drawn(
    fitting: TermFit, law: NearLaw, grids: Sequence[TermGrid]
) -> tuple[np.ndarray, np.ndarray] | None:
    """A law along the first of the grids on which it acts; None where it is no function of it."""
    base, u = fitting.around.bases["train"][0], fitting.around.u
    placed = fitting.model.rig_at(Point(u, (Effect(law.id, law.place, law.values),))).effects[-1]
    for grid in grids:
        y = None if grid.input else fitting.port.of_law(base, placed, grid)
        if y is not None:
            return grid.x, np.asarray(y)
    return None


def _map(fitting: TermFit) -> dict | None:
    """Output of the part with most of it, over the two inputs that it hangs on most.

    None where it hangs on one alone.
    """
    term, u = fitting.term, fitting.some_inputs(DRAWN_ROWS)
    force = term.force(u)
    i = int(np.argmax(np.sum(force**2, axis=0)))
    missed = fitting.missed(u, i, range(u.shape[1]))
    a, b = np.argsort(missed)[::-1][:2]
    if not missed[b] > DRAWN_PART**2 * missed[a]:
        return None
    x = np.linspace(-DRAWN_TO, DRAWN_TO, GRID)
    grid = np.zeros((x.size**2, u.shape[1]))
    grid[:, a], grid[:, b] = np.repeat(x, x.size), np.tile(x, x.size)
    labels, units = term.port.labels(), term.port.input_units()
    return {"place": term.port.parts[i], "x": x * term.scales[a], "y": x * term.scales[b],
            "x unit": units[a], "y unit": units[b],
            "x label": labels[a], "y label": labels[b], "unit": term.port.units(i)[1],
            "force": term.force(grid)[:, i].reshape(x.size, x.size)}  # fmt: skip
