"""What is left: its noise and the colour of it, what it hangs on, and what the runs exclude."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class LevelsSettings:
    """The level of the white part of a channel, by differences in short windows."""

    # orders of differences: prototype (third ones were right to 7 %), chosen (higher ones leave
    # less of a fast motion)
    differences: tuple[int, ...] = (3, 5, 7)
    # samples of one window: chosen (shorter ones scatter more, longer ones hold more bursts)
    window: int = 64
    # of a colour's gain in white noise, below which it is one: chosen (many channels are asked in
    # every diagnosis; more whitens white noise, less leaves slow noise white)
    colour_chance: float = 1e-5
    # ratio of powers below which a spectrum that is not flat is weighed as white: chosen (so little
    # moves a sigma by some 10 %)
    flat_ratio: float = 1.25
    fewest_windows: int = 4  # of which a median is taken: chosen (fewer make no median)
    # of a sampling step, within which runs show one colour together: chosen (clocks differ by less)
    step_tolerance: float = 0.01
    median_scatter: float = 1.25  # over that of a mean: derived (sqrt(pi / 2))
    # times its level, by which a higher difference has to be below a lower one: chosen (the scatter
    # of a level by some windows)
    lower_level: float = 1.1
    # degrees of freedom of a coloured level at least: chosen (it is known to a half then)
    least_freedom: float = 4.0


@dataclasses.dataclass(frozen=True)
class SpectrumSettings:
    """The spectrum of noise by waves of half periods, and which colour the data show."""

    # cycles a sample, from which a spectrum is its white end: chosen (half of it)
    white_from: float = 0.25
    bin_width: float = 1.35  # end over begin: chosen (some seven bins a decade)
    bin_waves: int = 16  # of each run in a bin at least: chosen (tell its power to 35 %)
    # of a walk's and of low-pass noise's power over white noise's: chosen (from what no run shows
    # to what hides a channel)
    decades: tuple[float, float] = (-4.0, 9.0)
    # of them tried: derived (three a decade)
    powers: int = 3 * int(decades[1] - decades[0]) + 1
    # times the slowest wave, the slowest corner that is no walk's: chosen (a slower one is like a
    # walk)
    slowest_corner: float = 10.0
    corners: int = 10  # tried, from there to the fastest wave: time
    merged_waves: float = 1.05  # waves within this factor are one bin: time
    # run lengths for which a walk had gone on before a recording: chosen (so many that the mean of
    # a run tells nothing)
    walk_before: float = 1e5


@dataclasses.dataclass(frozen=True)
class WhereSettings:
    """Where a gap is: on which lines, orders, states and readings what is left hangs."""

    shuffles: int = 60  # that tell mean and spread of what chance shows: time
    # false discoveries that are accepted: chosen (1 %; more tells places that are chance, less
    # hides weak ones)
    discovery_rate: float = 0.01
    # of those asked of every wheel: chosen (higher ones are those of the fine scan)
    highest_order: int = 40
    # bands on either side that a line is compared with: chosen (more tell a level better, but less
    # near)
    neighbours: int = 8
    band_width: float = 0.5  # Hz: chosen (a line that stays put stays in its band)
    # length that a column of length 1 must keep once line and mean are taken off: rounding
    least_column: float = 1e-4
    bins: int = 12  # of a state, equally filled: chosen (finer ones scatter more)
    # samples of a shuffled block, or a share of a short run: chosen (longer than the noise
    # remembers)
    block_samples: int = 125
    fewest_blocks: int = 16  # of a short run: chosen (fewer have few orders)
    shortest_block: int = 4  # samples: chosen (a shorter one loses the colour)
    # at each end, by whose means a straight line is taken off: chosen (noise stays out of it)
    end_samples: int = 50
    # of so many parts of a run an end is one at most: chosen (a short run keeps its middle)
    end_parts: int = 10
    least_shape: float = 1e-3  # of the beta law of shuffled shares: rounding
    unsure_shown: int = 3  # where nothing stands: chosen (the length of a table)
    # of the largest miss in sigma, of the channels that these are sought in: own cases (a page said
    # that nothing stands out, beside a theta that was missed by 160 sigma)
    missed_share: float = 0.5
    rounding: float = 1e-6  # sigma, of a channel that nobody measured, or that is met: rounding


@dataclasses.dataclass(frozen=True)
class ReadingsSettings:
    """Whether what is left of a channel hangs on its own reading."""

    # equally filled stretches of the reading, with a straight line in each: derived (as states)
    knots: int = WhereSettings.bins
    least_direction: float = 1e-6  # of the longest: rounding


@dataclasses.dataclass(frozen=True)
class SteadinessSettings:
    """Whether effects are as strong at all times and in all runs: asked of all runs at once."""

    # of the course over a run: own cases (a motor whose gain falls as it warms; of what warms
    # within a third of a run 2 % are left)
    degree: int = 3
    # of a part that is not constant: derived (five standard deviations, as `verdict.size_sigmas`)
    chance: float = 5.7e-7
    # of a change's length, below which a direction of its course is none: chosen (a shorter one is
    # the prediction's error)
    least_direction: float = 1e-3


@dataclasses.dataclass(frozen=True)
class LimitsSettings:
    """What the runs exclude: an upper limit for every effect that was not named."""

    # of strengths with several columns: chosen (the limit is then known to 3 %)
    draws: int = 400
    # of a law that is a share, as a gain: derived (all of it; a limit above says nothing)
    most_share: float = 1.0
