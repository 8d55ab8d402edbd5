"""The numbers that steer a diagnosis, in one frozen object, each with where it comes from.

"prototype" is a first program that knew the truth of the twelve public recordings; "own cases" are
misses of `benchmarks/hidden_effects` and `benchmarks/axes` with seeds that are for work; "derived"
follows from the statement beside it; "time" and "required" say themselves.  A number without such
a word is chosen: it was the first that worked.  Each section belongs to the file of its name, whose
work it steers; `free_` are those of machines that are run freely.  Numbers that change the time and
the memory of a diagnosis but no answer stand where they are used.
"""

import dataclasses

# The noise of the channels, and what a case needs


@dataclasses.dataclass(frozen=True)
class AxisCaseSettings:
    """`diagnose` of an axis or of a machine of the user's."""

    skipped_samples: int = 20  # samples that the benchmark of EMPS gives to a start
    hold_steps: int = 4  # steps of the refit by which a log's hold is judged once more: time
    relative: float = 1e-3  # of the cost, below whose fall it ends: time


@dataclasses.dataclass(frozen=True)
class DiagnoseSettings:
    """`diagnose`: a case in, a verdict with its evidence out."""

    window: float = 1.0  # s, after which Omega and the rolled lengths of a rig start anew
    # RMS of a channel over its white part, below which all of it is noise
    white_ratio: float = 1.25
    level_errors: float = 4.0  # 1-sigma of a measured level, up to which the model may show more
    level_share: float = 0.05  # share of the level that is allowed beside those `errors`
    # factor over a declared or assumed level, up to which the model may show
    assumed_factor: float = 2.0


@dataclasses.dataclass(frozen=True)
class NoiseSettings:
    # relative 1-sigma of a declared noise: "to some ten per cent, or to a factor"
    declared_error: float = 0.3
    agreed_errors: float = 4.0  # standard errors within which a declaration is kept as it is
    # relative 1-sigma of a noise of which nothing is known but an upper bound
    unknown_error: float = 1.0
    # steps of a quantised channel, in sigma, below which they are part of the noise
    finest_step: float = 0.3
    difference: int = 7  # of differences that leave of a motion its noise
    guessed_share: float = 1e-3  # of a channel's RMS, where they leave nothing: upper bound
    fewest_levels: int = 3  # levels of a quantised channel
    rounding_gap: float = 1e-3  # of the usual gap between levels, below which a gap is rounding
    grid_error: float = 0.02  # of a step, by which a gap may be off a whole number of them
    grid_share: float = 0.95  # of the gaps, that must be such numbers
    # 1-sigma of channels without noise over their RMS: the fit's own numerics stay a tenth below
    free_elastic: float = 0.02  # dR and a
    free_turning: float = 2e-4
    free_angle: float = 3e-6


@dataclasses.dataclass(frozen=True)
class RoomSettings:
    # samples that a period of the slowest mode, at which the sphere shakes, must keep
    period_samples: int = 10
    fewest_samples: int = 100  # samples of a run; fewer tell nothing of a machine's frequencies
    deflection: float = 1e-6  # m; the number of candidates does not hang on it


# The search


@dataclasses.dataclass(frozen=True)
class SearchSettings:
    """Frozen: one object steers a diagnosis."""

    # acceptance
    alpha: float = 1e-3  # chance of a false candidate in a whole scan: chosen
    shuffles: int = 4  # shuffled residuals whose best candidate is to be beaten: chosen
    sure_sigmas: float = 4.0  # standard deviations by which held-out runs confirm a change: chosen
    # factor by which a change there may be off the foretold one: own cases
    size_factor: float = 1.5
    size_noise: float = 0.15  # share of it that noise may add to that factor at most: own cases
    margin: float = 25.0  # chi2 by which an effect has to be needed, and a width: prototype
    # below it two rivals are equals; a wrong one leads by it by chance at most
    equal_margin: float = 12.0
    # 3e-4 of the time: derived (the gap of two fits is normal, of mean d^2 and variance 4 d^2)
    # least change of a group's RMS that is named: required of the project
    material_change: float = 0.01
    prediction_error: float = (
        5e-4  # share of all effects' change by which its prediction may be wrong: what is
    )
    # linear between samples misses (2 pi f h)^2 / 12 of a line, 3 Hz at 250 Hz: derived
    column_price: float = 12.0  # half of log N a column, N = 1e5 samples: derived (BIC)
    # how far a search goes
    most_effects: int = 8  # effects: required of the project
    refitted: int = 4  # candidates that are refitted a step: time
    runners_up: int = 1  # first effects gone on from as well: time
    runner_up_cost: float = 3.0  # their cost, times the best one's: own cases
    near_noise: float = 1.3  # chi2 a degree of freedom at which nothing else is tried first: time
    hopeless_cost: float = 3.0  # times the best trial's cost: three rounds are enough: time
    noise_share: float = 0.005  # share of a gap that counts as wrongly assumed noise: own cases
    # share of the cost by which a runner-up's way must be better: chosen
    runner_up_lead: float = 0.0
    # strong effects
    # chi2 a degree of freedom from which tangents do not rank: own cases
    strong_misfit: float = 4.0
    strengths: tuple[float, ...] = (0.2, 0.6, 2.0)  # finite strengths tried: own cases
    bent_sigmas: float = 2.0  # prior sigmas from which a calibration was bent: own cases
    both_anchors: bool = (
        False  # then finite strengths are tried about the calibrated machine too: own cases
    )
    promise_share: float = 0.2  # share of the best promise below which nothing is refitted: time
    least_closed: float = 0.02  # share of a strong gap that a law must close: own cases
    part_closed: float = 0.9  # share of what a part of the channels shows of it: own cases
    # share of a gap that a law closes which is confirmed later, or, where the gap is strong, earns
    # a new budget: own cases
    trusted_closed: float = 0.5
    openings: tuple[float, ...] = (0.1, 0.2, 0.35, 0.6)  # shares of the motion: own cases
    opening_closed: float = 0.2  # share of an opening's gap to be followed further: own cases
    # calibration
    caught_share: float = 0.2  # share of parameters at their bounds that no effect bends: own cases
    restarts: int = 3  # other starts of one that is caught: time
    # refits and rivals
    settle_rounds: int = 5  # rounds of smoothing anew at most: own cases
    settled_misfit: float = 1.02  # chi2 a row at which they end: own cases
    near_margin: float = 100.0  # margin by tangent below which a rival is refitted: 4 margins
    like_gain: float = 0.9  # share of an effect's gain from which a rival is: own cases
    like_rivals: int = 4  # of those: time
    most_rivals: int = 8  # candidates looked at as rivals: time
    swaps: int = 3  # times an effect may give way to a rival: time
    # times the cost: a rival above it after one round imitates nothing: time
    far_cost: float = 10.0
    # standard deviations of chi2 within which what is left is noise: chosen
    noise_sigmas: float = 4.0
    shown_most: int = 12  # of what stands out, in answers


