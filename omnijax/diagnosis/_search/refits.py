"""Joint refits of a search: of a new effect, of a settled set, of friction widths."""

import numpy as np

from .._settings import SETTINGS
from .fit import PATIENCE, Fit, refit, refits_about
from .held_out import HeldOut, Trial
from .model import AbstractModel, Effect, Point, with_width
from .starts import Start

EFFECT_STEPS = SETTINGS.refits.effect_steps
RELATIVE = SETTINGS.refits.relative
OPENING_RELATIVE = SETTINGS.refits.opening_relative
WEAKER_STRENGTHS = SETTINGS.refits.weaker_strengths
WIDTH_STEPS = SETTINGS.refits.width_steps
SETTLED_RATIO = SETTINGS.refits.settled_ratio
# times the best cost, by whether a law is stepped
WIDTHS_MATTER = {True: SETTINGS.refits.stepped_widths, False: SETTINGS.refits.plain_widths}


def residual_of(model: AbstractModel, point: Point, split: str) -> np.ndarray:
    """Residual of a point on the runs of `split`."""
    return model.residuals([point], split)[0]


def chi2_of(model: AbstractModel, point: Point, split: str) -> float:
    """chi2 of a point on the runs of `split`."""
    r = residual_of(model, point, split)
    return float(r @ r)


def total_cost(fit: Fit) -> float:
    """Cost with log N a free number of the effects, as in the Bayesian information criterion."""
    return fit.cost + float(np.log(len(fit.residual))) * len(fit.free)


