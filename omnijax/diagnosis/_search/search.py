"""The search: one effect after the other by score, joint refit and held-out gain; then a review.

Where something is left above the noise that no further effect explains, the first effect may have
been the wrong one: the search goes on from the runners-up too and keeps the better set.
"""

import dataclasses
import functools
import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from .._settings import SETTINGS
from .candidates import Candidate
from .doubt import foretold, shown_within_doubt
from .fit import Fit, refit
from .held_out import HeldOut, Trial
from .in_ranges import at_ends, scored_in_ranges
from .model import AbstractModel, Effect, Point, to_project
from .refits import Refits, chi2_of, residual_of, total_cost
from .review import Review, Rival
from .scan import Scan, Score, Signatures, beside_taken, chance, taken_up
from .starts import (
    AS_FORETOLD,
    NAME_GAIN,
    TOGETHER,
    Start,
    at_finite_strength,
    beside_waves,
    by_tangent,
    likelier,
    other_lines,
    promising,
    without_strength,
    worth,
)
from .through_laws import scored_through_laws

RELATIVE = SETTINGS.calibration.relative
WITHOUT_STEPS = SETTINGS.refits.without_steps


@dataclasses.dataclass
class SearchResult:
    """All that the search found out.

    `alone` holds by effect the fit without it and that fit's chi2 on the held-out runs, `shows`
    what these show of the change that the effect makes, `signatures` those of the last scan,
    `left_out` by name why an effect that was accepted is not in the fit, `wider` by name the laws
    that an effect is a limit of and that explain the runs as well, `left_open` by name how many
    lines, or sets of them, do.
    """

    baseline: Fit
    fit: Fit
    held_before: float
    held_after: float
    scans: list[Scan]
    trials: list[list[Trial]]
    rivals: dict[int, list[Rival]]
    refused: list[str]
    significant: bool
    priors: tuple = ()
    alone: dict[int, tuple[Fit, float]] = dataclasses.field(default_factory=dict)
    signatures: Signatures | None = None
    shows: dict[int, HeldOut] = dataclasses.field(default_factory=dict)
    left_out: dict[str, str] = dataclasses.field(default_factory=dict)
    wider: dict[str, list[str]] = dataclasses.field(default_factory=dict)
    left_open: dict[str, int] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class SearchPath:
    """A way through the search: its fit, what was scored and tried, and whether noise is left.

    The large table of `signatures` is the last scan's.
    """

    fit: Fit
    scans: tuple[Scan, ...] = ()
    trials: tuple[list[Trial], ...] = ()
    noise_only: bool = False
    signatures: Signatures | None = None

    def without_table(self) -> "SearchPath":
        """The same less the large table of signatures, which a review makes again."""
        return dataclasses.replace(self, signatures=None)


@dataclasses.dataclass(frozen=True)
class Explored:
    """Where a search led: the baseline, its chi2 on the held-out runs, and the way."""

    baseline: Fit
    held_before: float
    way: SearchPath

    def without_table(self) -> "Explored":
        """The same less the large table of signatures, which a review makes again."""
        return dataclasses.replace(self, way=self.way.without_table())


def significant(scan: Scan, alpha: float) -> list[Score]:
    """The best variant of every (id, place) that stands out, best first.

    A gain is compared with the residual's own `spread` (chi2 a degree of freedom, at least 1), with
    its chance among all candidates, and with what the best decoy gained.
    """
    count, decoy = len(scan.scores), scan.decoy
    return [
        s for s in scan.best_per_name()
        if chance(s.gain / s.spread, s.columns) * s.candidate.trials * count < alpha
        and s.merit > decoy
    ]  # fmt: skip