@dataclasses.dataclass(frozen=True)
class RefitsSettings:
    """Joint refits of a search: of a new effect, of a settled set, of friction widths."""

    effect_steps: int = 8  # steps with a new effect: time
    without_steps: int = 2  # steps of a refit with one effect less: time
    # of the cost, below whose fall they end where it is far from the noise: time
    relative: float = 1e-3
    opening_relative: float = 1e-2  # the same of a run's opening: time
    # of a strength, where a refit may begin
    weaker_strengths: tuple[float, ...] = (1.0, 0.5, 0.2, 0.05)
    width_steps: int = 4  # steps with friction widths set free: time
    rival_steps: int = 4  # steps with a rival in an effect's place: time
    settled_ratio: float = 0.98  # of the last chi2, above which smoothing anew gains nothing
    # times the best cost, above which friction widths stay stated: time
    stepped_widths: float = 10.0  # with a law that is stepped in time
    plain_widths: float = 100.0  # without


@dataclasses.dataclass(frozen=True)
class CalibrationSettings:
    """The calibration of the uncertain parameters before any effect is known."""

    caught_cost: float = 10.0  # times the cost of mere noise
    scanned_cost: float = 4.0  # the same: that of a noise twice as large as declared
    relative: float = 0.01  # of the cost, below whose fall a refit ends: time
    bound_share: float = 0.999  # of a bound, from which a parameter is at it


@dataclasses.dataclass(frozen=True)
class CandidatesSettings:
    plays: tuple[float, ...] = (0.3, 0.5, 1.0, 1.5, 2.5, 4.0, 7.0)
    torque_limits: tuple[float, ...] = (0.97, 0.9, 0.75, 0.5)  # shares of the largest torque
    delays: tuple[float, ...] = (0.001, 0.002, 0.004, 0.008, 0.016, 0.032)  # s
    longest_delay: float = 0.1  # s
    least_play: float = 1e-4  # RMS deflections of a mount, the least play told
    small_plays: tuple[float, ...] = (0.01, 0.05)  # plays far below it, by their tangent
    relaxation: tuple[float, ...] = (0.003, 0.01, 0.03, 0.1)  # s
    # of the wheels' RMS speed: where friction falls; 0.1 to 3 rad/s in machines of 7 rad/s
    stribeck: tuple[float, ...] = (0.015, 0.05, 0.15, 0.5)
    # SI, of a constant without range
    any_values: tuple[float, ...] = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0)
    values_between: int = 4  # values tried between a shape constant's bounds
    # of the way to a law without strength, that its tangent has to ask for at least
    least_share: float = 0.05
    whole_orders: int = 24  # whole ones that are tried whatever stands out
    order_apart: float = 0.05  # of an order, by which one that stands out is no whole one
    least_time: float = 1e-6  # s, of a time that is fitted


@dataclasses.dataclass(frozen=True)
class DoubtSettings:
    """What held-out runs may show of numbers that the fitted runs left open."""

    # of as much along their tangents, below which they do not leave it open: chosen
    chance: float = 1e-3
    rounds: int = 4  # of tangents anew about where the last ones led: time
    settled_sigmas: float = 0.1  # of their sigmas, a step that is not worth another round


@dataclasses.dataclass(frozen=True)
class FitSettings:
    """Joint refits: baseline parameters and effects together, Gauss-Newton with bounds."""

    # a fall of chi2 after which the baseline's tangents are taken anew
    renewing_fall: float = 200.0
    most_steps: int = 20  # steps of a refit at most: they have ended before
    patience: int = 3  # rounds after which a refit without hope ends: time
    steps_between: int = 10  # steps between two preparations of the data about their end: time
    noise_floor: float = 1.2  # chi2 a degree of freedom, below which nothing but noise is left
    # times that, above which a relative fall of the cost ends a refit: time
    far_ratio: float = 10.0
    number_step: float = 1e-4  # of an effect's number, or of a unit for waves: of a difference
    least_number: float = 1e-6  # its size where it is 0
    prior_step: float = 1e-3  # prior sigmas, of a difference by an uncertain parameter


@dataclasses.dataclass(frozen=True)
class GaussNewtonSettings:
    ended_fall: float = 0.02  # fall of chi2 that is not worth another round
    kept_fall: float = 0.8  # share of its foretold fall that a straight step has to bring
    bent_fall: float = 1.0  # foretold fall of chi2 that is worth a look at the valley's bend
    longest_bend: float = 1.5  # |a| over |d| above which a parabola says nothing
    damping: float = 1e-6  # of the first step, over the columns' squared sizes
    damping_factor: float = 30.0  # of the damping from one step to the next
    failed_damping: float = 1e-3  # at least, once a step has failed
    dampings: int = 6  # dampings a step: the last shortens it by 1e8


@dataclasses.dataclass(frozen=True)
class HeldOutSettings:
    """What held-out runs say of a refit: whether the change that it foretold is there."""

    blocks: int = 64  # of the rows, by which the spread is estimated
    # standard errors of a multiplier that count as noise, up to `search.slack`
    multiplier_errors: float = 3.0


