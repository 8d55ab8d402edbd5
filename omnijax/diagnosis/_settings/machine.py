"""The sphere on its wheels as a model: its clocks, its lines, what it is asked, what it costs."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class ClocksSettings:
    """Readings between samples, and the clocks of runs that are not fitted."""

    degree: int = 5  # of the splines between samples: chosen (a lower one loses what rings fast)
    beyond_samples: int = 16  # to which a run is continued at its ends: rounding (splines forget)
    # of a run that is not fitted; runs tell an offset to a microsecond
    turns: int = 5  # Gauss-Newton steps: time
    step: float = 1e-7  # s, of a difference: rounding
    settled: float = 1e-8  # s, a change that ends them: rounding


@dataclasses.dataclass(frozen=True)
class LocateSettings:
    """Where a rig's prediction and a run disagree: what its residual is asked."""

    # of a change, left beside constant numbers, below which it is theirs: chosen (less is the
    # prediction's error)
    own_share: float = 1e-3
    # times what is left: a number whose own size changes a channel by less is not asked: own cases
    # (noise of the angles in the tangents was a change of a number)
    asked_size: float = 3.0
    # of a speed in rad/s, of which the sign is a direction: chosen (a slower wheel rests)
    digits: int = 3


@dataclasses.dataclass(frozen=True)
class RigOrdersSettings:
    """Orders of a wheel's angle that stand out in what is left of the rotation: a fine scan."""

    # orders tried within one resolution of the travel: measured (4 % of a line at most are lost
    # between; two of them had lost a third)
    grid: int = 4
    finer: int = 2  # steps apart are the best; times as many neighbours are looked at: time
    peaks: int = 3  # of a law and wheel, that are candidates: time
    # of a wheel: own cases (a ripple of order 51.6 was unknown where wheels travel far)
    most_orders: int = 6000
    lowest_order: float = 1.0  # of the grid: derived (windows take off what is slower)
    thinned: int = 8  # samples from one at which a line's size is computed to the next: time
    weighed: int = 64  # orders whose gain is computed in full, of a law and wheel: time
    dense: int = 19 * 64  # orders of a wheel that are weighed each, some 1200: time
    sparse: int = 8  # of those above, one in so many: time
    usual_speed: float = 0.5  # quantile, at which lines lie below half the sampling rate: time
    # the same of the highest lines: chosen (samples have to tell them at nearly any speed)
    fast_speed: float = 0.9
    least_left: float = 1e-6  # of a line, what counts as left of it at least: rounding
    least_left_thinned: float = 1e-3  # the same from `thinned` samples: chosen (these are rough)
    refined_gain: float = 0.9  # share of the best one's gain from which they are refined: time
    most_refined: int = 16  # of them: time
    slowest_wheel: float = 1e-6  # rad/s: rounding (one that stands has no lines)
    fewest_orders: int = 4  # of a grid: chosen (a wheel that hardly turns)
    # share of an acceleration along its main direction, below which others are left out: measured
    # (a torque on one shaft turns the sphere about one axis to 3e-6)
    main_direction: float = 1e-4


@dataclasses.dataclass(frozen=True)
class LineSetsSettings:
    """Lines of one law on one shaft that are chosen together."""

    # samples times orders up to which all orders are weighed: time (some 1 s of CPU)
    all_weighed: float = 1e7
    weighed: int = 256  # orders that are weighed of more: time
    alike: int = 64  # single lines that are refined: measured (some 50 explain runs as well)
    words: int = 768  # lines of which sets are made: time (some 1 s of CPU)
    beam: int = 32  # sets that are made larger: time
    partners: int = 8  # lines by which each of them is: time
    # sets of all lines that are refined one order after the other: measured (a line of 60 sigma
    # loses 144 of chi2 between orders of the scan; of 30 pairs 28 are found, with half as many 26)
    rough: int = 128
    best: int = 48  # of them, all orders together: time
    newton: int = 4  # steps of all orders together, of halves of a length: measured (to 1 in chi2)
    # quarters of the travel's resolution between two lines: chosen (half of it)
    apart: float = 2.0


@dataclasses.dataclass(frozen=True)
class RigModelSettings:
    """The sphere on wheels as a model of the diagnosis."""

    # evaluations of a search, anew once an effect closes most of a gap: time (some 60 s of CPU for
    # two train runs of 10 s at 500 Hz)
    budget: float = 400.0
    linear_cost: float = 0.3  # of an evaluation without laws stepped in time, over one with: time
    # of an exact tangent, over that of a difference: measured (0.25 s of CPU for 0.65 to 0.72)
    exact_cost: float = 0.4
    # rad, of an encoder's law whose signature is a difference: chosen (an encoder's noise)
    encoder_step: float = 1e-4
    floor_lines: int = 12  # spectral lines of `a` that are tried as floor vibrations: time
    # of a sample, of a time constant that is fitted: chosen (a shorter one changes nothing)
    least_lag: float = 0.25
    # of the largest speed, of a friction law: derived (tanh(3) is 0.995)
    widest_friction: float = 1 / 3
    # of a channel's readings, at which its sensor's limit would be: chosen (peaks are noise's)
    limit_quantile: float = 0.99
    # 1-sigma of its numbers, within which a fit's runs need not be smoothed anew: chosen (the next
    # refit moves them by less than a hundredth of that)
    near_errors: float = 0.1
