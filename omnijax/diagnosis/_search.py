"""The search: one effect after the other by score, joint refit and held-out gain; then pruning."""

import dataclasses
from collections.abc import Callable

import numpy as np

from ._fit import Fit, refit
from ._model import AbstractModel, Effect, Point
from ._scan import Scan, Score, Signatures, chance

ALPHA = 1e-3  # chance of a false candidate in a whole scan
HELD_SURE = 4.0  # standard deviations by which held-out runs must confirm a predicted change
HELD_SHARE = 1.5  # factor by which a change on held-out runs may be off the predicted one
SHUFFLES = 4  # shuffled residuals whose best candidate is the decoy to beat
CLOSED = 0.95  # share of the held-out gap that a named set has to close
MARGIN = 25.0  # least difference of chi2 between the joint refits of rivals
NEARLY = 1.3  # chi2 a degree of freedom at which no other candidate needs to be tried first
MOST = 4  # effects
STEPPED = ("contact", "mount", "separation")


@dataclasses.dataclass(frozen=True)
class HeldOut:
    """What the held-out runs say of a change d of the prediction, r the residual before it.

    d was fitted elsewhere, so without an effect d.r/|d| is standard normal: one test, no multiple.
    With the effect r = d + noise, so the multiplier d.r/d.d is 1; a change that stands for
    something else, or for noise, has another one, below 1/2 where it makes the residual larger.
    """

    gain: float  # fall of chi2, |r|^2 - |r - d|^2
    size: float  # d.d

    @staticmethod
    def of(before: np.ndarray, after: np.ndarray) -> "HeldOut":
        """From the residuals before and after."""
        d = before - after
        return HeldOut(float(d @ (before + after)), float(d @ d))

    @property
    def multiplier(self) -> float:
        """Share of the predicted change that is there."""
        return 0.5 * (self.gain / self.size + 1) if self.size > 0 else 0.0

    @property
    def sure(self) -> float:
        """Standard deviations of the multiplier from zero."""
        return self.multiplier * float(np.sqrt(self.size))

    def confirms(self, gain: float) -> bool:
        """Whether it is the effect that gained `gain` on the train runs."""
        if not np.isfinite(self.gain):
            return False
        spread = np.sqrt(1 / max(self.size, 1e-300) + 1 / max(gain, 1e-300))
        slack = min(3 * spread, 0.15)
        same = 1 / HELD_SHARE - slack < self.multiplier < HELD_SHARE + slack
        return same and self.sure > HELD_SURE


@dataclasses.dataclass(frozen=True)
class Trial:
    """A refitted rival: the effect, its fit, its gain on the train runs, and the held-out runs."""

    effect: Effect
    fit: Fit
    gain: float
    held: HeldOut

    @property
    def accepted(self) -> bool:
        """Whether held-out runs confirm what the train runs gained."""
        return self.held.confirms(self.gain)


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


def residual_of(model: AbstractModel, point: Point, split: str) -> np.ndarray:
    """Residual of a point on the runs of `split`."""
    return model.residuals([point], split)[0]


def chi2_of(model: AbstractModel, point: Point, split: str) -> float:
    """chi2 of a point on the runs of `split`."""
    (r,) = model.residuals([point], split)
    return float(r @ r)


def significant(scan: Scan, spread: float) -> list[Score]:
    """The best variant of every (id, place) that stands out, best first.

    A gain is compared with the residual's own `spread` (chi2 a degree of freedom, at least 1), with
    its chance among all candidates, and with what the best decoy gained.
    """
    count, decoy = len(scan.scores), scan.decoy
    return [
        s for s in scan.best_per_name()
        if chance(s.gain / spread, s.columns) * s.candidate.trials * count < ALPHA
        and s.merit > decoy
    ]  # fmt: skip


def is_stepped(model: AbstractModel, effects) -> bool:
    """Whether a law among `effects` is stepped in time, so that all tangents change with it."""
    return any(model.laws[e.id].port in STEPPED for e in effects)


