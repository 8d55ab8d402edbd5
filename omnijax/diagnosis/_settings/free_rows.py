"""Machines that are run freely: the rows that are compared, their noise, and what is tried."""

import dataclasses

from .machine import RigOrdersSettings


@dataclasses.dataclass(frozen=True)
class FreeCandidatesSettings:
    """Numbers of laws that are no strengths, in a machine's own sizes."""

    # of its speed (widths, speeds of friction) and twist (plays): chosen (half a decade apart)
    scale_shares: tuple[float, ...] = (0.02, 0.07, 0.2, 0.6)
    # of the time that the command is below a limit of the drive: chosen (from a few peaks to half
    # of the time)
    below_limit: tuple[float, ...] = (0.97, 0.9, 0.75, 0.5)
    # s, delays and lags of drives beside those of few samples: chosen (at fast rates the
    # others are too short)
    slow_times: tuple[float, ...] = (4e-3, 0.016, 0.064)
    # of the time, for a limit that shows: chosen (a few peaks may be their dynamics)
    limit_seen: float = 0.98
    lags: tuple[float, ...] = (0.5, 2.0, 8.0)  # samples: chosen (from part of a sample to several)
    delays: tuple[float, ...] = (0.25, 1.0, 4.0)  # samples: chosen (the same)
    # of a constant without range: chosen (two decades)
    any_values: tuple[float, ...] = (0.1, 1.0, 10.0)
    # of a tried time, and its part, between which a tangent may move it: chosen (more trusts a
    # tangent less)
    moved_time: float = 0.05


@dataclasses.dataclass(frozen=True)
class FreeColourSettings:
    """What a sensor's white noise makes of a balance: rows of a blue colour, weighed by it."""

    least_covariance: float = 1e-9  # of that at lag 0, below which rows share no noise: rounding
    rounds: int = 3  # of a refit weighed by a colour and the colour of what it leaves: time
    # lengths of the thinning filter on either side, that an impulse is followed: chosen (its answer
    # has ended)
    span: int = 3
    relative: float = 1e-4  # of the cost, below whose fall a refit ends: time
    # on either side, that an impulse is followed at least: chosen (a low pass dies away)
    fewest_rows: int = 200
    # of rows' variance that is no sensor noise: chosen (from next to none to nearly all of it)
    decades: tuple[float, float] = (-7.0, 2.0)
    # of them tried: derived (two a decade)
    powers: int = 2 * int(decades[1] - decades[0]) + 1


@dataclasses.dataclass(frozen=True)
class FreeOrdersSettings:
    """Orders that stand out in what is left: a fine scan over the measured position."""

    fine: int = RigOrdersSettings.grid  # tried within one resolution of the travel: derived (there)
    finer: int = 8  # times as many beside a peak: time
    # of a line over the travel: own cases (what does not repeat is none, what does twice is one)
    periods: int = 2
    peaks: int = 8  # that are candidates: time
    # of them, whatever line they belong to: own cases (which neighbour is right shows in a refit)
    highest: int = 3
    most_peaks: int = 256  # among which further lines are looked for beside the strongest: time
    most_orders: int = RigOrdersSettings.most_orders  # derived (as of a wheel)
    # of the rows, that a line must pass slowly enough to be seen in them: own cases (coggings of a
    # fast motor; it was a quarter)
    slow_rows: float = 0.05
    least_line: float = 1e-6  # of the strongest, a shorter one beside it is none: rounding


@dataclasses.dataclass(frozen=True)
class FreeRowsSettings:
    """Measured less predicted, one run: over a free run, or in the balance of accelerations."""

    least_start: float = 1e-6  # of the best seen part of a start, that must be seen: rounding
    # of the thinning filter to each side, in thinned samples: chosen (more cost ends)
    filter_taps: int = 10
    filter_order: int = 4  # of the low pass of measured signals, each way: convention
    highest_cutoff: float = 0.99  # of half the sampling rate: rounding (a filter has to be below 1)
    # of half the rows' rate, the cutoff of the thinning filter and the fastest line: convention
    passed_band: float = 0.8
    # over which a low pass dies away, at least: chosen (more costs time, less cuts it off)
    impulse_samples: int = 2001
    impulse_edges: int = 8  # edges of the thinning filter, the same: chosen (the same)


@dataclasses.dataclass(frozen=True)
class FreeSensorNoiseSettings:
    """The noise of what the logs of a machine measured, each by itself."""

    # of what is measured, as noise where there is none: chosen (small beside all that is asked)
    noise_free: float = 1e-6
    # relative 1-sigma of the noise's level: chosen (more trusts declarations, less the log)
    level_error: float = 0.05
    # the highest of the differences' levels over the least, above which there is motion in them:
    # measured (1.02 in white noise of a few thousand samples)
    white_ratio: float = 1.1


@dataclasses.dataclass(frozen=True)
class FreeTogetherSettings:
    """Several lines of one place at once, as the balance of accelerations has them."""

    relaxed_turns: int = 3  # that each line is looked for anew beside the others, at most: time
    # of the squares that are left at most, where it is seen elsewhere: chosen (less is chance)
    moved_cost: float = 0.99
    rounds: int = 8  # steps of a refit with or without a line: time


@dataclasses.dataclass(frozen=True)
class FreeUndecidedSettings:
    """What the fitted runs tell only together."""

    # 1-sigma over the noise, from which a direction counts: chosen (below it no run shows it)
    least_sigma: float = 0.1
