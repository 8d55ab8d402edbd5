"""The review of a found set: prune what is not needed, swap in what fits better, keep near rivals.

Every effect is challenged in the joint refit by the candidates that explain nearly as much where
it is left out, as scored at the latest fit with the other effects in.
"""

from collections.abc import Callable

import numpy as np

from .fit import Fit, refit
from .model import Effect
from .refits import MARGIN, Refits, chi2_of
from .scan import Scan, Signatures

Rival = tuple[Effect, float, float]  # the effect, its margin, the cosine of the signatures
NEAR = 4 * MARGIN  # linear estimate of a margin below which a rival is refitted in any case
LIKE = 0.9  # share of an effect's own gain from which a rival is refitted, among the best few
FEW, MOST, SWAPS = 4, 8, 3
FAR = 10.0  # times the cost: a rival above it after one round imitates nothing


class Review:
    """Pruning and challenges on one model."""

    def __init__(self, refits: Refits, tell: Callable[[str], None]):
        self.refits, self.model, self.tell = refits, refits.model, tell

    def run(self, fit: Fit, signatures: Signatures) -> tuple[Fit, dict[int, list[Rival]]]:
        """The reviewed fit, and the near rivals of each of its effects, nearest first."""
        fit = self.prune(fit)
        for _ in range(SWAPS):
            if self.model.spent:
                break
            rivals: dict[int, list[Rival]] = {}
            for i in range(len(fit.point.effects)):
                better, rivals[i] = self.challenge(fit, i, signatures)
                if better is not None:
                    # what stood for the misfit of the effect that left is not needed any more
                    fit = self.prune(self.refits.settle(better))
                    break
            else:
                return fit, rivals
        count = range(len(fit.point.effects))
        return fit, {i: self.challenge(fit, i, signatures)[1] for i in count}

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

    def challenge(self, fit: Fit, i: int, signatures: Signatures) -> tuple[Fit | None, list[Rival]]:
        """(a refit that is better with another effect in place of effect i, or None; rivals)."""
        effects, others = fit.point.effects, list(fit.point.effects)
        others.pop(i)
        again = self._scan_without(fit, i, signatures)
        mine = [s for s in again.order if s.candidate.name == effects[i].name]
        own = max((s.gain for s in mine), default=0.0)
        found = []
        for score in self._near(again, own, {e.name for e in effects}):
            if self.model.spent:
                break
            c = score.candidate
            rival = Effect(c.id, c.place, c.decode(score.coefficients))
            point = fit.point.with_effects(*effects[:i], rival, *effects[i + 1 :])
            # the tangents of the effect that a rival imitates, until they prove wrong
            tangents = fit.jacobian[:, : len(fit.point.u)]
            new = refit(self.model, point, baseline=tangents, rounds=4,
                        give_up=FAR * fit.cost, patience=1)  # fmt: skip
            new = self.refits.widened(new, fit.cost)
            margin = new.cost - fit.cost
            self.tell(f"rival {c.name} of {effects[i].name}: margin {margin:.1f}")
            if margin < -MARGIN and self._held(new) < self._held(fit):
                return new, []
            cosine = again.cosine(mine[0].index, score.index) if mine else 0.0
            found.append((new.point.effects[i], margin, cosine))
        return None, sorted(found, key=lambda f: f[1])

    def _near(self, scan: Scan, own: float, names: set[str]):
        """Candidates worth a refit beside an effect that gains `own`."""
        best = [s for s in scan.best_per_name() if s.candidate.name not in names]
        near = [s for s in best[:MOST] if own - s.gain < NEAR]
        return near + [
            s for s in best[:FEW] if s.gain > LIKE * own and all(s is not n for n in near)
        ]

    def _scan_without(self, fit: Fit, i: int, signatures: Signatures) -> Scan:
        """Scores where effect i is left out, the other effects and the baseline free."""
        effects = fit.point.effects
        without = fit.point.with_effects(*effects[:i], *effects[i + 1 :])
        (residual,) = self.model.residuals([without], "train")
        P, columns = len(self.model.priors), range(fit.jacobian.shape[1])
        keep = [k for k in columns if k < P or fit.free[k - P].effect != i]
        return signatures.scan(residual, fit.jacobian[:, np.array(keep, int)], P, without.u)

    def _held(self, fit: Fit) -> float:
        return chi2_of(self.model, fit.point, "held-out")