class Search:
    """The search over one model; `tell(text)` reports progress."""

    def __init__(self, model: AbstractModel, tell: Callable[[str], None] = lambda text: None):
        self.model, self.tell = model, tell

    def run(self, start: Point | None = None) -> Found:
        """Search from a calibrated `start` until nothing is left that held-out runs accept."""
        model = self.model
        start = start or Point(np.zeros(len(model.priors)))
        fit = refit(model, start, relative=0.01)
        model.rebase(fit.point)
        baseline = fit = refit(model, fit.point, baseline=fit.jacobian, relative=0.01)
        held_before = chi2_of(model, fit.point, "held-out")
        scans, all_trials, refused, found_any = [], [], [], False
        while len(fit.point.effects) < MOST:
            scans.append(self.scan(fit))
            trials = self.trials(fit, scans[-1])
            all_trials.append(trials)
            found_any |= bool(trials)
            refused += [t.effect.name for t in trials if not t.accepted]
            best = next((t for t in trials if t.accepted), None)
            if best is None:
                break
            self.tell(
                f"accepted {best.effect.name}: held-out runs show "
                f"{best.held.multiplier:.2f} ± {1 / np.sqrt(best.held.size):.2g} of the change"
            )
            fit = self.settle(best.fit)
            if self.floor_reached(fit, chi2_of(model, fit.point, "held-out")):
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
            found_any,
            tuple(model.priors),
        )

    def scan(self, fit: Fit) -> Scan:
        """Signatures and scores of all candidates at a fit."""
        model = self.model
        candidates = model.candidates(fit.point)
        self.tell(f"{len(candidates)} candidates")
        columns = model.columns(fit.point, candidates, lambda share: None)
        signatures = Signatures(candidates, columns)
        scrambled = [model.shuffled(fit.residual, seed) for seed in range(SHUFFLES)]
        return signatures.scan(
            fit.residual, fit.jacobian, len(model.priors), fit.point.u, scrambled
        )

    def trials(self, fit: Fit, scan: Scan) -> list[Trial]:
        """Joint refits of the best significant candidates, best first."""
        have = {e.name for e in fit.point.effects}
        train, held = self.model.dof("train"), self.model.dof("held-out")
        spread = max(1.0, fit.chi2 / train)
        best = [s for s in significant(scan, spread) if s.candidate.name not in have]
        before = residual_of(self.model, fit.point, "held-out")
        trials = []
        for score in [s for s in best[:4] if s.gain > 0.2 * best[0].gain]:
            trial = self.try_out(fit, score, before)
            self.tell(
                f"{trial.effect.name}: gain {trial.gain:.0f}, held-out {trial.held.gain:.0f}, "
                f"share {trial.held.multiplier:.2f}"
            )
            trials.append(trial)
            left = float(before @ before) - trial.held.gain
            if trial.fit.chi2 < NEARLY * train and left < NEARLY * held:
                break  # next to nothing left to explain; near rivals are tried in `challenge`

        # a free number costs log N, as in the Bayesian information criterion
        def cost(t):
            return t.fit.cost + np.log(len(t.fit.residual)) * len(t.fit.free)

        return sorted(trials, key=cost)

    def try_out(self, fit: Fit, score: Score, before: np.ndarray) -> Trial:
        """Add one candidate and refit everything together; `before` is the held-out residual."""
        c = score.candidate
        effect = Effect(c.id, c.place, c.decode(score.coefficients))
        effects = (*fit.point.effects, effect)
        point = fit.point.with_effects(*effects)
        P = len(self.model.priors)
        tangents = None if is_stepped(self.model, effects) else fit.jacobian[:, :P]
        point = self.tamed(point, fit.cost)
        new = refit(self.model, point, baseline=tangents, rounds=8, relative=1e-3)
        after = residual_of(self.model, new.point, "held-out")
        return Trial(new.point.effects[-1], new, fit.cost - new.cost, HeldOut.of(before, after))

    def tamed(self, point: Point, cost: float) -> Point:
        """Where to begin a refit: calibrated as before, or as stated where that is better.

        A wrong model drives the calibration to its bounds.  A law that is stepped in time is
        weakened until the point is no worse than without it.
        """
        *others, last = point.effects
        law = self.model.laws[last.id]
        strong = [k for k in last.values if law.parameters[k].linear or k == "gap"]
        stepped = strong and is_stepped(self.model, [last])
        best, least = point, np.inf
        for factor in (1.0, 0.5, 0.2, 0.05) if stepped else (1.0,):
            values = last.values | {k: factor * last.values[k] for k in strong}
            effects = (*others, Effect(last.id, last.place, values))
            for u in (point.u, 0 * point.u):
                there = Point(u, effects)
                found = chi2_of(self.model, there, "train") + float(u @ u)
                if np.isfinite(found) and found < least:
                    best, least = there, found
            if least < cost:
                break
        return best

    def settle(self, fit: Fit) -> Fit:
        """Smooth about the new point and polish there, with tangents of its own."""
        self.model.rebase(fit.point)
        return self.widened(refit(self.model, fit.point, rounds=10))

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