@dataclasses.dataclass(frozen=True)
class LevelsSettings:
    differences: tuple[int, ...] = (3, 5, 7)
    window: int = 64  # samples of one stretch
    colour_chance: float = 1e-5  # chance of a colour's gain in white noise below which it is one
    # ratio of powers below which a spectrum that is not flat is weighed as white
    flat_ratio: float = 1.25
    fewest_windows: int = 4  # of them at least
    step_tolerance: float = 0.01  # of a sampling step, within which runs show one colour together
    median_scatter: float = 1.25  # of a median over that of a mean: derived (sqrt(pi/2))
    lower_level: float = 1.1  # times the level, by which a higher difference has to be below it
    least_freedom: float = 4.0  # degrees of freedom of a coloured level at least


@dataclasses.dataclass(frozen=True)
class SpectrumSettings:
    """The spectrum of noise by waves of half periods, and which colour the data show."""

    white_from: float = 0.25  # cycles a sample, from which a spectrum is its white end
    bin_width: float = 1.35  # of a spectrum's bin, its end over its begin
    bin_waves: int = 16  # waves of each run in a bin at least
    # decades of a walk's and of low-pass noise's power over white noise's; so many of them tried
    decades: tuple[float, float] = (-4.0, 9.0)
    powers: int = 40
    slowest_corner: float = 10.0  # times the slowest wave, the slowest corner that is no walk's
    corners: int = 10  # tried, from there to the fastest wave
    merged_waves: float = 1.05  # waves within this factor are one bin
    walk_before: float = 1e5  # run lengths for which a walk had gone on before a recording


@dataclasses.dataclass(frozen=True)
class FunctionModelSettings:
    """A model of the user's own: the strength at which a law's tangent is taken."""

    least_change: float = 1e-7  # of the residual, a change that is well above rounding
    most_change: float = 1e-3  # of it, a change that is still in proportion
    weaker: float = 0.1  # times the strength, where it changes more
    stronger: float = 30.0  # where it changes less
    most_strengths: int = 60  # strengths: 1e60 times as weak, or 1e88 as strong


@dataclasses.dataclass(frozen=True)
class LimitsSettings:
    """What the runs exclude: an upper limit for every effect that was not named."""

    draws: int = 400  # of strengths with several columns: the limit is then known to 3 %
    most_share: float = 1.0  # of a share: that of a gain, above which no limit says anything


@dataclasses.dataclass(frozen=True)
class ModelSettings:
    # prior sigmas: Gaussian priors have no force against 1e5 samples, bounds have
    hard: float = 3.5
    bound_tolerance: float = 1e-6  # of a bound, within which a number is at it: rounding
    shuffled_blocks: int = 40  # of a residual that is shuffled
    # times where a friction law's width begins, and its part: a decade and a half
    width_range: float = 30.0
    speed_below: float = 10.0  # parts of a friction law's speed, to which a refit may lower it
    speed_above: float = 3.0  # times the same: far above every speed the law is Coulomb's


@dataclasses.dataclass(frozen=True)
class ReadingsSettings:
    # equally filled stretches of the reading, between which the function is straight
    knots: int = 12
    least_direction: float = 1e-6  # of the longest direction: a shorter one is none


@dataclasses.dataclass(frozen=True)
class SteadinessSettings:
    """Whether effects are as strong at all times and in all runs: asked of all runs at once."""

    degree: int = 3  # of the course over a run: 2 % of what warms within a third of it is left
    # chance of a part that is not constant: five standard deviations, as of sizes
    chance: float = 5.7e-7
    # of a change's length, below which a direction of its course is none
    least_direction: float = 1e-3


@dataclasses.dataclass(frozen=True)
class ValleySettings:
    # sigma of all rows a prior sigma, below which priors alone tell a direction
    open_slope: float = 0.1
    step: float = 0.5  # prior sigmas
    corrections: int = 2
    least_cosine: float = 0.5  # least cosine from one step to the next
    valley_cost: float = 1.2  # times the fit's chi2, up to which a point still lies in its valley


@dataclasses.dataclass(frozen=True)
class WavesSettings:
    # even over odd part of a change at +- 1 sigma: tan(phi/2) of a phase phi of 0.9 rad
    wavy_ratio: float = 0.5
    finest_step: float = 1 / 16  # sigma, of a scan's steps
    # of a step, also asked: both are whole waves of 1/7 of it or less only
    second_step: float = 0.57
    starts: int = 32  # of the search over the scans, each drawn with a fixed seed


@dataclasses.dataclass(frozen=True)
class WhereSettings:
    shuffles: int = 60
    discovery_rate: float = 0.01  # false discoveries that are accepted
    highest_order: int = 40
    neighbours: int = 8  # bands on either side that a line is compared with
    band_width: float = 0.5  # Hz, of a band: a line that stays put stays in it
    # length that a column of length 1 must keep once line and mean are taken off: less is rounding
    least_column: float = 1e-4
    bins: int = 12  # of a state, equally filled
    block_samples: int = 125  # samples of a shuffled block, or a share of a short run
    fewest_blocks: int = 16  # of it at least
    shortest_block: int = 4  # samples of such a block
    end_samples: int = 50  # samples at each end, by whose means a straight line is taken off
    end_parts: int = 10  # of so many parts of a run, which an end is at most
    least_shape: float = 1e-3  # of the beta law of shuffled shares at least
    unsure_shown: int = 3  # returned where nothing stands
    # of the largest miss in sigma, of the channels that these are sought in
    missed_share: float = 0.5
    rounding: float = 1e-6  # sigma: a channel that nobody measured, or that is met exactly


@dataclasses.dataclass(frozen=True)
class StartsSettings:
    """Where joint refits begin: by tangent, or at finite strength where effects are strong."""

    equal_gain: float = 0.97  # share of the best line's gain from which others are refitted: time
    other_lines: int = 7  # so many more: a short travel has eight within 0.97
    # share of the best refit's gain from which the others of a name are refitted: time
    name_gain: float = 0.9
    # halvings of the distance between limits or times that are tried: 3 leave a tenth of it
    halvings: int = 3


@dataclasses.dataclass(frozen=True)
class ThroughLawsSettings:
    """Signatures beside laws that are stepped in time, by differences."""

    most_columns: int = 32  # at most: time
    variants: int = 4  # variants of one law at one place: time


# The rig


