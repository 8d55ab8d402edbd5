"""The review of the accepted effects: leave out needless ones, swap in better ones, keep rivals.

Every effect is challenged in the joint refit by the candidates that explain nearly as much where
it is left out, as scored at the latest fit with the other effects in.
"""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .._settings import SETTINGS
from .candidates import strengths
from .doubt import shown_within_doubt
from .fit import Fit, refit
from .held_out import HeldOut
from .model import Effect, Point, to_project
from .refits import Refits, chi2_of, residual_of
from .scan import Scan, Score, Signatures, taken_up
from .through_laws import scored_through_laws

RIVAL_STEPS = SETTINGS.refits.rival_steps
WITHOUT_STEPS = SETTINGS.refits.without_steps


class Rival(NamedTuple):
    """An effect in another one's place, and the evidence of its own refit."""

    effect: Effect
    margin: float  # by which its refit is worse; what held-out runs add counts
    cosine: float  # of the two signatures
    chi2: float  # of the train rows
    held: float | None  # chi2 of the held-out rows; None where it is too far for that
    covariances: dict[str, np.ndarray]  # by free number (k, k)


@dataclasses.dataclass(frozen=True)
class Reviewed:
    """A reviewed fit; by effect the refit without it, and its near rivals, nearest first.

    `left_out` says by name why an effect of the way is not in it, `wider` by name which laws that
    an effect is a limit of explain the runs as well.
    """

    fit: Fit
    alone: dict[int, Fit]
    rivals: dict[int, list[Rival]]
    left_out: dict[str, str]
    wider: dict[str, list[str]]