class Refits:
    """Refits on one model."""

    def __init__(self, model: AbstractModel):
        self.model, self.settings = model, model.settings
        self.openings: dict[float, AbstractModel] = {}

    def tangents(self, fit: Fit, effects) -> np.ndarray | None:
        """Tangents of the uncertain parameters that a refit with `effects` may begin with."""
        return None if self.model.needs_stepping(effects) else fit.jacobian[:, : len(fit.point.u)]

    def try_out(self, fit: Fit, start: Start, before: np.ndarray, least: float = np.inf,
                openings: dict[float, float] | None = None) -> Trial:  # fmt: skip
        """Refit everything from a start; `before` is the held-out residual without the effect.

        `least` is the cost of the best trial so far.  With `openings`, the least cost of trials so
        far by share, a law that is stepped in time is refitted to the runs' openings first.
        """
        point, enough, patience = (
            self.tamed(self.model.remembered(start.point), fit),
            self.settings.hopeless_cost * least,
            PATIENCE,
        )
        if openings is not None and self.model.needs_stepping(point.effects[-1:]):
            followed = self.opened(fit.point, point, openings)
            enough = min(enough, (1 - self.settings.least_closed) * fit.cost)
            patience = patience if followed else 1
            point = followed or point
        tangents = self.tangents(fit, point.effects)
        new = refit(self.model, point, baseline=tangents, rounds=EFFECT_STEPS, relative=RELATIVE,
                    give_up=enough, patience=patience)  # fmt: skip
        return self.trial(fit, new, before)

    def opened(self, without: Point, point: Point, least: dict[float, float]) -> Point | None:
        """`point` refitted to the runs' openings, the short ones first, while it has a chance.

        None where the first of them leaves it none.

        Where contacts part and strike, what comes late in a run hangs so strongly on every number
        that no way leads to the right ones from afar; the opening tells them well enough.  A law
        that closes little of an opening's gap, as it is at the point `without` it, is left.
        """
        followed = None
        for share in self.settings.openings:
            if chi2_of(self.model, point, "train") < self.settings.near_noise * self.model.dof(
                "train"
            ):
                return point
            if share not in self.openings:
                self.openings[share] = self.model.opening(share)
            part = self.openings[share]
            part.work = 0.0
            before, fit = (
                chi2_of(part, without, "train"),
                refit(part, point, rounds=EFFECT_STEPS, relative=OPENING_RELATIVE),
            )
            self.model.work += share * part.work
            closed = (before - fit.cost) / max(before - part.dof("train"), 1.0)
            if (
                closed < self.settings.opening_closed
                or not fit.cost < self.settings.hopeless_cost * least.get(share, np.inf)
            ):
                break
            followed, least[share] = fit.point, min(fit.cost, least.get(share, np.inf))
            point = followed
        return followed

    def trial(self, fit: Fit, new: Fit, before: np.ndarray) -> Trial:
        """A refit with one more effect than `fit`, as the held-out runs see it.

        What they refuse is judged once more as it is with its own `rebase`: with starts that stand
        for its absence the effect shows less than it is, on both splits.  So is what such starts
        have led astray.  Not where the law leaves more free there than there is without it, which
        takes up noise on the held-out runs too.
        """
        after = residual_of(self.model, new.point, "held-out")
        tried = self._judged(fit, new, before, after)
        unsettled = self.model.unsettled(new.point) and not self.model.frees(tried.effect)
        if not unsettled or (tried.accepted and not self.model.astray(new)):
            return tried
        refitted, left = self.model.on_its_own(new)
        own = tried if refitted is new else self._judged(fit, refitted, before, left)
        return own if own.accepted else tried

    def _judged(self, fit: Fit, new: Fit, before: np.ndarray, after: np.ndarray) -> Trial:
        held = HeldOut.of(before, after)
        return Trial(new.point.effects[-1], new, fit.cost - new.cost, held, self.settings)

    def with_widths(self, fit: Fit, trials: list[Trial], before: np.ndarray) -> list[Trial]:
        """The trials with their friction widths fitted: no comparison may hang on a width."""
        best, out = min((t.fit.cost for t in trials), default=0.0), []
        for t in trials:
            wide = self.widened(t.fit, best)
            out.append(t if wide is t.fit else self.trial(fit, wide, before))
        return out

    def tamed(self, point: Point, fit: Fit) -> Point:
        """Where to begin a refit: as foretold, as `fit` is calibrated or as stated, what is best.

        A wrong model drives the calibration to its bounds.  A law that is stepped in time is
        weakened until the point is no worse than without it.
        """
        *others, last = point.effects
        law = self.model.laws[last.id]
        strong = [k for k in last.values if law.parameters[k].linear or k == "gap"]
        stepped = strong and self.model.needs_stepping([last])
        best, least = point, np.inf
        for factor in WEAKER_STRENGTHS if stepped else (1.0,):
            values = last.values | {k: factor * last.values[k] for k in strong}
            effects = (*others, Effect(last.id, last.place, values))
            for u in (point.u, fit.point.u, 0 * point.u):
                there = Point(u, effects)
                chi2 = chi2_of(self.model, there, "train") + float(u @ u)
                if np.isfinite(chi2) and chi2 < least:
                    best, least = there, chi2
            if least < fit.cost:
                break
        return best

    def settle(self, fit: Fit) -> Fit:
        """Smooth about the new point and polish there, with tangents of its own."""
        return self.settled(fit.point, fit.chi2)

    def settled(self, point: Point, before: float) -> Fit:
        """The fit from a point near its end; `before` is its chi2 as the data were prepared."""
        self.model.tell("smoothing the runs about it")
        for fit in refits_about(self.model, point, self.settings.settle_rounds):
            left = fit.chi2 / self.model.dof("train")
            self.model.tell(f"settling the joint refit: chi2 {left:.4g} a row")
            near = (
                fit.chi2 < self.settings.settled_misfit * self.model.dof("train")
                or fit.chi2 > SETTLED_RATIO * before
            )
            if near or not self.model.unsettled(fit.point):
                break
            before = fit.chi2
        return self.widened(fit)

    def widened(self, fit: Fit, best: float = np.inf) -> Fit:
        """The fit with the friction laws' widths stated and so free, where the data ask for it.

        The widths of a real machine are unknown, so no answer may hang on them.  A fit that costs
        far more than the `best` one stays as it is.
        """
        if fit.cost > WIDTHS_MATTER[self.model.needs_stepping(fit.point.effects)] * best:
            return fit
        wide = [with_width(self.model.laws[e.id], e) for e in fit.point.effects]
        stated = all(
            len(w.values) == len(e.values) for w, e in zip(wide, fit.point.effects, strict=True)
        )
        if stated or not np.isfinite(fit.cost):
            return fit
        point = fit.point.with_effects(*wide)
        freed = refit(self.model, point, baseline=self.tangents(fit, wide), rounds=WIDTH_STEPS)
        return freed if freed.cost < fit.cost - self.settings.margin else fit
