"""The search: one effect after the other by score, joint refit and held-out gain; then pruning."""

import dataclasses
from collections.abc import Callable

import numpy as np

from ._fit import Fit, refit
from ._model import AbstractModel, Effect, Point
from ._scan import Scan, Score, Signatures

ALPHA = 1e-3  # chance of a false candidate in a whole scan
HELD_GAIN = 10.0  # least gain of chi2 on held-out runs
HELD_SHARE = 0.15  # least gain per held-out sample, relative to the train runs
CLOSED = 0.95  # share of the held-out gap that a named set has to close
MARGIN = 25.0  # least difference of chi2 between the joint refits of rivals
MOST = 4  # effects
STEPPED = ("contact", "mount", "separation")


@dataclasses.dataclass(frozen=True)
class Trial:
    """A refitted rival: the effect, its fit, and what it gains beside the point it was added to."""

    effect: Effect
    fit: Fit
    gain: float
    held_gain: float


@dataclasses.dataclass
class Found:
    """All that the search found out."""

    baseline: Fit
    fit: Fit
    held_before: float
    held_after: float
    scans: list[Scan]
    trials: list[list[Trial]]
    rivals: dict[int, list[tuple[Effect, float, float]]]
    refused: list[str]
    significant: bool
    priors: tuple = ()


def chi2_of(model: AbstractModel, point: Point, split: str) -> float:
    """chi2 of a point on the runs of `split`."""
    (r,) = model.residuals([point], split)
    return float(r @ r)


def threshold(score: Score, count: int) -> bool:
    """Whether a score is significant among `count` candidates."""
    return score.p * score.candidate.trials * count < ALPHA


def is_stepped(model: AbstractModel, effects) -> bool:
    """Whether a law among `effects` is stepped in time, so that all tangents change with it."""
    return any(model.laws[e.id].port in STEPPED for e in effects)