@dataclasses.dataclass(frozen=True)
class PredictionSettings:
    """How finely a run is predicted, and where its prediction starts from."""

    # resolution: what is left by each is below a tenth of the noise of the recordings in the tests
    force_points: int = 8  # forces and torques a sample; trapezoids between them
    shape_points: int = 32  # wheel shapes a sample: the gap's edges are kinks
    steps: int = 16  # steps a sample of laws at contacts and mounts, which have kinks
    coarse_steps: int = 8  # where laws are only ranked; second order: four times the error
    # share of a step's last change of a tension that the next one is taken to keep at most
    kept_change: float = 0.5
    thin: int = 4  # force points in one of a tangent's: torques are smooth
    rates_apart: float = 1e-4  # of the largest rate: nearer ones are divided as if so far apart
    table_points: int = 16384  # a turn of the wheel's tables: 0.38 mrad, errors below 1e-8 m
    # fixed points
    normal_turns: int = 2  # of N and f from N at the last rebase; N changes f by some 1e-2
    rebase_turns: int = 4  # of smoothing about a prediction that hangs on the motion itself
    settled_noise: float = 0.3  # of the noise of a rolled length: a smaller change ends those turns
    angle_turns: int = 20  # at most of taking the sensors' laws off measured angles
    angle_change: float = 1e-5  # rad, a tenth of an encoder's noise: what ends them
    angle_away: float = 2.0  # times the least misfit, above which such a turn runs away: chosen
    angle_step: float = 3e-4  # rad (rad/s) to each side, for a reading's slope: encoders' 3 sigma
    least_slope: float = 1e-3  # slope, below which a reading tells nothing of the value: chosen
    begins: int = 6  # moments of a run that say where a folded angle may have begun: chosen
    begin_turns: int = 4  # Newton steps from each; readings are straight lines by pieces: chosen
    opening_samples: int = 20  # samples whose cubic tells the motion before a rolling start
    # friction near a reversal
    pull: float = 5.0  # 1/s, at which Omega is held to the measured one (see `observer`)
    turning_error: float = 1e-5  # rad/s, a tenth of usual noise: a step that errs by more is halved
    still_share: float = 1e-5  # of that, below which nothing swings
    shortest_turn: float = 1 / 64  # of a step, at which that ends: stiffness of 2e5 / s at 1 kHz

    row_blur: float = 5.0  # of an encoder's noise, within which an angle tells no row: chosen

    # clocks of loggers: started together they are off by parts of a millisecond (issue 17: 0.7 ms)
    clock_error: float = 5e-4  # s, 1-sigma of an offset: chosen
    clock_most: float = 9.5e-4  # s; what is read later is a delay: below a sample at 1 kHz
    # degree of the polynomial through an opening, that tells the motion before
    opening_degree: int = 3
    angle_noise: float = 1e-4  # rad, by which rolled lengths are weighed where no angle is measured
    wider_angles: float = 1.2  # times the angles that Omega tells, over which tables reach
    rest_steps: int = 12  # steps to the static rest of laws: it is found to rounding
    probes: int = 64  # angles, at which a shape that repeats each turn is told


@dataclasses.dataclass(frozen=True)
class ClocksSettings:
    degree: int = 5  # of the splines between samples
    beyond_samples: int = 16  # further samples to which a run is continued at its ends
    # of a run that is not fitted: Gauss-Newton steps, a difference's step and what is near
    # enough, both far below the microsecond to which runs tell an offset
    turns: int = 5
    step: float = 1e-7  # s
    settled: float = 1e-8  # s


@dataclasses.dataclass(frozen=True)
class ComparedSettings:
    """How much of a run is compared."""

    told_share: float = 0.9  # share of a channel's samples, below which it is told: required
    least_share: float = 0.03  # of every channel, below which nothing can be said: required


@dataclasses.dataclass(frozen=True)
class DataVectorSettings:
    """The data vector: whitened residual rows, and the directions that are left out of it."""

    settle: float = 0.3  # s after an unknown input in which the elastic channels are not used
    shortest_window: int = 20  # samples of a window


@dataclasses.dataclass(frozen=True)
class EncodersSettings:
    """What the encoders' noise leaves in dR and a: a covariance of low rank."""

    most_modes: int = 100  # modes a wheel; a rougher smoother's are cut off
    least_gain: float = 0.05  # gain of the smoother below which a mode does not count
    parts: int = 4  # points a sample: a covariance needs no more
    least_variance: float = 0.01  # change of a row's variance, below which it is left alone
    spare_modes: int = 16  # modes beyond those that count, from which these are told


@dataclasses.dataclass(frozen=True)
class LocateSettings:
    """Where a rig's prediction and a run disagree: what its residual is asked."""

    # share of a change that is left beside constant numbers, below which it is theirs
    own_share: float = 1e-3
    # times what is left: a number whose own size changes a channel by less is not asked
    asked_size: float = 3.0
    digits: int = 3  # of a speed in rad/s, of which the sign is a direction


@dataclasses.dataclass(frozen=True)
class NoiseModelSettings:
    start_angle: float = 0.01  # rad, 1-sigma of the start angle of a wheel without encoder
    # of the readings' spread: a change over which sensors' laws count as straight
    straight_change: float = 1e-4


@dataclasses.dataclass(frozen=True)
class RigOrdersSettings:
    """Orders of a wheel's angle that stand out in what is left of the rotation: a fine scan."""

    # orders tried within one resolution of the travel: at most 4 % of a line lost between
    grid: int = 4
    finer: int = 2  # steps apart are the best; times as many neighbours are looked at
    peaks: int = 3
    most_orders: int = 6000  # orders of a wheel
    lowest_order: float = 1.0  # windows take off what is slower
    thinned: int = 8  # samples from one at which a line's size is computed to the next
    weighed: int = 64  # orders whose gain is computed in full, of a law and wheel
    dense: int = 1216  # orders of a wheel that are weighed each
    sparse: int = 8  # of those above, one in so many
    # quantile of the speed at which lines lie below half the sampling: time
    usual_speed: float = 0.5
    fast_speed: float = 0.9  # the same of the highest lines
    least_left: float = 1e-6  # of a line, what counts as left of it at least
    least_left_thinned: float = 1e-3  # the same from `thinned` samples
    refined_gain: float = 0.9  # share of the best one's gain from which they are refined
    most_refined: int = 16  # of them at most: time
    slowest_wheel: float = 1e-6  # rad/s, of a wheel's speed at least: one that stands has no lines
    fewest_orders: int = 4  # of a grid of orders at least
    # share of an acceleration along its main direction below which other directions are left out
    main_direction: float = 1e-4


