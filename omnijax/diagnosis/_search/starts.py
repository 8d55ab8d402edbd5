"""Where joint refits begin: candidates by tangent, or at finite strength where effects are strong.

A tangent at zero ranks a weak effect right.  A strong effect bends its own signature and pulls the
calibration away, where every signature is wrong.  Then each law that is stepped in time is tried
about the stated machine at a ladder of strengths, with the baseline refitted to first order.
"""

import dataclasses
import itertools
from collections.abc import Callable, Sequence

import numpy as np

from .._settings import SETTINGS
from .candidates import strengths
from .fit import Fit, predicted, tangents_at
from .model import STEPPED, AbstractModel, Effect, Point
from .scan import COLUMN_PRICE, Scan, Score
from .valley import ends_of_valleys
from .waves import scanned_beside

LINES = {"order", "frequency"}  # numbers of a line
EQUAL_GAIN = SETTINGS.starts.equal_gain
OTHER_LINES = SETTINGS.starts.other_lines
NAME_GAIN = SETTINGS.starts.name_gain
TOGETHER = SETTINGS.starts.together
AS_FORETOLD = SETTINGS.starts.as_foretold
HALVINGS = SETTINGS.starts.halvings


@dataclasses.dataclass(frozen=True)
class Start:
    """A point whose last effect is new, and what it is estimated to cost once all is refitted.

    A free number counts as in `Score.merit`.
    """

    point: Point
    cost: float

    @property
    def name(self) -> str:
        """id@place of the new effect."""
        return self.point.effects[-1].name


def by_tangent(fit: Fit, scores: Sequence[Score]) -> list[Start]:
    """Starts at the strengths that the tangents at `fit` estimate."""
    out = []
    for s in scores:
        effect = Effect(s.candidate.id, s.candidate.place, s.candidate.decode(s.coefficients))
        out.append(Start(fit.point.with_effects(*fit.point.effects, effect), fit.cost - s.merit))
    return out


def other_lines(
    model: AbstractModel, fit: Fit, scan: Scan, scores: Sequence[Score]
) -> dict[str, list[Start]]:
    """By name the starts of lines that explain nearly as much as the best one of `scores` does.

    A refit does not move a line's number (waves a turn, or a second) from one line to another, and
    a number that is a little off lowers the gain of the right line.  So each is refitted, and the
    refits are compared.
    """
    out = {}
    for best in scores:
        c = best.candidate
        if not LINES & set(model.laws[c.id].parameters):
            continue
        near = [
            s for s in scan.order
            if s.candidate.name == c.name and s.index != best.index and s.allowed
            and s.gain > EQUAL_GAIN * best.gain
        ]  # fmt: skip
        out[c.name] = by_tangent(fit, near[:OTHER_LINES])
    return out


def at_finite_strength(
    model: AbstractModel, fit: Fit, scores: Sequence[Score], ids: set[str],
    leading: Sequence[Score] = (),
) -> list[Start]:  # fmt: skip
    """The best start of every (id, place) of the laws `ids`, over strengths of both signs.

    Where the calibration ran off, all are tried about the stated machine, and the scores `leading`
    also about the calibrated one.  The laws of `_hidden` are always tried about the stated machine:
    the calibration has bent to what they do.  Where the runs tell only one combination of some
    numbers, starts stand at the ends of that valley too.
    """
    u = fit.point.u
    kept = np.max(np.abs(u), initial=0.0) < model.settings.bent_sigmas
    stated = Point(0 * u, fit.point.effects)
    anchors = [] if kept else [stated]
    if kept or model.settings.both_anchors:
        anchors.append(fit.point)
    if model.settings.both_anchors:
        anchors += ends_of_valleys(model, fit)
    tried = [(anchor, scores) for anchor in anchors]
    if leading and not any(anchor is fit.point for anchor in anchors):
        tried.append((fit.point, leading))
    still = ids & without_strength(model)
    hidden = _hidden(model, fit, [s for s in scores if s.candidate.id in still]) if kept else []
    if hidden:
        tried.append((stated, hidden))
    best: dict[str, Start] = {}
    for anchor, some in tried:
        for start in _about(anchor, model, fit, some, ids):
            if start.name not in best or start.cost < best[start.name].cost:
                best[start.name] = start
    return list(best.values())


