"""The preparation of a rig's runs: their roles, outliers, starts, and how much is compared."""

import dataclasses

from .search import SearchSettings


@dataclasses.dataclass(frozen=True)
class RunsSettings:
    """Whether a run begins in motion."""

    # over which an angle has to change by more than noise: chosen (fewer take noise for speed)
    first_samples: int = 10
    # sigma of the first speed, and times the noise of one sample: chosen (chance is beyond it once
    # in two million)
    rolling_sigmas: float = 5.0


@dataclasses.dataclass(frozen=True)
class RolesSettings:
    """Which runs teach and which confirm; one run alone plays both roles by parts."""

    block: float = 1.0  # s, of the only run that teach or confirm in turn: chosen (a window)
    # s, of such a block: own cases (seed 187; some turns of the slowest ring of a machine of 10 Hz)
    shortest_block: float = 0.25
    teaching_blocks: int = 2  # for one that confirms: chosen (fewer tell less, more confirm less)
    # below which nothing is confirmed: derived (two that confirm)
    fewest_blocks: int = 2 * (teaching_blocks + 1)


@dataclasses.dataclass(frozen=True)
class ComparedSettings:
    """How much of a run is compared."""

    told_share: float = 0.9  # of a channel's samples, below which it is told: required
    least_share: float = 0.03  # of every channel, below which nothing can be said: required


@dataclasses.dataclass(frozen=True)
class OutliersSettings:
    """Isolated samples that fit neither their neighbours nor the model: left out, and said."""

    # sigma above the samples on both sides: chosen (white noise never is)
    wild_sigmas: float = 8.0
    # sigma above them, below which one that was left out fits after all: derived (of 1e4 samples of
    # white noise 3.5 stand out so far from both of their neighbours)
    fits_sigmas: float = 4.0
    fewest_back: int = 5  # of all runs: fewer are not worth another look at all laws: time
    # sigma below what is foretold, from which a reading was cut off: convention (four are sure)
    cut_sigmas: float = SearchSettings.sure_sigmas
    # of a channel's samples, above which they are no outliers but a misfit: own cases (two per cent
    # of outliers beside a dropout)
    most_share: float = 0.06
    # beside a gap's edge, where a mistimed prediction makes spikes too: chosen (more spares
    # outliers there)
    edge_samples: int = 3
    # of the steepest slope: a larger change from sample to sample is an edge too: own cases (where
    # two rollers meet: eleven samples of a healthy run of four seconds were left out)
    kink_slope: float = 1.0
    # samples to each side whose usual change a spike has to exceed: own cases (what rings near half
    # the sampling rate; a shock's ringing has decayed)
    neighbours: int = 20
    # of two samples of white noise, in sigma: derived (2^0.5 times the normal law's quartile)
    median_difference: float = 0.954
    # times as many there as elsewhere, from which edges make them: chosen (less takes chance for
    # edges)
    edge_ratio: float = 3.0


@dataclasses.dataclass(frozen=True)
class StartAnglesSettings:
    """Where a wheel without encoder stood at the first sample, from dR and a."""

    phases: int = 28  # a pitch: chosen (Gauss-Newton steps follow)
    steps: int = 12  # of Gauss-Newton at most: time
    rounds: int = 6  # of wheel by wheel descent from the best of the coarse combinations: time
    # phases from one to the next combination that is tried: time (seven a pitch, 343 of three
    # wheels)
    coarse: int = 4