@dataclasses.dataclass(frozen=True)
class TurningNoiseSettings:
    """Noise of a colour in Omega and theta, told beside the free start of every window."""

    # Hz, above which a free start of a window of about 1 s takes up nothing of noise
    told_from: float = 1.0
    fewest_waves: int = 100  # waves that tell a level to 7 %
    # decades of a walk's power at a run's slowest wave over white noise's, and of an offset's; so
    # many of them tried: a walk's size is then known to 20 %, as 25 waves above the noise tell it
    decades: tuple[float, float] = (-1.0, 7.0)
    powers: int = 24
    # in which low-pass noise is told again beside the starts: it stays then
    low_pass_turns: int = 2
    moved_powers: int = 2  # powers up and down to which one that was taken in may move at once
    start_weight: float = 1e-13  # of a start's weight, at which nothing but rounding tells it


@dataclasses.dataclass(frozen=True)
class RunsSettings:
    """Whether a run begins in motion."""

    first_samples: int = 10  # samples, over which an angle has to change by more than noise
    # sigma of the first speed, and times the noise of one sample: chosen
    rolling_sigmas: float = 5.0


@dataclasses.dataclass(frozen=True)
class OutliersSettings:
    """Isolated samples that fit neither their neighbours nor the model: left out, and said."""

    wild_sigmas: float = 8.0  # sigma above the samples on both sides
    # sigma above them, below which one that was left out fits after all: of 1e4 samples of white
    # noise 3.5 stand out so far from both of their neighbours
    fits_sigmas: float = 4.0
    # samples of all runs: fewer are not worth another look at all laws, for time
    fewest_back: int = 5
    cut_sigmas: float = 4.0  # sigma below what is foretold, from which a reading was cut off
    # share of a channel's samples above which they are no outliers but a misfit
    most_share: float = 0.06
    # samples beside a gap's edge, where a mistimed prediction makes spikes too
    edge_samples: int = 3
    # of the steepest slope: a larger change from sample to sample is an edge too
    kink_slope: float = 1.0
    # samples to each side whose usual change a spike has to exceed: a shock's ringing has decayed
    neighbours: int = 20
    # median of a difference of two samples of white noise, in sigma: derived
    median_difference: float = 0.954
    edge_ratio: float = 3.0  # times as many there as elsewhere, from which edges make them


@dataclasses.dataclass(frozen=True)
class RigModelSettings:
    """The sphere on wheels as a model of the diagnosis."""

    # evaluations of a search, anew once an effect closes most of a gap: some 60 s of CPU for two
    # train runs of 10 s at 500 Hz
    budget: float = 400.0
    # cost of an evaluation without laws stepped in time, relative to one with them
    linear_cost: float = 0.3
    exact_cost: float = 0.4  # cost of an exact tangent over that of a difference
    encoder_step: float = 1e-4  # rad, of an encoder's law whose signature is a difference
    floor_lines: int = 12  # spectral lines of `a` that are tried as floor vibrations
    least_lag: float = 0.25  # of a sample, the least time constant that is fitted
    # of the largest speed, the widest friction law: tanh is 0.995 there
    widest_friction: float = 1 / 3
    # quantile of a channel's readings, at which its sensor's limit would be
    limit_quantile: float = 0.99


@dataclasses.dataclass(frozen=True)
class RolesSettings:
    """Which runs teach and which confirm; one run alone plays both roles by parts."""

    block: float = 1.0  # s, of the only run that teach or confirm in turn
    # s, of such a block: some turns of the slowest ring of a machine of 10 Hz
    shortest_block: float = 0.25
    teaching_blocks: int = 2  # blocks that teach for one that confirms
    fewest_blocks: int = 6  # blocks below which nothing is confirmed


@dataclasses.dataclass(frozen=True)
class SmoothSettings:
    """Smoothing of measured rolled lengths: white jerk, its intensity by likelihood."""

    # of the ratio: weight of missing samples, which keeps long gaps solvable
    missing_weight: float = 1e-13
    decades: float = 11.0  # decades of the ratio above one
    ratios: int = 23  # tried, two a decade


@dataclasses.dataclass(frozen=True)
class StartAnglesSettings:
    """Where a wheel without encoder stood at the first sample, from dR and a."""

    phases: int = 28  # a pitch
    steps: int = 12  # of Gauss-Newton at most
    rounds: int = 6  # of wheel by wheel descent from the best of the coarse combinations
    coarse: int = 4  # of these from one to the next combination that is tried


@dataclasses.dataclass(frozen=True)
class TangentsSettings:
    radius_step: float = 1e-6  # of a wheel's radius: shapes are smooth in it
    # of a wave between moments, above which its torque is taken at all fine points
    wave_angle: float = 0.5


# Machines that are run freely: axes and a user's own


@dataclasses.dataclass(frozen=True)
class FreeBeforeSettings:
    # of the past that sensors see: several times the longest lag that is tried
    seconds: float = 0.3


@dataclasses.dataclass(frozen=True)
class FreeBuildSettings:
    """From a machine's case to its model: criterion, noise, laws and places."""

    # Hz a sample a second, tried from the widest
    cutoffs: tuple[float, ...] = (0.1, 0.07, 0.05, 0.035, 0.025, 0.015)
    most_rows: int = 6000  # of a run's free run that are compared; more say nothing new
    window_leads: int = 4  # a window is at least so many times its lead
    # of the time that an axis is pushed away from rest, above which free runs say nothing
    pushed_away: float = 0.05
    least_window: int = 64  # samples, from which a window is at least so many of its leads
    windows: int = 16  # of the longest run, at most
    whole_leads: int = 4  # leads and windows in a run that is one window: time
    # turns that an axis makes, from which its encoder's wave is no slope and no bend of a sensor
    turned_share: float = 0.5


