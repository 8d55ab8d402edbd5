"""The four answers: none, named, ambiguous, unknown."""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from .._search import Rival, SearchResult, Trial, Unsteady
from .._settings import SETTINGS
from .evidence import AbstractEvidence, Misshapen
from .judges import JUDGES
from .shown import Shown
from .stretches import Stretch

EXCESS = SETTINGS.verdict.excess
SIZE_SIGMAS = SETTINGS.verdict.size_sigmas

Columns = list[dict[str, np.ndarray]]  # by held-out run and channel, in assumed sigma


@dataclasses.dataclass(frozen=True)
class Verdict:
    """The verdict, how much of the held-out gap is closed, and each effect's equals."""

    verdict: str
    closed: float
    equals: dict[int, list[Rival]]
    reason: str
    floor: float = 0.0  # chi2 of the held-out runs' noise
    open: tuple[str, ...] = ()  # channels whose gap on held-out runs is why it is unknown


def squares(runs: Columns) -> dict[str, tuple[float, int]]:
    """By channel the sum of squares and the number of what was measured."""
    out: dict[str, tuple[float, int]] = {}
    for run in runs:
        for channel, x in run.items():
            total, count = out.get(channel, (0.0, 0))
            out[channel] = total + float(np.nansum(x**2)), count + int(np.isfinite(x).sum())
    return {c: t for c, t in out.items() if t[1] > 0}


def judge(
    outcome: SearchResult,
    shown: Shown,
    before: Columns,
    after: Columns,
    rivals: float = SETTINGS.search.equal_margin,
    closing: float = AbstractEvidence.closing,
    alike: float = AbstractEvidence.alike,
    confirmed_on: str = "held-out",
    unsteady: Sequence[Unsteady] = (),
    far: Sequence[Stretch] = (),
    fitted: float = 1.0,
    bent: Sequence[Misshapen] = (),
) -> Verdict:
    """The verdict, from held-out residuals before and after and the noise that the data show.

    `confirmed_on` says what they are residuals of, where no run was held out.

    Only a gap that depends on the machine's state makes an answer `unknown`; whether it does is
    tested at `where`'s false-discovery rate.
    `rivals` is the margin below which two effects explain the runs equally well, `closing` the
    share of the held-out gap that a named set has to close, in whole and in each channel (a small
    rest that strong effects of other channels leave is allowed), `alike` the relative difference
    of size at which held-out runs may show an effect (the text says it where it exceeds a rig's
    prediction error); `unsteady` effects change over the runs or between them.
    `far` are stretches of the held-out runs that no noise of their channel explains.  Where that
    channel's residual depends on the machine's state, such a stretch, however short, rules out
    `none`, and a set is named only if it closes the share `closing` of the stretch too.  `fitted`
    is the share of the fitted runs' gap that the set closes; it has to reach `closing` as well.
    The residual beside `bent` effects holds another function of the effect's own input.
    """
    first, last = squares(before), squares(after)
    floor = _floor(shown, "held-out", last)
    above, left = _beside_noise(first, floor), _beside_noise(last, floor)
    noise = sum(floor[c] * n for c, (_, n) in last.items())
    closed = _closed(above, left, shown.structured)
    open_ = [c for c in shown.structured if _excess(last, floor, c) > EXCESS]
    who = JUDGES[confirmed_on].name
    effects = outcome.fit.point.effects
    off = next((s for s in far if shown.structure.get(s.channel, 0.0) > 0
                and not (effects and s.closed >= closing)), None)  # fmt: skip
    if not effects:
        return _without_effects(outcome, open_, sum(s for s, _ in first.values()), who, off)
    equals = {
        i: [rival for rival in near if rival.margin < rivals] for i, near in outcome.rivals.items()
    }
    other = of_another_size(outcome, alike)
    gap = open_ if closed < closing else _left_open(open_, above, left, 1 - closing)
    if gap and closed < closing:
        against = f"the best known effects close {100 * closed:.0f} % of the gap on {who}"
    elif fitted < closing and not gap:
        against = f"the best known effects close {100 * fitted:.0f} % of the gap of the fitted runs"
    else:
        against = _against_naming(gap, off, other, unsteady, who)
    if bent:
        against = _beside_bent(against, bent[0], who)
    if against:
        return Verdict("unknown", closed, equals, against, noise, tuple(gap))
    if any(equals.values()):
        text = "joint refits of rivals are equally good"
        return Verdict("ambiguous", closed, equals, text, noise)
    sized = of_another_size(outcome, AbstractEvidence.alike)
    text = f"{who} confirm the joint refit" + (f"; {who} show {sized}" if sized else "")
    if confirmed_on == "nothing":
        text = "the joint refit explains the runs, and none is left to confirm it"
    return Verdict("named", closed, equals, text, noise)


def closed_in_fitted_runs(shown: Shown, before: Columns, after: Columns) -> float:
    """Share of the fitted runs' gap that is not left there and hangs on the machine's state."""
    first, last = squares(before), squares(after)
    floor = _floor(shown, "train", last)
    above, left = _beside_noise(first, floor), _beside_noise(last, floor)
    return _closed(above, left, shown.structured_in_fitted_runs)


def _floor(shown: Shown, split: str, squares: dict[str, tuple[float, int]]) -> dict[str, float]:
    """By channel the noise's share of chi2 a sample in the runs of a split."""
    return {c: shown.ratio(c, split) ** 2 for c in squares}