class Search:
    """The search over one model; `tell(text)` reports progress.

    `who` says in words what the split "held-out" is, which confirms effects.
    """

    def __init__(
        self,
        model: AbstractModel,
        tell: Callable[[str], None] = lambda text: None,
        who: str = "held-out runs",
    ):
        self.model, self.tell, self.who, self.refits = model, tell, who, Refits(model)
        self.settings, model.tell = model.settings, tell
        # by name how many lines, or sets of them, the fitted runs tell as well
        self.left_open: dict[str, int] = {}
        self.begun = 0.0, 0.0  # chi2 of the baseline on train and held-out runs

    def run(self, start: Point | None = None) -> SearchResult:
        """Search from a calibrated `start`, and review what was found."""
        return self.reviewed(self.explore(start))

    def explore(
        self, start: Point | None = None, known: Point | None = None, doubted: bool = False
    ) -> Explored:
        """Search from `start` until nothing is left that held-out runs accept.

        `known` effects of an earlier search are taken in at once and judged like the others.  Where
        they are `doubted`, one that does not stand by itself begins the search from none.
        """
        model = self.model
        stated = Point(np.zeros(len(model.priors)))
        if known is None:
            fit = refit(model, start or stated, relative=RELATIVE)
            baseline = fit
            if not model.based_near(fit):
                self.tell("smoothing the runs about the calibrated machine")
                model.rebase(fit.point)
                baseline = refit(model, fit.point, baseline=fit.jacobian, relative=RELATIVE)
        else:  # another noise moves the ends of its refits by little
            self.tell("smoothing the runs anew")
            model.rebase(start or stated)
            baseline = refit(model, start or stated, relative=RELATIVE)
        held_before = chi2_of(model, baseline.point, "held-out")
        self.begun = baseline.chi2, held_before
        if known is not None and known.effects:
            before = chi2_of(model, known, "train")
            settled = self.refits.settled(known, before)
            if not doubted or self.stands(settled):
                return Explored(baseline, held_before, self.follow(SearchPath(settled)))
            self.tell(f"{self.who} do not confirm that beside the other noise: beginning anew")
            model.rebase(start or stated)
        way = self.best_way(baseline, self.follow(SearchPath(baseline)))
        return Explored(baseline, held_before, way)

    def reviewed(self, explored: Explored) -> SearchResult:
        """All that was found out, once the effects of a way are challenged."""
        model, way, baseline = self.model, explored.way, explored.baseline
        signatures = way.signatures or self.scan(way.fit)[1]
        self.tell("reviewing what was found")
        reviewed = Review(self.refits, self.tell, self.who).run(way.fit, signatures, baseline)
        fit = reviewed.fit
        kept = {e.name for e in fit.point.effects}
        tried = [t for trials in way.trials for t in trials]
        after = residual_of(model, fit.point, "held-out")
        without = {
            i: residual_of(model, less.point, "held-out") for i, less in reviewed.alone.items()
        }
        return SearchResult(
            baseline,
            fit,
            explored.held_before,
            float(after @ after),
            list(way.scans),
            list(way.trials),
            reviewed.rivals,
            [t.effect.name for t in tried if not (t.accepted or t.effect.name in kept)],
            bool(tried),
            tuple(model.priors),
            {i: (less, float(without[i] @ without[i])) for i, less in reviewed.alone.items()},
            signatures,
            {i: HeldOut.of(before, after) for i, before in without.items()},
            {name: why for name, why in reviewed.left_out.items() if name not in kept},
            {name: laws for name, laws in reviewed.wider.items() if laws and name in kept},
            {name: count for name, count in self.left_open.items() if name in kept},
        )

    def follow(self, way: SearchPath) -> SearchPath:
        """Go on greedily until nothing stands out, or nothing that held-out runs accept.

        Also where chi2 is that of noise: a scan sees an effect that chi2 of all rows does not.
        """
        sure = None  # the way up to its first step on trust
        while len(way.fit.point.effects) < self.settings.most_effects:
            if way.signatures is not None and self.model.spent:
                break
            way = way.without_table()  # room for the next one
            way = self.looked(way)
            promising = self.promising(way.fit, way.trials[-1])
            if not promising:
                promising = self.on_trust(way)
                sure = sure or (way.without_table() if promising else None)
            if not promising:
                break
            way = self.with_effect(way, promising[0])
        if sure is None:
            return way
        fit, alone = self.needed(way.fit)
        if self.confirmed(fit, alone, sure):
            return way if fit is way.fit else dataclasses.replace(way, fit=fit)
        self.tell(f"{self.who} do not confirm what was taken in on trust")
        self.model.rebase(sure.fit.point)
        return sure

    def on_trust(self, way: SearchPath) -> list[Trial]:
        """The best trial of the last step, where it closes most of a gap above noise; or none.

        Where several effects are missing, what the others do on held-out runs hides or bends
        what the first one does there.  Whether each is there is asked once all are in.
        """
        held = chi2_of(self.model, way.fit.point, "held-out")
        strong = self.strong(way.fit) or held > self.settings.strong_misfit * self.model.dof(
            "held-out"
        )
        if not strong and self.floor_reached(way.fit, held):
            return []
        gap = way.fit.chi2 - self.model.dof("train")
        return [
            t for t in way.trials[-1][:1]
            if t.gain > self.settings.trusted_closed * gap and np.isfinite(t.held.gain)
            and not self.has(way.fit, t.effect)
        ]  # fmt: skip

    def needed(self, fit: Fit) -> tuple[Fit, list[Fit]]:
        """The fit less what the fitted runs do without, and its refits without each effect.

        A first step on trust may have been a wrong one that led to the right ones.
        """
        while True:
            alone = list(self.without(_less(fit.point)))
            k = min(range(len(alone)), key=lambda i: alone[i].cost)
            needed = alone[k].cost - fit.cost >= self.settings.margin
            if len(alone) == 1 or needed or self.shown(alone[k], fit):
                return fit, alone
            self.tell(f"{fit.point.effects[k].name} is not needed: the fitted runs do without it")
            fit = self.refits.settle(alone[k])

    def shown(self, less: Fit, fit: Fit) -> bool:
        """Whether held-out runs show within doubt what `less` lacks of a fit."""
        return shown_within_doubt(self.model, less, fit) >= self.settings.margin

    def without(self, points: Iterable[Point]) -> Iterator[Fit]:
        """Refits from points that lack effects, each as it is asked for."""
        return (refit(self.model, point, rounds=WITHOUT_STEPS) for point in points)

    def confirmed(self, fit: Fit, alone: Iterable[Fit], sure: SearchPath) -> bool:
        """Whether held-out runs confirm every effect of a fit beside its others.

        `alone` are the refits without each.  And all those together that it has more than the way
        up to its first step on trust, `sure`.
        """
        before = self.without([fit.point.with_effects(*sure.fit.point.effects)])
        return self._confirms(fit, itertools.chain(before, alone))

    def stands(self, fit: Fit) -> bool:
        """Whether every effect of a fit, found under another noise, is confirmed under this one.

        Beside the others: it is needed by the fitted runs, and held-out runs show what it changes.
        """
        return self._confirms(fit, self.without(_less(fit.point)), self.settings.margin)

    def _confirms(self, fit: Fit, others: Iterable[Fit], least: float = -np.inf) -> bool:
        """Whether held-out runs confirm what a fit has more than each of `others`.

        And the fitted runs gain `least` by it.
        """
        after = residual_of(self.model, fit.point, "held-out")
        for less in others:
            gain = less.cost - fit.cost
            held = HeldOut.of(residual_of(self.model, less.point, "held-out"), after)
            if gain >= least and held.confirms(gain, self.settings):
                continue
            shown = shown_within_doubt(self.model, less, fit)
            if shown < self.settings.margin or gain + shown < least:
                return False
        return True

    def looked(self, way: SearchPath) -> SearchPath:
        """The way with one scan more, and with what it led to try."""
        scan, signatures = self.scan(way.fit)
        trials = [
            trial.light for trial in self.trials(way.fit, scan, self.in_a_part(way.fit, signatures))
        ]
        return dataclasses.replace(way, scans=(*way.scans, scan), trials=(*way.trials, trials),
                                   signatures=signatures)  # fmt: skip

    def promising(self, fit: Fit, trials: list[Trial]) -> list[Trial]:
        """Trials that held-out runs accept and that close more than a little, best first."""
        return [t for t in trials if t.accepted and not self.little(fit, t)]

    def little(self, fit: Fit, trial: Trial) -> bool:
        """Whether a trial closes next to nothing of a strong gap: an unknown effect's shadow."""
        dof = self.model.dof("train")
        return self.strong(fit) and trial.gain < self.settings.least_closed * (fit.chi2 - dof)

    def with_effect(self, way: SearchPath, trial: Trial) -> SearchPath:
        """The way with an accepted effect; one that closes most of the gap earns a new budget."""
        name, held = trial.effect.name, trial.held
        gap = way.fit.chi2 - self.model.dof("train")
        if self.strong(way.fit) and trial.gain > self.settings.trusted_closed * gap:
            self.model.work = 0.0
        if trial.accepted:
            share = f"{held.multiplier:.2f} ± {1 / np.sqrt(held.size):.2g}"
            self.tell(f"accepted {name}: {self.who} show {share} of the change")
        else:
            self.tell(f"taken in on trust: {name}, which {self.who} may confirm beside others")
        fit = self.refits.settle(trial.fit)
        left = chi2_of(self.model, fit.point, "held-out")
        return dataclasses.replace(way, fit=fit, noise_only=self.floor_reached(fit, left))

    def best_way(self, baseline: Fit, way: SearchPath) -> SearchPath:
        """The way itself, or a better one from a runner-up of its first step."""
        start = way
        accepted = self.promising(baseline, way.trials[0]) if way.trials else []
        accepted = [
            t for t in accepted if t.fit.cost < self.settings.runner_up_cost * accepted[0].fit.cost
        ]
        for trial in accepted[1 : 1 + self.settings.runners_up]:
            if way.noise_only or self.model.spent:
                break
            left = way.fit.chi2 / self.model.dof("train")
            name = trial.effect.name
            self.tell(f"something is left (chi2 {left:.3f} a row): going on from {name} instead")
            first = SearchPath(baseline, start.scans[:1], start.trials[:1])
            other = self.follow(self.with_effect(first, trial))
            if self.better(other.fit, way.fit):
                way = other
        if len(accepted) > 1 and not start.noise_only:
            self.model.rebase(way.fit.point)
        return way

    def better(self, other: Fit, fit: Fit) -> bool:
        """Whether the end of another way is better than `fit`: by train runs alone.

        But where they tell both as well (of contacts that may part only one does so there) by
        what held-out runs confirm.
        """
        more = total_cost(other) - total_cost(fit)
        if abs(more) < self.settings.equal_margin:
            left, without = (chi2_of(self.model, x.point, "held-out") for x in (other, fit))
            if abs(left - without) > self.settings.equal_margin:
                return left < without
        return more < -self.settings.runner_up_lead * total_cost(fit)

    def scan(self, fit: Fit) -> tuple[Scan, Signatures]:
        """Scores of all candidates at a fit, and their signatures."""
        model = self.model
        J, u = to_project(model, fit.jacobian, fit.point.u)
        taken = taken_up(J, len(u))
        self.tell("choosing candidates")
        candidates = model.candidates_beside(fit.point, taken[: len(fit.residual)])
        self.tell(f"{len(candidates)} candidates")
        signatures = Signatures(candidates, model.columns(fit.point, candidates))
        self.tell("scoring them")
        left = beside_taken(fit.residual, taken, u)
        scrambled = [model.shuffled(left, seed) for seed in range(self.settings.shuffles)]
        spread = float(left @ left) / model.dof("train")
        again = functools.partial(scored_in_ranges, model, fit, signatures)
        ends = again if at_ends(model, fit) else None

        def scored() -> Scan:
            return signatures.scan(fit.residual, taken, u, scrambled, spread, again=ends)

        def standing_out(scan: Scan) -> list[str]:
            return [s.candidate.name for s in significant(scan, self.settings.alpha)]

        scan = scored_through_laws(model, fit.point, signatures, scored, standing_out)
        return scan, signatures

    def strong(self, fit: Fit) -> bool:
        """Whether so much is left that tangents do not rank what explains it."""
        return fit.chi2 > self.settings.strong_misfit * self.model.dof("train")

    def in_a_part(self, fit: Fit, signatures: Signatures) -> list[Score]:
        """Candidates that explain nearly all that a part of the channels shows of a strong gap.

        Scored by it alone: where an effect bends what the others show, its tangent explains none.
        """
        if not self.strong(fit):
            return []
        J, u = to_project(self.model, fit.jacobian, fit.point.u)
        out = []
        for rows in self.model.parts():
            here = fit.residual * rows
            gap = float(here @ here) - np.count_nonzero(here)
            if gap > (self.settings.strong_misfit - 1) * np.count_nonzero(here):
                scan = signatures.scan_within(rows, fit.residual, J, u)
                out += [s for s in scan.best_per_name() if s.gain > self.settings.part_closed * gap]
        return out

    def trials(self, fit: Fit, scan: Scan, further: Sequence[Score] = ()) -> list[Trial]:
        """Joint refits of the best significant candidates and of `further` ones, best first."""
        train, held = self.model.dof("train"), self.model.dof("held-out")
        scores = [s for s in (*significant(scan, self.settings.alpha), *further)
                  if not self.has(fit, s.candidate)]  # fmt: skip
        starts = [Start(p, 0.0) for p in self.model.foretold(fit.point)]
        names = {start.name for start in starts}
        others = self.starts(fit, scan, scores, self.strong(fit))
        starts += [start for start in others if start.name not in names]
        before = residual_of(self.model, fit.point, "held-out")
        lines = other_lines(self.model, fit, scan, scores)
        trials, openings = [], {} if self.strong(fit) else None
        for start in starts[: self.settings.refitted]:
            if trials and self.model.spent:
                break
            least = min((t.fit.cost for t in trials), default=np.inf)
            every = (start, *lines.get(start.name, ()))
            alike: list[Trial] = []
            for k, begin in enumerate(every):
                if alike and fit.cost - alike[0].fit.cost < NAME_GAIN * (fit.cost - least):
                    break  # the first, of as large a tangent as its others, is no rival of the best
                self.tell(f"refitting with {start.name}" + (f", line {k + 1}" if k else ""))
                alike.append(self.refits.try_out(fit, begin, before, least, openings))
            alike += self.lines_anew(fit, alike, before, least)
            trial = self.of_equals(alike)
            self.tell(
                f"{trial.effect.name}: gain {trial.gain:.0f}; {self.who} gain "
                f"{trial.held.gain:.0f}, share {trial.held.multiplier:.2f}"
            )
            trials.append(trial)
            if all(self.little(fit, t) for t in trials) and len(trials) > 1:
                break  # those after them promise less
            left = float(before @ before) - trial.held.gain
            near = trial.fit.chi2 < self.settings.near_noise * train
            if trial.accepted and near and left < self.settings.near_noise * held:
                return self.ranked(fit, trials)  # rivals: in the review
        if not all(self.little(fit, t) for t in trials):
            trials = self.refits.with_widths(fit, trials, before)
        return self.ranked(fit, trials)

    def lines_anew(
        self, fit: Fit, alike: list[Trial], before: np.ndarray, least: float
    ) -> list[Trial]:
        """Trials of a law's lines at a place chosen together, where `alike` may hold wrong ones.

        So they may where there is more than one, and where held-out runs do not show what the best
        foretells.  Two at once, where no single one does and they explain most of the gap.  Until
        one leaves noise there that explains the fitted runs as well as any.
        """
        best = min(alike, key=lambda t: t.fit.cost)
        new, out = best.effect, []
        several = any(e.name == new.name for e in fit.point.effects)
        behind = fit.cost - best.fit.cost < NAME_GAIN * (fit.cost - least)
        if behind or (self.as_foretold(best) and not several):
            return []
        most = best.gain > self.settings.trusted_closed * (fit.chi2 - self.model.dof("train"))
        self.tell(f"choosing the lines of {new.name} together")
        for more in (1, 2) if most and not several else (1,):
            for k, point in enumerate(self.model.with_lines(fit, new.id, new.place, more)):
                if self.model.spent or k == TOGETHER:
                    break
                self.tell(f"refitting with {more} more of the lines of {new.name}, set {k + 1}")
                trial = self.refits.try_out(fit, Start(point, 0.0), before, least)
                out.append(self.granted(trial, before))
                if self.foretells(out[-1], before) and out[-1] in self.equals([*alike, *out]):
                    return out
        return out

    def foretells(self, trial: Trial, before: np.ndarray) -> bool:
        """Whether a trial leaves noise of the held-out runs, of which `before` is left without."""
        n = self.model.dof("held-out")
        left = float(before @ before) - trial.held.gain
        return trial.accepted and left < n + self.settings.noise_sigmas * np.sqrt(2 * n)

    def granted(self, trial: Trial, before: np.ndarray) -> Trial:
        """The trial as held-out runs see it within what its fit leaves open, where it foretells
        them so; what that is worth has to exceed what it costs."""
        if self.foretells(trial, before):
            return trial
        told = foretold(self.model, trial.fit)
        if told is None or not told.granted:
            return trial
        if float(before @ before) - told.cost < self.settings.margin:
            return trial
        held = HeldOut.of(before, residual_of(self.model, told.point, "held-out"))
        return dataclasses.replace(trial, held=held)

    def as_foretold(self, trial: Trial) -> bool:
        """Whether held-out runs show the change that a trial foretells, at its size."""
        off = abs(trial.held.multiplier - 1)
        return trial.accepted and off < AS_FORETOLD * trial.held.error(trial.gain)

    def equals(self, alike: list[Trial]) -> list[Trial]:
        """Those of some trials that the fitted runs tell as well as the best one."""
        least = min(t.fit.cost for t in alike)
        return [t for t in alike if t.fit.cost - least < self.settings.equal_margin]

    def of_equals(self, alike: list[Trial]) -> Trial:
        """The trial of a law's lines that the fitted runs tell best.

        Where several are told as well, the one of them that held-out runs show most of.
        """
        equals = self.equals(alike)
        trial = max(equals, key=lambda t: np.nan_to_num(t.held.gain, nan=-np.inf))
        if len(equals) > 1:
            self.left_open[trial.effect.name] = len(equals)
        return trial

    def has(self, fit: Fit, new: Candidate | Effect) -> bool:
        """Whether a fit holds what is new already."""
        return self.model.has(fit.point.effects, new.id, new.place)

    def ranked(self, fit: Fit, trials: list[Trial]) -> list[Trial]:
        """Trials by what they gain, less where the model prefers plainer laws; best first."""
        before = total_cost(fit)

        def left(trial: Trial) -> float:
            gain = before - total_cost(trial.fit)
            return before - gain * (self.model.plainness(trial.effect) if gain > 0 else 1.0)

        return sorted(trials, key=left)

    def starts(self, fit: Fit, scan: Scan, scores: list[Score], strong: bool) -> list[Start]:
        """Where the joint refits of a step begin, the most promising first."""
        first = likelier(by_tangent(fit, scores))
        if strong:  # a strong delay's tangents do not tell its rank, and it is tried for little
            late = without_strength(self.model)
            some = promising(scan, late, self.settings.promise_share / 2)
            real = at_finite_strength(self.model, fit, some, late)
            new = [s for s in real if not self.has(fit, s.point.effects[-1])]
            first = likelier([*first, *new])
            enough = self.settings.strong_misfit * self.model.dof("train")
            if all(s.cost > enough for s in first):
                first = likelier([*first, *beside_waves(self.model, fit, some, enough)])
        starts = worth(first, fit.cost, self.settings.promise_share)
        ids = {k for k in self.model.laws if self.model.bends(k)}
        plain = starts and not any(self.stepped(s) for s in starts[: self.settings.refitted])
        plain = plain and self.settings.strong_misfit > 0  # else no tangent ranks what is stepped
        if not strong or plain or not ids:
            return starts
        self.tell("laws that bend with their strength, at finite ones")
        names = [s.name for s in starts if self.stepped(s)][: self.settings.refitted]
        leading = [s for s in scores if s.candidate.name in names]
        finite = at_finite_strength(self.model, fit, scan.scores, ids, leading)
        others = [s for s in first if not self.stepped(s)]
        new = [s for s in finite if not self.has(fit, s.point.effects[-1])]
        return worth([*new, *others], fit.cost, self.settings.promise_share)

    def stepped(self, start: Start) -> bool:
        """Whether a start's new law is stepped in time, and so no multiple of its tangent."""
        return self.model.bends(start.point.effects[-1].id)

    def floor_reached(self, fit: Fit, held: float) -> bool:
        """Whether what is left is noise, on all runs.

        So it is where chi2 is within a few standard deviations of its mean; or next to nothing of
        what there was to explain: then the noise is not quite as assumed.
        """
        sizes = self.model.dof("train"), self.model.dof("held-out")
        return all(
            left - n
            < max(
                self.settings.noise_sigmas * np.sqrt(2 * n), self.settings.noise_share * (begun - n)
            )
            for left, begun, n in zip((fit.chi2, held), self.begun, sizes, strict=True)
        )


def _less(point: Point) -> list[Point]:
    """A point without each of its effects."""
    return [point.without(i) for i in range(len(point.effects))]