@dataclasses.dataclass(frozen=True)
class FreeCandidatesSettings:
    scale_shares: tuple[float, ...] = (0.02, 0.07, 0.2, 0.6)
    # of the time that the command is below a limit of the drive
    below_limit: tuple[float, ...] = (0.97, 0.9, 0.75, 0.5)
    # s, delays and lags of drives beside those of few samples
    slow_times: tuple[float, ...] = (4e-3, 0.016, 0.064)
    # of it, for a limit that shows: what is seen at a few peaks may be their dynamics
    limit_seen: float = 0.98
    lags: tuple[float, ...] = (0.5, 2.0, 8.0)  # samples, of lags
    delays: tuple[float, ...] = (0.25, 1.0, 4.0)  # samples, of delays
    any_values: tuple[float, ...] = (0.1, 1.0, 10.0)  # of a constant without range
    moved_time: float = 0.05  # of a tried time, and its part, between which a tangent may move it


@dataclasses.dataclass(frozen=True)
class FreeColourSettings:
    """What a sensor's white noise makes of a balance: rows of a blue colour, weighed by it."""

    least_covariance: float = 1e-9  # of the autocovariance, below which rows share no noise
    rounds: int = 3  # of a refit weighed by a colour and the colour of what it leaves
    span: int = 3  # lengths of the thinning filter on either side that an impulse is followed
    relative: float = 1e-4  # of the cost, below whose fall a refit ends
    fewest_rows: int = 200  # rows on either side, that an impulse is followed at least
    decades: tuple[float, float] = (-7.0, 2.0)  # of the rows' variance that is no sensor noise
    powers: int = 19  # of it tried, two a decade


@dataclasses.dataclass(frozen=True)
class FreeEvidenceSettings:
    """A machine of a few states as evidence: groups, places, free runs, the learned term."""

    # times the noise: a run that moves less has no share of its motion to speak of
    rest_ratio: float = 5.0
    # of the gap by a named set: real machines are never as good as their sensors
    closing: float = 0.3
    # of a size on held-out runs: friction of one log is not that of the next one, as grease warms
    size_tolerance: float = 0.5


@dataclasses.dataclass(frozen=True)
class FreeExperimentSettings:
    """The next run of a machine: the input among a few under which rivals differ most."""

    seconds: float = 10.0
    sine_rate: float = 0.2  # Hz, of a sine
    chirp: tuple[float, float] = (0.1, 2.0)  # Hz, between which a sine gets faster


@dataclasses.dataclass(frozen=True)
class FreeFloorSettings:
    """What no law of the library explains: the noise against which an effect must stand."""

    laws: int = 2  # laws, one after the other
    refitted: int = 2  # refits a step
    left_cost: float = 0.95  # of the misfit that is left at most, for a further law
    noise_misfit: float = 1.3  # chi2 a row from which a law is looked for
    turns: int = 6  # of starts and refits, one after the other, at most
    turn_cost: float = 0.7  # of the misfit that is left at most, for a further turn
    least_direction: float = 1e-3  # of the longest direction of all tangents; a shorter one is none
    relative: float = 1e-3  # of the cost, below whose fall it ends: time
    least_correlation: float = 0.05  # autocorrelation below which rows are independent
    longest_lag: float = 0.25  # of the longest run, up to which it is looked at


@dataclasses.dataclass(frozen=True)
class FreeKnownSettings:
    """What a balance knows of states that nobody measures: behind a sensor or a drive, in it."""

    # steps a sample of a second inertia: stable up to its mode at 1.7 times the rate
    steps: int = 4
    rounds: int = 3  # of finding what a sensor was shown: errors of 1 % are left at 1e-6 then


@dataclasses.dataclass(frozen=True)
class FreeLearnedSettings:
    knots: int = 7  # of each input's piecewise-linear basis
    ridge: float = 1e-3


@dataclasses.dataclass(frozen=True)
class FreeModelSettings:
    """A machine of a few states with its runs as a model of the diagnosis."""

    most_steps: int = 48  # steps between two samples above which a law is too steep to be followed
    gain_bound: float = 0.5  # a gain that is off by more is no torque constant any more
    ranking_runs: int = 4  # train runs, far apart in their order, that rank laws at finite strength
    number_price: float = 0.01  # share of its gain that each number of a law must be worth
    start_steps: int = 6  # steps of Gauss and Newton of the windows' starts at a point
    start_parts: tuple[float, ...] = (1.0, 0.3)  # of such a step, that are tried
    start_gain: float = 0.01  # of the squares, that a further one must gain
    lines: int = 3  # of one law with an order at one place
    # of itself, that a refit may move one: or half of what the travel tells
    order_range: float = 0.03
    budget: float = 4000.0  # evaluations of a search, anew as those of a rig's: time
    # of the search, in place of those of `SearchSettings`
    runner_up_lead: float = 0.1
    size_factor: float = 2.0
    size_noise: float = 0.0
    instants: int = 24  # at which a point's slopes are taken: time
    sloped_runs: int = 8  # runs of which they are taken: time
    slowest_friction: float = 0.005  # of the runs' speed, the least of a friction law
    fastest_friction: float = 2.0  # the same, the largest
    limit_range: float = 2.0  # times a limit of a sensor, and its part, within which it is fitted
    time_range: float = 30.0  # times a delay or lag, the same


@dataclasses.dataclass(frozen=True)
class FreeOrdersSettings:
    """Orders that stand out in what is left: a fine scan over the measured position."""

    fine: int = 4  # orders tried within one resolution of the travel
    finer: int = 8  # times as many beside a peak
    periods: int = 2  # of a line over the travel: what does not repeat is none
    peaks: int = 8
    # of them, whatever line they belong to: which neighbour is right shows in a refit
    highest: int = 3
    most_peaks: int = 256  # peaks among which further lines are looked for beside the strongest
    most_orders: int = 6000
    # share of the rows that a line must pass slowly enough to be seen in them
    slow_rows: float = 0.05
    least_line: float = 1e-6  # of the strongest line, a shorter one beside it is none