def _closed(above: dict[str, float], left: dict[str, float], channels: Sequence[str]) -> float:
    """Share of a gap (chi2 beside the noise, by channel) that is not left in `channels`."""
    whole = sum(above.values())
    return 1 - sum(left.get(c, 0.0) for c in channels) / whole if whole > 0 else 1.0


def _against_naming(
    gap: Sequence[str], off: Stretch | None, other: str, unsteady: Sequence[Unsteady], who: str
) -> str:
    """Why effects that close enough of the whole gap are not named all the same; else empty."""
    if gap:
        return f"the best known effects leave a gap in {', '.join(gap)} on {who}"
    if off is not None:
        return (f"beside the best known effects {who} leave {off}, which no noise explains: "
                "a missing effect that cannot be named")  # fmt: skip
    if other:
        return f"{who} show {other}: a missing effect that no known law describes"
    if unsteady:
        most = unsteady[0]
        return (f"{100 * most.share:.0f} % of {most.name} change over the runs or between them: "
                "a missing effect that no known law describes")  # fmt: skip
    return ""


def _beside_bent(against: str, bent: Misshapen, who: str) -> str:
    """`against` naming, and what is left of an effect's own input; that alone where it is empty."""
    share = f"{100 * bent.share:.0f} % of what it explains"
    left = f"beside {bent.name} {who} show a function of {bent.label}, {share}"
    return (
        f"{against}; {left}" if against else f"{left}: a missing effect that no known law describes"
    )


def _beside_noise(
    squares: dict[str, tuple[float, int]], floor: dict[str, float]
) -> dict[str, float]:
    """By channel the part of chi2 that is no noise."""
    return {c: max(0.0, s - floor[c] * n) for c, (s, n) in squares.items()}


def _left_open(
    open_: Sequence[str], above: dict[str, float], left: dict[str, float], share: float
) -> list[str]:
    """Channels of `open_` in which more than a `share` of their own gap is left.

    A prediction is off by a share of what moves it: in a channel where a strong effect hardly shows
    it may leave as large a share of its RMS in all channels.
    """
    least = share**2 * sum(above.values())
    return [c for c in open_ if left[c] > max(share * above.get(c, 0.0), least)]


def of_another_size(outcome: SearchResult, alike: float) -> str:
    """Of the named effect that held-out runs contradict most, what they show; or nothing.

    Beside the right law what is left there is noise, and the change d that the effect makes is
    there 1 time, with the variances of noise on both splits over d.d.  A law that stands for
    another one has the size that the fitted runs gave it, and elsewhere another.
    """
    worst, said = SIZE_SIGMAS, ""
    for i, (less, _) in outcome.alone.items():
        held, gain = outcome.shows[i], less.cost - outcome.fit.cost
        if not (gain > 0 and np.isfinite(held.gain) and held.size > 0):
            continue
        off = held.multiplier - 1
        sigmas = abs(off) / held.error(gain)
        if abs(off) > alike and sigmas > worst:
            name = outcome.fit.point.effects[i].name
            worst, said = sigmas, f"{held.multiplier:.2f} times what {name} foretells"
    return said


def _excess(squares: dict[str, tuple[float, int]], floor: dict[str, float], channel: str) -> float:
    """What a channel holds beside its noise, RMS in sigma of that noise."""
    if channel not in squares:
        return 0.0
    total, count = squares[channel]
    return math.sqrt(max(0.0, total / count / max(floor[channel], 1e-300) - 1))


def _without_effects(
    outcome: SearchResult, open_: list[str], total: float, who: str, off: Stretch | None
) -> Verdict:
    """The verdict where nothing is named; `total` is chi2 of those `who` confirm.

    `off` is a stretch there that is no noise.

    If held-out runs surely show the change of some law at another size, the answer is `unknown`.
    """
    if open_:
        text = f"a gap in {', '.join(open_)} that no known effect closes on {who}"
        return Verdict("unknown", 0.0, {}, text, open=tuple(open_))
    tried = [t for trials in outcome.trials for t in trials]
    like = max((t for t in tried if _shows(t, total)), key=lambda t: t.held.there, default=None)
    if like is not None:
        share, name = like.held.multiplier, like.effect.name
        text = (f"{who} surely show what {name} foretells, but {share:.2f} times its size: "
                "a missing effect that no known law describes")  # fmt: skip
        return Verdict("unknown", 0.0, {}, text)
    if off is not None:
        text = f"{who} leave {off}, which no noise explains: a missing effect that cannot be named"
        return Verdict("unknown", 0.0, {}, text)
    if outcome.left_out:
        small = ", ".join(f"{name} ({why})" for name, why in outcome.left_out.items())
        text = f"what is left hangs on no state of the machine; left out again: {small}"
        return Verdict("none", 1.0, {}, text)
    if outcome.significant:
        text = f"what is left hangs on no state of the machine, and {who} confirm no effect"
        return Verdict("none", 1.0, {}, text)
    return Verdict("none", 1.0, {}, "what is left is within the noise that the data show")


def _shows(trial: Trial, total: float) -> bool:
    """Whether held-out runs show the change of a refused trial: surely, and enough to matter.

    It matters where it moves their RMS by one per cent, at the size that it has there, as an effect
    that is named does.
    """
    known, least = trial.settings, (1 - (1 + trial.settings.material_change) ** -2) * total
    sure = trial.held.sure > known.sure_sigmas and trial.gain > known.margin
    return not trial.accepted and sure and trial.held.there > least
