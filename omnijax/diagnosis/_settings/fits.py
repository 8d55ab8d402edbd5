"""Joint refits: the steps, when they end, and the calibration before any effect is known."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class RefitsSettings:
    """Joint refits of a search: of a new effect, of a settled set, of friction widths."""

    effect_steps: int = 8  # with a new effect: time
    without_steps: int = 2  # with one effect less: time
    # of the cost, below whose fall they end where it is far from the noise: time
    relative: float = 1e-3
    opening_relative: float = 1e-2  # the same of a run's opening: time
    # of a strength, where a refit may begin: chosen (a tangent may overshoot a strong law)
    weaker_strengths: tuple[float, ...] = (1.0, 0.5, 0.2, 0.05)
    width_steps: int = 4  # with friction widths set free: time
    rival_steps: int = 4  # with a rival in an effect's place: time
    settled_ratio: float = 0.98  # of the last chi2, above which smoothing anew gains nothing: time
    # times the best cost, above which friction widths stay stated
    stepped_widths: float = 10.0  # with a law that is stepped in time: time
    plain_widths: float = 100.0  # without: time


@dataclasses.dataclass(frozen=True)
class CalibrationSettings:
    """The calibration of the uncertain parameters before any effect is known."""

    # times the cost of mere noise, above which it may be caught, and the fall that ends other
    # starts: chosen (a decade)
    caught_cost: float = 10.0
    # the same, above which numbers of waves are scanned: derived (noise twice that declared)
    scanned_cost: float = 4.0
    relative: float = 0.01  # of the cost, below whose fall a refit without effects ends: time
    # of a bound, from which a parameter is at it: chosen (a refit may end a little before it)
    bound_share: float = 0.999


@dataclasses.dataclass(frozen=True)
class DoubtSettings:
    """What held-out runs may show of numbers that the fitted runs left open."""

    # of as much along their tangents, below which they do not leave it open: chosen (more hides
    # gaps, less makes healthy machines unknown)
    chance: float = 1e-3
    rounds: int = 4  # of tangents anew about where the last ones led: time
    settled_sigmas: float = 0.1  # of their sigmas, a step that is not worth another round: time


@dataclasses.dataclass(frozen=True)
class FitSettings:
    """Joint refits: baseline parameters and effects together, Gauss-Newton with bounds."""

    # fall of chi2 after which the baseline's tangents are taken anew: time (stale ones slow a refit
    # down and move no end, where they are taken anew in any case)
    renewing_fall: float = 200.0
    most_steps: int = 20  # of a refit: time (they have ended before)
    patience: int = 3  # rounds after which a refit without hope ends: time
    steps_between: int = 10  # of a refit between two preparations of the data: time
    noise_floor: float = 1.2  # chi2 a degree of freedom, below which only noise is left: time
    # times that, above which a relative fall of the cost ends a refit: time
    far_ratio: float = 10.0
    # of an effect's number, or of a unit for waves, of a difference: rounding
    number_step: float = 1e-4
    least_number: float = 1e-6  # its size where it is 0: chosen (small beside what is named)
    prior_step: float = 1e-3  # prior sigmas, of a difference by an uncertain parameter: rounding


@dataclasses.dataclass(frozen=True)
class GaussNewtonSettings:
    """Damped steps (Levenberg, Marquardt) with a parabola along bent valleys."""

    # fall of chi2 that is not worth another round: chosen (numbers move by a seventh of a sigma)
    ended_fall: float = 0.02
    # share of its foretold fall that a straight step has to bring: chosen (more looks for a bend
    # everywhere, less follows bent valleys in many short steps)
    kept_fall: float = 0.8
    bent_fall: float = 1.0  # foretold fall that is worth a look at the bend: chosen (one sigma)
    # |a| over |d| above which a parabola says nothing: chosen (Transtrum and Sethna, 2012: 0.75)
    longest_bend: float = 1.5
    # of the first step, over the columns' squared sizes: chosen (next to none: tangents are good)
    damping: float = 1e-6
    damping_factor: float = 30.0  # of the damping from one step to the next: time
    failed_damping: float = 1e-3  # at least, once a step has failed: time
    dampings: int = 6  # a step: time (the last shortens it by 1e8)


@dataclasses.dataclass(frozen=True)
class HeldOutSettings:
    """What held-out runs say of a refit: whether the change that it foretold is there."""

    # of the rows, by which a spread is estimated: chosen (tells it to 9 %; longer blocks than the
    # noise remembers)
    blocks: int = 64
    # standard errors of a multiplier that count as noise, up to `search.size_noise`: convention
    multiplier_errors: float = 3.0


@dataclasses.dataclass(frozen=True)
class ModelSettings:
    """What every model has: bounds of its uncertain parameters, friction widths, shuffles."""

    # prior sigmas, a bound: chosen (a normal law is beyond it once in 2000; that a Gaussian prior
    # alone has no force against 1e5 samples was the prototype's)
    hard: float = 3.5
    bound_tolerance: float = 1e-6  # of a bound, within which a number is at it: rounding
    shuffled_blocks: int = 40  # of a residual: chosen (fewer repeat, more lose its colour)
    # times where a friction law's width begins, and its part: chosen (a decade and a half)
    width_range: float = 30.0
    # parts of a friction law's speed, to which a refit may lower it: chosen (a decade)
    speed_below: float = 10.0
    # times the same: chosen (far above every speed the law is Coulomb's)
    speed_above: float = 3.0


@dataclasses.dataclass(frozen=True)
class ValleySettings:
    """Calibrations that the runs do not tell apart: both ends of such a valley are tried."""

    # sigma of all rows a prior sigma, below which priors alone tell a direction: chosen (it moves
    # chi2 by 0.01 where a prior moves it by 1)
    open_slope: float = 0.1
    step: float = 0.5  # prior sigmas: time
    corrections: int = 2  # Newton's, back into the valley after each step: time
    least_cosine: float = 0.5  # from one step to the next: chosen (beyond, the valley turns back)
    # times the fit's chi2, up to which a point still lies in its valley: chosen (more leads out of
    # it, less ends before its end)
    valley_cost: float = 1.2


@dataclasses.dataclass(frozen=True)
class WavesSettings:
    """Numbers that move a wave's phase: scanned over their range, where no tangent leads."""

    # even over odd part of a change at +- 1 sigma: chosen (tan(phi / 2) of a phase of 0.9 rad)
    wavy_ratio: float = 0.5
    finest_step: float = 1 / 16  # sigma, of a scan: time
    # of a step, also asked: derived (4/7: both are whole waves only of 1/7 of a step or less)
    second_step: float = 0.57
    starts: int = 32  # of the search over the scans, each drawn with a fixed seed: time