@dataclasses.dataclass(frozen=True)
class FreeReopenedSettings:
    """Windows whose free start is caught, begun anew from what was measured."""

    caught_ratio: float = 10.0  # times the median window's mean square, that a caught one misses
    openings: tuple[float, ...] = (0.125, 0.25, 0.5, 1.0)  # of a window, one after the other


@dataclasses.dataclass(frozen=True)
class FreeRowsSettings:
    """Measured less predicted, one run: over a free run, or in the balance of accelerations."""

    least_start: float = 1e-6  # of the best seen part of a start, what must be seen of another one
    filter_taps: int = 10  # taps of the thinning filter to each side, in thinned samples
    filter_order: int = 4  # of the low pass of measured signals, each way
    highest_cutoff: float = 0.99  # of half the sampling rate, its cutoff at most
    passed_band: float = 0.8  # of half the rows' rate, the cutoff of the thinning filter
    impulse_samples: int = 2001  # samples at least, over which a low pass dies away
    impulse_edges: int = 8  # edges of the thinning filter, the same


@dataclasses.dataclass(frozen=True)
class FreeSensorNoiseSettings:
    """The noise of what the logs of a machine measured, each by itself."""

    noise_free: float = 1e-6  # of what is measured, as noise where there is none
    level_error: float = 0.05  # relative 1-sigma of the noise's level
    # the highest of the orders' levels over the least, above which there is motion in them: 1.02
    # in white noise of a few thousand samples
    white_ratio: float = 1.1


@dataclasses.dataclass(frozen=True)
class FreeTogetherSettings:
    """Several lines of one place at once, as the balance of accelerations has them."""

    relaxed_turns: int = 3  # times that each line is looked for anew beside the others, at most
    moved_cost: float = 0.99  # of the squares that are left at most, where it is found elsewhere
    rounds: int = 8  # steps of a refit with or without a line: time


@dataclasses.dataclass(frozen=True)
class FreeUndecidedSettings:
    least_sigma: float = 0.1  # 1-sigma over the noise, from which a direction counts


# The answer


@dataclasses.dataclass(frozen=True)
class AnswerLearnedSettings:
    """A learned, uninterpreted term on one port, where no known effect closes the gap."""

    followed_to: float = 10.0  # RMS: beyond that a term is not followed
    network_share: float = 0.01  # share of the held-out gap that the network has to add
    # share of the misfit that a round must take away to be followed by another
    round_gain: float = 1e-3
    rounds: int = 5  # of a refit of the term and the machine together
    inner: int = 5  # steps of the term in each: time
    hidden: int = 6  # nodes of the network
    # times the ridge, until a step fits better: the tangents know nothing of what a term feels of
    # itself, so far from its end only short steps may
    dampings: tuple[float, ...] = (1.0, 30.0, 1e3, 3e4, 1e6)
    drawn_to: float = 2.5  # RMS of an input, to each side of 0, over which a term is drawn
    points: int = 101  # of a curve
    grid: int = 41  # of a map, to each side
    drawn_rows: int = 4000  # rows that say on which inputs it hangs most: time
    mean_rows: int = 50  # of them over which a curve is a mean: time
    angle_harmonics: int = 4  # harmonics of a wheel's angle in the basis
    # RMS of a command, at which functions of it bend: octaves, as a sum of two neighbours bends
    # nearly anywhere between, from a motor's dead zone to where it saturates
    knees: tuple[float, ...] = (1 / 16, 1 / 8, 1 / 4, 1 / 2, 1.0, 2.0)
    shape_harmonics: int = 8  # of them in a wheel's shape, beside those of its pitch
    near_laws: int = 12  # of the library's that act there, asked how near they come: time
    nearest: int = 2  # of them drawn
    near_cosine: float = 0.5  # cosine with what the term does, below which a law is not near
    drawn_part: float = 0.1  # of the strongest part's change, below which a part is not drawn
    # of a function's square beside those that are in: less tells nothing
    least_square: float = 1e-6
    sign_sharpness: float = 20.0  # of the speed's RMS in one: how steeply the basis knows its sign
    # on columns of length 1
    basis_ridge: float = 1e-6  # of the smooth basis
    network_ridge: float = 1e-3


@dataclasses.dataclass(frozen=True)
class AnswerResultSettings:
    """What a diagnosis returns, and the file in which it is written."""

    # times the noise (1 sigma beside it): above this something else is missing too
    remaining_ratio: float = 1.4
    determined_sigma: float = 0.7  # prior sigmas, below which the runs have told a parameter
    # of chi2 by the noise that is left, which one more step promises: a number moves by 1 sigma
    unended_fall: float = 1.0


@dataclasses.dataclass(frozen=True)
class RigEvidenceSettings:
    """The sphere on its wheels as evidence."""

    clock_sigmas: float = 4.0  # 1-sigma by which a clock has to be off to be spoken of


@dataclasses.dataclass(frozen=True)
class ShownSettings:
    """The noise that the data show once all that is known is in, beside what was declared."""

    search_again: float = 0.1  # share by which a level may be off before the search is made again
    structure_power: float = 0.09  # power over the noise's, by what hangs on a state: 0.3 sigma
    level_share: float = 0.03  # share by which a level has to be off to be mended
    level_errors: float = 4.0  # standard errors of the same
    told_errors: float = 3.0  # of them, from which a declared level is said to be another one


@dataclasses.dataclass(frozen=True)
class SizesSettings:
    """What the held-out runs leave unexplained at every size of a named effect."""

    shares: tuple[float, ...] = (0.25, 0.5, 0.75, 1.25, 1.5)  # of the found size, beside 0 and 1
    kept_power: float = 0.8  # of the difference's power that means over blocks have to keep


@dataclasses.dataclass(frozen=True)
class StretchesSettings:
    """Stretches of a held-out run that lie farther off than any noise of their channel."""

    fewest_samples: int = 3  # samples: one or two beside each other are a shock or a bad reading


