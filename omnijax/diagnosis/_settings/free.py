"""Machines that are run freely, axes and a user's own: their model, starts, evidence, next run."""

import dataclasses

from .fits import RefitsSettings
from .search import SearchSettings


@dataclasses.dataclass(frozen=True)
class FreeBeforeSettings:
    """What was before a window."""

    # s of the past that sensors see: chosen (several times the longest lag that is tried)
    seconds: float = 0.3


@dataclasses.dataclass(frozen=True)
class FreeBuildSettings:
    """From a machine's case to its model: criterion, noise, laws and places."""

    # Hz a sample a second, tried from the widest: chosen (wide ones keep the motion, narrow ones
    # keep noise out)
    cutoffs: tuple[float, ...] = (0.1, 0.07, 0.05, 0.035, 0.025, 0.015)
    most_rows: int = 6000  # of a run's free run that are compared: time (more say nothing new)
    # a window is at least so many times its lead: chosen (fewer leave little of a window to
    # compare)
    window_leads: int = 4
    # of the time that an axis is pushed away from rest, above which free runs say nothing: own
    # cases (pendulums over the top)
    pushed_away: float = 0.05
    least_window: int = 64  # samples: chosen (its start takes up most of a shorter one)
    windows: int = 16  # of the longest run, at most: time
    whole_leads: int = 4  # leads and windows in a run that is one window: time
    # turns that an axis makes, from which its encoder's wave is no slope and no bend of a sensor:
    # own cases (a ball screw that moves by 0.25 had an eccentricity of 0.99 rad named)
    turned_share: float = 0.5


@dataclasses.dataclass(frozen=True)
class FreeEvidenceSettings:
    """A machine of a few states as evidence: groups, places, free runs, the learned term."""

    # times the noise: a run that moves less has no share of its motion to speak of: chosen (less is
    # a share of noise)
    rest_ratio: float = 5.0
    # of the gap by a named set: chosen (real machines are never as good as their sensors)
    closing: float = 0.3
    # of a size on held-out runs: own cases (friction of one log is not that of the next one, as
    # grease warms)
    size_tolerance: float = 0.5


@dataclasses.dataclass(frozen=True)
class FreeExperimentSettings:
    """The next run of a machine: the input among a few under which rivals differ most."""

    seconds: float = 10.0  # of the run: chosen (two periods of the slow sine)
    sine_rate: float = 0.2  # Hz, of a sine: chosen (slow beside the chirp)
    # Hz, between which a sine gets faster: chosen (one run holds slow and fast motion)
    chirp: tuple[float, float] = (0.1, 2.0)


@dataclasses.dataclass(frozen=True)
class FreeFloorSettings:
    """What no law of the library explains: the noise against which an effect must stand."""

    laws: int = 2  # one after the other: chosen (further ones are the search's work)
    refitted: int = 2  # a step: time
    left_cost: float = 0.95  # of the misfit at most, for a further law: chosen (less is chance)
    # chi2 a row from which a law is looked for: derived (below it the search tries nothing else)
    noise_misfit: float = SearchSettings.near_noise
    turns: int = 6  # of starts and refits, one after the other, at most: time
    turn_cost: float = 0.7  # of the misfit that is left at most, for a further turn: time
    least_direction: float = 1e-3  # of the longest of all tangents: chosen (shorter ones are alike)
    relative: float = RefitsSettings.relative  # of the cost, below whose fall a refit ends: time
    least_correlation: float = 0.05  # below which rows are independent: chosen (less is chance)
    # of the longest run, up to which it is looked at: chosen (few products tell a longer one)
    longest_lag: float = 0.25


@dataclasses.dataclass(frozen=True)
class FreeKnownSettings:
    """What a balance knows of states that nobody measures: behind a sensor or a drive, in it."""

    # a sample of a second inertia: derived (stable up to its mode at 1.7 times the rate)
    steps: int = 4
    # of finding what a sensor was shown: derived (errors of 1 % are left at 1e-6 then)
    rounds: int = 3


@dataclasses.dataclass(frozen=True)
class FreeLearnedSettings:
    """The learned term of such a machine: straight pieces over each input."""

    knots: int = 7  # of each input's basis: chosen (more follow noise)
    ridge: float = 1e-3  # on its coefficients: chosen (less follows noise)


@dataclasses.dataclass(frozen=True)
class FreeModelSettings:
    """A machine of a few states with its runs as a model of the diagnosis."""

    # between two samples, above which a law is too steep to be followed: time
    most_steps: int = 48
    gain_bound: float = 0.5  # either way: chosen (one that is off by more is no torque constant)
    ranking_runs: int = 4  # train runs, far apart, that rank laws at finite strength: time
    # of its gain, that each number of a law must be worth: chosen (a plainer law is named for it)
    number_price: float = 0.01
    start_steps: int = 6  # of Gauss and Newton of the windows' starts at a point: time
    start_parts: tuple[float, ...] = (1.0, 0.3)  # of such a step, that are tried: time
    start_gain: float = 0.01  # of the squares, that a further one must gain: time
    # of one law with an order at one place: chosen (coggings of one motor: slots, twice the
    # slots, once a turn)
    lines: int = 3
    # of itself, that a refit may move an order, or half of what the travel tells: chosen (more
    # reaches the next line)
    order_range: float = 0.03
    budget: float = 4000.0  # evaluations of a search, anew as those of a rig's: time
    # of the search, in place of those of `SearchSettings`
    runner_up_lead: float = 0.1  # chosen (less changes ways by chance)
    size_factor: float = 2.0  # chosen (machines differ more from log to log)
    size_noise: float = 0.0  # chosen (none, as the factor is wider)
    instants: int = 24  # at which a point's slopes are taken: time
    sloped_runs: int = 8  # runs of which they are taken: time
    # of the runs' speed, the least of a friction law: chosen (a slower one is a step)
    slowest_friction: float = 0.005
    fastest_friction: float = 2.0  # the same, the largest: chosen (there it is a damping)
    # times a limit, and its part, within which it is fitted: chosen (more leaves the readings)
    limit_range: float = 2.0
    time_range: float = 30.0  # times a delay or lag, the same: chosen (a decade and a half)


@dataclasses.dataclass(frozen=True)
class FreeReopenedSettings:
    """Windows whose free start is caught, begun anew from what was measured."""

    # times the median window's mean square, that a caught one misses: own cases (stick and slip)
    caught_ratio: float = 10.0
    # of a window, one after the other: own cases (the same; octaves)
    openings: tuple[float, ...] = (0.125, 0.25, 0.5, 1.0)