def _hidden(model: AbstractModel, fit: Fit, scores: Sequence[Score]) -> list[Score]:
    """Scores of laws that change nothing about the fit, or have no number and change little there.

    "Little" is less than the residual itself.  What such a law does about the stated machine does
    not show about the fit, so it is tried about the stated one too.
    """
    whole = [s for s in scores if not s.dead and not model.laws[s.candidate.id].parameters]
    effects = [Effect(s.candidate.id, s.candidate.place, {}) for s in whole]
    points = [fit.point, *(fit.point.with_effects(*fit.point.effects, e) for e in effects)]
    dead = [s for s in scores if s.dead]
    if not whole:
        return dead
    here, *there = model.residuals(points, model.ranking)
    little = [s for s, r in zip(whole, there, strict=True) if np.sum((r - here) ** 2) < here @ here]
    return [*dead, *little]


def _about(anchor: Point, model: AbstractModel, fit: Fit, scores, ids: set[str]) -> list[Start]:
    """The best start of every (id, place), the baseline refitted to first order about `anchor`."""
    (here,) = model.residuals([anchor], model.ranking)
    J = fit.jacobian if anchor is fit.point else tangents_at(model, anchor, model.ranking)
    J, chi2 = J[: len(here)], float(fit.residual @ fit.residual)
    _, without = predicted(model, anchor, here, J)
    share = fit.cost / without  # estimates are compared with that of no law, made alike
    known = fit.point.effects
    scores = [s for s in scores if not model.has(known, s.candidate.id, s.candidate.place)]

    def tried(effects: list[Effect]) -> list[Start]:  # the points of a law run side by side
        if not effects:
            return []
        points = [anchor.with_effects(*anchor.effects, e) for e in effects]
        starts = []
        for point, residual in zip(points, model.residuals(points, model.ranking), strict=True):
            if np.all(np.abs(residual) < 1e100):
                there, cost = predicted(model, anchor, residual, J)
                full = there.with_effects(*there.effects, point.effects[-1])
                price = COLUMN_PRICE * len(point.effects[-1].values)
                starts.append(Start(full, share * cost + price))
        return starts

    made: dict[str, list[Start]] = {}
    for id in sorted(ids):
        effects = [
            e for s in scores if s.candidate.id == id
            for e in _strengths(model, s, chi2)
        ]  # fmt: skip
        for start in tried(effects):
            made.setdefault(start.name, []).append(start)
    _closer(model, fit.cost, made, tried)
    return [min(starts, key=lambda s: s.cost) for starts in made.values()]


def _closer(
    model: AbstractModel, cost: float, made: dict[str, list[Start]], tried: Callable
) -> None:
    """Add to `made` starts on both sides of the best one of every law that has one number alone.

    The grid of such a number (a limit, a time) is coarse, and the law may explain nothing at two
    neighbours that enclose the right value.  Only for names that gain a share of the best gain.
    """
    least = min((s.cost for starts in made.values() for s in starts), default=cost)
    for starts in made.values():
        law = starts[0].point.effects[-1]
        best = min(s.cost for s in starts)
        if not _one_number(model, law) or cost - best <= model.settings.promise_share * (
            cost - least
        ):
            continue
        (key,) = law.values
        for _ in range(HALVINGS):
            order = sorted(starts, key=lambda s: s.point.effects[-1].values[key])
            at = int(np.argmin([s.cost for s in order]))
            sizes = [s.point.effects[-1].values[key] for s in order[max(0, at - 1) : at + 2]]
            between = [float(np.sqrt(x * y)) for x, y in itertools.pairwise(sizes)]
            starts.extend(tried([Effect(law.id, law.place, {key: x}) for x in between]))


def _one_number(model: AbstractModel, effect: Effect) -> bool:
    """Whether an effect has one number alone, which is no strength: a limit, or a time."""
    known = model.laws[effect.id].parameters
    return len(effect.values) == 1 and not any(known[k].linear for k in effect.values)