class Search:
    """The search over one model; `tell(text)` reports progress."""

    def __init__(self, model: AbstractModel, tell: Callable[[str], None] = lambda text: None):
        self.model, self.tell = model, tell

    def run(self) -> Found:
        """Search until nothing significant is left that held-out runs accept."""
        model = self.model
        self.tell("calibrating the uncertain parameters")
        start = Point(np.zeros(len(model.priors)))
        fit = refit(model, start, rounds=3)
        model.rebase(fit.point)
        baseline = fit = refit(model, fit.point, baseline=fit.jacobian, rounds=3)
        held_before = held = chi2_of(model, fit.point, "held-out")
        scans, all_trials, refused, significant = [], [], [], False
        self.held_ratio = model.dof("train") / max(1, model.dof("held-out"))
        while len(fit.point.effects) < MOST:
            scan = self.scan(fit)
            scans.append(scan)
            trials = self.trials(fit, scan, held)
            all_trials.append(trials)
            if not trials:
                break
            significant = True
            best = trials[0]
            if not self.accepted(best):
                refused.append(best.effect.name)
                break
            self.tell(f"accepted {best.effect.name}: held-out gain {best.held_gain:.0f}")
            fit = self.settle(best.fit)
            held = chi2_of(model, fit.point, "held-out")
            if self.floor_reached(fit, held):
                break
        fit, rivals = self.review(fit, scans)
        held = chi2_of(model, fit.point, "held-out")
        return Found(
            baseline,
            fit,
            held_before,
            held,
            scans,
            all_trials,
            rivals,
            refused,
            significant,
            tuple(model.priors),
        )

    def scan(self, fit: Fit) -> Scan:
        """Signatures and scores of all candidates at a fit."""
        model = self.model
        candidates = model.candidates(fit.point)
        self.tell(f"{len(candidates)} candidates")
        columns = model.columns(fit.point, candidates, lambda share: None)
        signatures = Signatures(candidates, columns)
        return signatures.scan(fit.residual, fit.jacobian, len(model.priors), fit.point.u)

    def trials(self, fit: Fit, scan: Scan, held: float) -> list[Trial]:
        """Joint refits of the best significant candidates, best first."""
        have = {e.name for e in fit.point.effects}
        count = len(scan.scores)
        best = [s for s in scan.best_per_name() if s.candidate.name not in have]
        best = [s for s in best if threshold(s, count)]
        if not best:
            return []
        short = [s for s in best[:4] if s.gain > 0.2 * best[0].gain]
        trials = []
        for score in short:
            trial = self.try_out(fit, score, held)
            self.tell(f"{trial.effect.name}: gain {trial.gain:.0f}, held-out {trial.held_gain:.0f}")
            trials.append(trial)
            if self.floor_reached(trial.fit, held - trial.held_gain):
                break  # nothing left to explain; near rivals are tried in `challenge`

        # a free number costs half of log N, as in the Bayesian information criterion
        def cost(t):
            return t.fit.cost + np.log(len(t.fit.residual)) * len(t.fit.free)

        return sorted(trials, key=cost)

    def try_out(self, fit: Fit, score: Score, held: float) -> Trial:
        """Add one candidate and refit everything together."""
        c = score.candidate
        effect = Effect(c.id, c.place, c.decode(score.coefficients))
        effects = (*fit.point.effects, effect)
        point = fit.point.with_effects(*effects)
        P = len(self.model.priors)
        tangents = None if is_stepped(self.model, effects) else fit.jacobian[:, :P]
        point = self.tamed(point, fit.cost)
        new = refit(self.model, point, baseline=tangents, rounds=4)
        after = chi2_of(self.model, new.point, "held-out")
        return Trial(new.point.effects[-1], new, fit.cost - new.cost, held - after)

    def tamed(self, point: Point, cost: float) -> Point:
        """The point with its newest effect weakened until it is no worse than without it."""
        *others, last = point.effects
        law = self.model.laws[last.id]
        strong = [k for k in last.values if law.parameters[k].linear or k == "gap"]
        if not strong or not is_stepped(self.model, [last]):
            return point
        for factor in (1.0, 0.5, 0.2, 0.05):
            values = last.values | {k: factor * last.values[k] for k in strong}
            weaker = point.with_effects(*others, Effect(last.id, last.place, values))
            chi2 = chi2_of(self.model, weaker, "train")
            if np.isfinite(chi2) and chi2 < cost:
                return weaker
        return weaker

    def accepted(self, trial: Trial) -> bool:
        """Whether held-out runs confirm what the train runs gained."""
        enough = trial.held_gain * self.held_ratio > HELD_SHARE * trial.gain
        return trial.held_gain > HELD_GAIN and enough

    def settle(self, fit: Fit) -> Fit:
        """Smooth about the new point and polish there, with tangents of its own."""
        self.model.rebase(fit.point)
        return self.widened(refit(self.model, fit.point, rounds=5))

    def widened(self, fit: Fit) -> Fit:
        """The fit with the friction laws' widths free, where the data ask for other widths.

        The widths of a real machine are unknown, so no answer may hang on them.
        """
        wide = []
        for effect in fit.point.effects:
            fields = self.model.laws[effect.id].__dataclass_fields__
            default = {"width": float(fields["width"].default)} if "width" in fields else {}
            wide.append(Effect(effect.id, effect.place, default | effect.values))
        if not any("width" in e.values for e in wide):
            return fit
        P = len(self.model.priors)
        tangents = None if is_stepped(self.model, wide) else fit.jacobian[:, :P]
        freed = refit(
            self.model, fit.point.with_effects(*wide), baseline=tangents, rounds=4, widths=True
        )
        return freed if freed.cost < fit.cost - MARGIN else fit

    def floor_reached(self, fit: Fit, held: float) -> bool:
        """Whether what is left is noise: chi2 within four standard deviations of its mean."""
        n, m = self.model.dof("train"), self.model.dof("held-out")
        return fit.chi2 < n + 4 * np.sqrt(2 * n) and held < m + 4 * np.sqrt(2 * m)

    def review(self, fit: Fit, scans: list[Scan]) -> tuple[Fit, dict]:
        """Prune what is not needed, swap in rivals that fit better, and keep the near ones."""
        fit = self.prune(fit)
        rivals: dict[int, list[tuple[Effect, float, float]]] = {}
        for i in range(len(fit.point.effects)):
            fit, rivals[i] = self.challenge(fit, i, scans)
        return fit, rivals

    def prune(self, fit: Fit) -> Fit:
        """Leave out effects without which the joint refit is as good."""
        k = 0
        while len(fit.point.effects) > 1 and k < len(fit.point.effects):
            effects = fit.point.effects
            without = fit.point.with_effects(*effects[:k], *effects[k + 1 :])
            less = refit(self.model, without, rounds=2)
            if less.cost - fit.cost < MARGIN:
                fit, k = less, 0
            else:
                k += 1
        return fit

    def challenge(self, fit: Fit, i: int, scans: list[Scan]) -> tuple[Fit, list]:
        """Rivals of effect i: candidates that explain nearly as much where it is left out."""
        model, effects = self.model, fit.point.effects
        others = (*effects[:i], *effects[i + 1 :])
        without = fit.point.with_effects(*others)
        (residual,) = model.residuals([without], "train")
        keep = [k for k in range(fit.jacobian.shape[1]) if not self._belongs(fit, k, i)]
        scan = scans[0].signatures.scan(
            residual, fit.jacobian[:, keep], len(model.priors), without.u
        )
        names = {e.name for e in effects}
        own = max((s.gain for s in scan.scores if s.candidate.name == effects[i].name), default=0.0)
        near = [s for s in scan.best_per_name() if s.candidate.name not in names]
        near = [s for s in near if s.gain > 0.9 * own or own - s.gain < 4 * MARGIN][:4]
        found = []
        for score in near:
            c = score.candidate
            rival = Effect(c.id, c.place, c.decode(score.coefficients))
            point = without.with_effects(*effects[:i], rival, *effects[i + 1 :])
            tangents = (
                None if is_stepped(model, point.effects) else fit.jacobian[:, : len(model.priors)]
            )
            new = refit(model, point, baseline=tangents, rounds=4)
            if new.cost - fit.cost < 40 * MARGIN:  # twins: both with their widths free
                new = self.widened(new)
            self.tell(f"rival {c.name} of {effects[i].name}: margin {new.cost - fit.cost:.1f}")
            if new.cost < fit.cost - MARGIN:
                return self.challenge(self.settle(new), i, scans) if len(found) < 2 else (new, [])
            own_index = self._index(scan, effects[i].name)
            cosine = scan.cosine(own_index, score.index) if own_index is not None else 0.0
            found.append((new.point.effects[i], new.cost - fit.cost, cosine))
        return fit, sorted(found, key=lambda f: f[1])

    def _belongs(self, fit: Fit, column: int, effect: int) -> bool:
        k = column - len(self.model.priors)
        return k >= 0 and fit.free[k].effect == effect

    @staticmethod
    def _index(scan: Scan, name: str) -> int | None:
        found = [s for s in scan.order if s.candidate.name == name]
        return found[0].index if found else None