@dataclasses.dataclass(frozen=True)
class VerdictSettings:
    """The four answers: none, named, ambiguous, unknown."""

    excess: float = 0.3  # sigma: below this in every channel, simulation and data agree
    size_sigmas: float = 5.0  # 1-sigma, by which held-out runs may show another size: chosen
    # share of the held-out gap that a named set has to close: right ones closed 0.998 and more
    closing: float = 0.99  # (prototype), a hard limit in place of a soft one 0.977 (own cases)
    # share by which held-out runs may show a named effect at another size
    size_tolerance: float = 0.05


@dataclasses.dataclass(frozen=True)
class ExperimentSettings:
    """The next experiment: the feasible motion of the sphere under which rivals differ most."""

    seconds: float = 5.0  # s, of a proposed run
    spin_up: float = 0.5  # s, of them until the wheels turn at speed
    times: tuple[float, ...] = (0.0, 1.2, 1.5, 2.7, 3.2, 5.0)  # s, between which a turn's speed is
    levels: tuple[float, ...] = (0.25, 0.25, 0.5, 0.5, -1.0, -1.0)  # so many times the top one
    slow_rates: tuple[float, ...] = (0.2, 0.3, 0.4)  # Hz, of turns about all axes at once
    fast_rates: tuple[float, ...] = (0.7, 0.9, 1.2)
    written: float = 0.02  # s, between the torques that are written down
    halvings: int = 4  # of a run in which a rival runs away: half as fast, or half as large


@dataclasses.dataclass(frozen=True)
class UnlistedSettings:
    """Numbers that the rig file takes for exact: whether one of them, off, closes a gap."""

    # relative 1-sigma that is granted to a number that the drawing does not leave open: three times
    # a common tolerance, for a part that is out of it is what is looked for
    sphere_inertia: float = 0.1
    sphere_mass: float = 0.1
    sphere_radius: float = 2e-3
    platform_mass: float = 0.1
    wheel_radius: float = 2e-3
    wheel_roundness: float = 0.05
    wheel_inertia: float = 0.2
    wheel_mass: float = 0.2
    step: float = 0.02  # of that, over which differences are taken
    # share of the gap that must follow to first order for a refit: time
    followed_share: float = 0.5
    refitted: int = 2  # of which the best are refitted: time


@dataclasses.dataclass(frozen=True)
class Settings:
    """All of them."""

    search: SearchSettings = SearchSettings()
    prediction: PredictionSettings = PredictionSettings()
    axis_case: AxisCaseSettings = AxisCaseSettings()
    diagnose: DiagnoseSettings = DiagnoseSettings()
    noise: NoiseSettings = NoiseSettings()
    room: RoomSettings = RoomSettings()
    calibration: CalibrationSettings = CalibrationSettings()
    candidates: CandidatesSettings = CandidatesSettings()
    doubt: DoubtSettings = DoubtSettings()
    fit: FitSettings = FitSettings()
    gauss_newton: GaussNewtonSettings = GaussNewtonSettings()
    held_out: HeldOutSettings = HeldOutSettings()
    levels: LevelsSettings = LevelsSettings()
    spectrum: SpectrumSettings = SpectrumSettings()
    limits: LimitsSettings = LimitsSettings()
    model: ModelSettings = ModelSettings()
    readings: ReadingsSettings = ReadingsSettings()
    steadiness: SteadinessSettings = SteadinessSettings()
    through_laws: ThroughLawsSettings = ThroughLawsSettings()
    valley: ValleySettings = ValleySettings()
    waves: WavesSettings = WavesSettings()
    where: WhereSettings = WhereSettings()
    clocks: ClocksSettings = ClocksSettings()
    compared: ComparedSettings = ComparedSettings()
    data_vector: DataVectorSettings = DataVectorSettings()
    encoders: EncodersSettings = EncodersSettings()
    locate: LocateSettings = LocateSettings()
    noise_model: NoiseModelSettings = NoiseModelSettings()
    rig_orders: RigOrdersSettings = RigOrdersSettings()
    outliers: OutliersSettings = OutliersSettings()
    rig_model: RigModelSettings = RigModelSettings()
    roles: RolesSettings = RolesSettings()
    smooth: SmoothSettings = SmoothSettings()
    start_angles: StartAnglesSettings = StartAnglesSettings()
    tangents: TangentsSettings = TangentsSettings()
    turning_noise: TurningNoiseSettings = TurningNoiseSettings()
    free_before: FreeBeforeSettings = FreeBeforeSettings()
    free_build: FreeBuildSettings = FreeBuildSettings()
    free_candidates: FreeCandidatesSettings = FreeCandidatesSettings()
    free_colour: FreeColourSettings = FreeColourSettings()
    free_evidence: FreeEvidenceSettings = FreeEvidenceSettings()
    free_experiment: FreeExperimentSettings = FreeExperimentSettings()
    free_floor: FreeFloorSettings = FreeFloorSettings()
    free_known: FreeKnownSettings = FreeKnownSettings()
    free_learned: FreeLearnedSettings = FreeLearnedSettings()
    free_model: FreeModelSettings = FreeModelSettings()
    free_orders: FreeOrdersSettings = FreeOrdersSettings()
    free_reopened: FreeReopenedSettings = FreeReopenedSettings()
    free_rows: FreeRowsSettings = FreeRowsSettings()
    free_sensor_noise: FreeSensorNoiseSettings = FreeSensorNoiseSettings()
    free_together: FreeTogetherSettings = FreeTogetherSettings()
    free_undecided: FreeUndecidedSettings = FreeUndecidedSettings()
    answer_learned: AnswerLearnedSettings = AnswerLearnedSettings()
    answer_result: AnswerResultSettings = AnswerResultSettings()
    rig_evidence: RigEvidenceSettings = RigEvidenceSettings()
    shown: ShownSettings = ShownSettings()
    sizes: SizesSettings = SizesSettings()
    unlisted: UnlistedSettings = UnlistedSettings()
    stretches: StretchesSettings = StretchesSettings()
    verdict: VerdictSettings = VerdictSettings()
    experiment: ExperimentSettings = ExperimentSettings()
    starts: StartsSettings = StartsSettings()
    refits: RefitsSettings = RefitsSettings()
    function_model: FunctionModelSettings = FunctionModelSettings()
    runs: RunsSettings = RunsSettings()


SETTINGS = Settings()