def beside_waves(
    model: AbstractModel, fit: Fit, scores: Sequence[Score], enough: float
) -> list[Start]:
    """The best start of sensors' laws in `scores`, waves' numbers sought beside each of its values.

    A late or slow reading is out of step with the angles.  The calibration then finds wrong numbers
    of waves that hide this, and no tangent leads from them to the right ones; so these numbers are
    scanned beside each law.  Names with the largest gain come first, and the scan ends once a start
    costs less than `enough`.  Empty where no number is a wave's.
    """
    laws: dict[str, list[Score]] = {}
    for s in sorted(scores, key=lambda s: -s.gain):
        if _reads(model, s) and not model.has(fit.point.effects, s.candidate.id, s.candidate.place):
            laws.setdefault(s.candidate.name, []).append(s)
    kept = np.max(np.abs(fit.point.u), initial=0.0) < model.settings.bent_sigmas
    anchor = fit.point if kept else Point(0 * fit.point.u, fit.point.effects)
    starts: list[Start] = []
    for name, alike in laws.items():
        if model.wavy is False or model.spent or any(s.cost < enough for s in starts):
            break
        model.tell(f"numbers of waves beside {name}")
        points = [
            anchor.with_effects(*anchor.effects, Effect(c.id, c.place, c.decode(np.ones(1))))
            for c in (s.candidate for s in alike)
        ]  # fmt: skip
        for point in scanned_beside(model, points, model.ranking):
            (residual,) = model.residuals([point], model.ranking)
            if np.all(np.abs(residual) < 1e100):
                J, own = tangents_at(model, point, model.ranking), fit.residual[: len(residual)]
                there, cost = predicted(model, point, residual, J)
                starts.append(Start(there, cost * fit.chi2 / float(own @ own)))
    return likelier(starts)


def _reads(model: AbstractModel, score: Score) -> bool:
    """Whether a candidate is a sensor's law of one number that is no strength, and not dead."""
    c = score.candidate
    if score.dead or model.laws[c.id].port != "sensor":
        return False
    return _one_number(model, Effect(c.id, c.place, c.decode(np.ones(1))))


def promising(scan: Scan, ids: set[str], share: float) -> list[Score]:
    """Variants of laws `ids` whose best one gains more than a `share` of the largest gain.

    Also the variants that change nothing about the calibrated machine.  An example is a sensor
    that loses the sign: the calibration has bent to its readings and predicts one sign alone, but
    about the stated machine the law changes everything.
    """
    best: dict[str, float] = {}
    for s in scan.scores:
        best[s.candidate.name] = max(best.get(s.candidate.name, 0.0), s.gain)
    least = share * max(best.values(), default=0.0)
    return [
        s for s in scan.scores
        if s.candidate.id in ids
        and (s.dead or (s.allowed and best[s.candidate.name] > least))
    ]  # fmt: skip


def without_strength(model: AbstractModel) -> set[str]:
    """Laws without a strength, not stepped in time: no multiple of a signature, quickly tried."""
    return {
        k for k, law in model.laws.items()
        if law.port not in STEPPED and not strengths(law)
    }  # fmt: skip


def _strengths(model: AbstractModel, score: Score, chi2: float) -> list[Effect]:
    """The candidate at its tangent's strength and over the ladder, within its law's bounds.

    Once where no strength is free.
    """
    c, law = score.candidate, model.laws[score.candidate.id]
    if not strengths(law):
        return [Effect(c.id, c.place, c.decode(score.coefficients))]
    if score.dead:
        return []
    unit = np.sqrt(chi2 / max(score.gain, 1e-300))  # the tangent's change: as the residual
    factors = [1.0, *(sign * x * unit for x in model.settings.strengths for sign in (1, -1))]
    effects = [Effect(c.id, c.place, c.decode(k * score.coefficients)) for k in factors]
    return [e for e in effects if c.within(e.values)]


def likelier(starts: Sequence[Start]) -> list[Start]:
    """The start of every (id, place) with the lowest estimated cost.

    Both estimates can fail: a tangent at a strong delay, and a finite delay where the calibration
    has to follow further than to first order.
    """
    best: dict[str, Start] = {}
    for start in starts:
        if start.name not in best or start.cost < best[start.name].cost:
            best[start.name] = start
    return list(best.values())


def worth(starts: list[Start], cost: float, share: float) -> list[Start]:
    """Starts that promise at least a `share` of the best one's gain, best first."""
    order = sorted(starts, key=lambda s: s.cost)
    return [s for s in order if cost > s.cost and cost - s.cost > share * (cost - order[0].cost)]