class Review:
    """Pruning and challenges on one model.

    If one law is a limit of the other, the plainer is kept unless the wider one fits better.
    """

    def __init__(self, refits: Refits, tell: Callable[[str], None], who: str = "held-out runs"):
        self.refits, self.model, self.tell, self.who = refits, refits.model, tell, who
        self.settings, self.left_out = self.model.settings, {}
        self.wider: dict[str, list[str]] = {}

    def run(self, fit: Fit, signatures: Signatures, baseline: Fit) -> Reviewed:
        """The reviewed fit, what it is without each effect, and the near rivals of each."""
        fit, alone = self.prune(fit, baseline)
        for _ in range(self.settings.swaps):
            if self.model.spent:
                break
            rivals: dict[int, list[Rival]] = {}
            for i in range(len(fit.point.effects)):
                better, rivals[i] = self.challenge(fit, i, signatures)
                if better is not None:
                    # what stood for the misfit of the effect that left is not needed any more
                    fit, alone = self.prune(self.refits.settle(better), baseline)
                    break
            else:
                return Reviewed(fit, alone, rivals, self.left_out, self.wider)
        count = range(len(fit.point.effects))
        rivals = {i: self.challenge(fit, i, signatures)[1] for i in count}
        return Reviewed(fit, alone, rivals, self.left_out, self.wider)

    def prune(self, fit: Fit, baseline: Fit) -> tuple[Fit, dict[int, Fit]]:
        """Leave out effects without which the refit is as good; the refits without the others.

        What is left out stands among the limits, however significant; `left_out` says why.
        """
        k, alone = 0, {}
        while k < len(fit.point.effects):
            effects, without = fit.point.effects, fit.point.without(k)
            start = without if without.effects else baseline.point
            less = refit(self.model, start, rounds=WITHOUT_STEPS)
            why = self._needless(less, fit, baseline, effects[k])
            if why:
                self.tell(f"{effects[k].name} is not needed: {why}")
                self.left_out[effects[k].name] = why
                fit, k, alone = less, 0, {}
            else:
                alone[k] = less
                k += 1
        return fit, alone

    def _needless(self, less: Fit, fit: Fit, baseline: Fit, effect: Effect) -> str:
        """Why `less`, which lacks an effect of `fit`, is as good; nothing where it is not.

        An effect of an earlier search was confirmed under that search's noise; under the present
        noise the held-out runs may fit better without it.
        """
        if less.cost - fit.cost < self.settings.margin and not self._shown(less, fit):
            return "the fitted runs do without it"
        if not self._matters(less, fit, baseline):
            return f"it moves no output group's RMS by {100 * self.settings.material_change:g} %"
        if self._refused(less, fit):
            return f"{self.who} are better foretold without it"
        if self.model.as_noise(less, fit, effect):
            return "noise of its channel explains as much"
        return ""

    def _shown(self, less: Fit, fit: Fit) -> bool:
        """Whether held-out runs show within doubt what `less` lacks of a fit."""
        return shown_within_doubt(self.model, less, fit) >= self.settings.margin

    def _refused(self, less: Fit, fit: Fit) -> bool:
        """Whether held-out runs are better foretold by `less`, which has an effect less."""
        without, with_it = (chi2_of(self.model, f.point, "held-out") for f in (less, fit))
        return without < with_it

    def _matters(self, less: Fit, fit: Fit, baseline: Fit) -> bool:
        """Whether leaving an effect out raises some group's RMS by more than one per cent.

        Either in the fitted runs or in the held-out ones, which may excite it more.  The rise also
        has to exceed the prediction error, a share of the change that all effects make.
        """
        fits = (baseline, less, fit)
        if self._raises(*(self.model.group_rms(f.residual, "train") for f in fits)):
            return True
        held = (residual_of(self.model, f.point, "held-out") for f in fits)
        return self._raises(*(self.model.group_rms(x, "held-out") for x in held))

    def _raises(self, first: dict[str, float], without: dict[str, float],
                with_it: dict[str, float]) -> bool:  # fmt: skip
        """`_matters` in one split, by RMS of groups without effects, `without` one, and with it."""
        settings = self.settings
        return any(
            without[g] > (1 + settings.material_change) * x
            and without[g] ** 2 - x**2 > settings.prediction_error**2 * (first[g] ** 2 - x**2)
            for g, x in with_it.items()
        )

    def challenge(self, fit: Fit, i: int, signatures: Signatures) -> tuple[Fit | None, list[Rival]]:
        """(a refit that is better with another effect in place of effect i, or None; rivals)."""
        effects = fit.point.effects
        again = self._scan_without(fit, i, signatures)
        mine = [s for s in again.order if s.candidate.name == effects[i].name]
        own = max((s.gain for s in mine), default=0.0)
        rivals, alone = [], None
        self.wider[effects[i].name] = []
        for score in self._near(again, own, fit, i):
            if self.model.spent:
                break
            new, best, held, left_held = self._refitted(fit, i, score), fit, 0.0, None
            if new.cost - fit.cost < max(
                self.settings.near_margin, self.settings.least_closed * own
            ):
                alone = alone or self.model.on_its_own(fit)
                (best, left), (new, rival_left) = alone, self.model.on_its_own(new)
                held = self._held_margin(rival_left, left)
                left_held = float(rival_left @ rival_left)
            rival, margin = new.point.effects[i], self.model.margin(best, new)
            self.tell(f"rival {rival.name} of {effects[i].name}: margin {margin:.1f}")
            plainer = self.model.plainness(effects[i]) - self.model.plainness(rival)
            least = -max(self.settings.equal_margin, plainer * own)
            if self._widens(rival, effects[i]):
                least = -self.settings.equal_margin
            elif self._widens(effects[i], rival):  # what it is more than the rival has to show
                least = self.settings.equal_margin
            if margin < least:  # by train runs alone, unless held-out runs refuse it
                if self._foretells(new, fit, i):
                    return new, []
                continue
            alike = abs(margin) < self.settings.equal_margin
            if margin < self.settings.near_margin:
                margin += held
            if alike and margin < -self.settings.equal_margin and self._foretells(new, fit, i):
                return new, []  # the train runs tell both as well, and held-out runs refuse this
            if self._widens(rival, effects[i]):  # one that explains as much is no other explanation
                if margin < self.settings.near_margin:
                    self.wider[effects[i].name].append(rival.name)
                continue
            cosine = again.cosine(mine[0].index, score.index) if mine else 0.0
            own_numbers = new.covariances(i, new.scaled_covariance(self.model.dof("train")))
            rivals.append(Rival(rival, margin, cosine, new.chi2, left_held, own_numbers))
        return None, sorted(rivals, key=lambda rival: rival.margin)

    def _foretells(self, new: Fit, fit: Fit, i: int) -> bool:
        """Whether held-out runs are no better foretold without the rival in place of effect i."""
        return not self._refused(refit(self.model, fit.point.without(i), rounds=WITHOUT_STEPS), new)

    def _refitted(self, fit: Fit, i: int, score: Score) -> Fit:
        """The refit with a scored candidate in place of effect i."""
        # the tangents of the effect that a rival imitates, until they prove wrong
        tangents = fit.jacobian[:, : len(fit.point.u)]
        new = refit(self.model, self._in_place(fit, i, score), baseline=tangents,
                    rounds=RIVAL_STEPS, give_up=self.settings.far_cost * fit.cost,
                    patience=1)  # fmt: skip
        if (
            new.cost - fit.cost < self.settings.near_margin
        ):  # too near to hang on another's tangents
            new = refit(self.model, new.point)
        return self.refits.widened(new, fit.cost)

    def _in_place(self, fit: Fit, i: int, score: Score) -> Point:
        """The fit with a scored candidate in place of effect i, where its refit may begin.

        It begins at the strength of its tangent.  A law whose only number is a time also tries the
        time of effect i, and the better is taken: a delay's tangents do not tell its length.
        """
        c, effects = score.candidate, fit.point.effects
        values = [c.decode(score.coefficients), *self._alike(effects[i], c.id)]
        points = [
            fit.point.with_effects(*effects[:i], Effect(c.id, c.place, x), *effects[i + 1 :])
            for x in values
        ]
        if len(points) == 1:
            return points[0]
        costs = [chi2_of(self.model, p, "train") for p in points]
        return points[int(np.nanargmin(np.nan_to_num(costs, nan=np.inf)))]

    def _alike(self, effect: Effect, id: str) -> list[dict[str, float]]:
        """The number of a law `id` with only one, equal to the effect's own if units agree."""
        mine, other = (self.model.laws[k].parameters for k in (effect.id, id))
        if len(mine) != 1 or len(other) != 1:
            return []
        ((key, a),), ((to, b),) = mine.items(), other.items()
        one = a.unit == b.unit and not (a.linear or b.linear or a.shape or b.shape)
        return [{to: float(effect.values[key])}] if one else []

    def _elsewhere(self, scan: Scan, fit: Fit, i: int) -> list[Score]:
        """The law of effect i at all wheels instead of one, or at one instead of all, where it does
        no more with the same numbers: at the others the runs do not reach its threshold.
        """
        effect, effects = fit.point.effects[i], fit.point.effects
        others = fit.point.without(i).effects
        if strengths(self.model.laws[effect.id]):
            return []
        by_place = {s.candidate.place: s for s in scan.scores if s.candidate.id == effect.id}
        out = []
        for place, score in by_place.items():
            if "all" not in (place, effect.place) or place == effect.place:
                continue
            moved = dataclasses.replace(effect, place=place)
            point = fit.point.with_effects(*effects[:i], moved, *effects[i + 1 :])
            alike = chi2_of(self.model, point, "train") < fit.chi2 + self.settings.near_margin
            if alike and not self.model.has(others, effect.id, place):
                out.append(score)
        return out

    @staticmethod
    def _held_margin(rival_left: np.ndarray, left: np.ndarray) -> float:
        """chi2 by which held-out runs speak against what a near rival leaves there.

        Two similar laws, fitted to the train runs, are told apart better if the held-out runs count
        too; a coloured residual there counts for less.  If one of the laws is right, their
        difference d changes chi2 by d.d or -d.d, apart from noise.  A larger change comes from
        something else that resembles d, so the gain is cut to that range.
        """
        held = HeldOut.of(rival_left, left)
        told = float(np.clip(held.gain, -held.size, held.size))
        return told / held.spread if np.isfinite(held.gain) else np.inf

    def _widens(self, wide: Effect, plain: Effect) -> bool:
        """Whether the one law is the other at a limit of its numbers, at the same place."""
        return plain.id in self.model.laws[wide.id].widens and wide.place == plain.place

    def _near(self, scan: Scan, own: float, fit: Fit, i: int):
        """Candidates worth a refit in place of effect i, which gains `own`."""
        effects = fit.point.effects
        names, others = {e.name for e in effects}, fit.point.without(i).effects
        best = [s for s in scan.best_per_name() if s.candidate.name not in names
                and not self.model.has(others, s.candidate.id, s.candidate.place)]  # fmt: skip
        near = [
            s for s in best[: self.settings.most_rivals] if own - s.gain < self.settings.near_margin
        ]
        like = [
            s for s in best[: self.settings.like_rivals] if s.gain > self.settings.like_gain * own
        ]
        elsewhere = self._elsewhere(scan, fit, i)
        return list({s.candidate.name: s for s in [*near, *elsewhere, *like]}.values())

    def _scan_without(self, fit: Fit, i: int, signatures: Signatures) -> Scan:
        """Scores where effect i is left out, the other effects and the baseline free."""
        effects, without = fit.point.effects, fit.point.without(i)
        (residual,) = self.model.residuals([without], "train")
        P, columns = len(self.model.priors), range(fit.jacobian.shape[1])
        keep = [k for k in columns if k < P or fit.free[k - P].effect != i]
        J, u = to_project(self.model, fit.jacobian[:, np.array(keep, int)], without.u)
        taken, name = taken_up(J, len(u)), effects[i].name

        def near(scan: Scan) -> list[str]:
            best = scan.best_per_name()[: self.settings.most_rivals]
            return [*dict.fromkeys((name, *(s.candidate.name for s in best)))]

        return scored_through_laws(
            self.model, without, signatures,
            lambda: signatures.scan(residual, taken, u, about=name), near,
        )  # fmt: skip
