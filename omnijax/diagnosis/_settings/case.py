"""Cases: the noise of their channels, what they need, and what is judged around the search."""

import dataclasses

from .fits import RefitsSettings
from .gaps import LevelsSettings
from .search import SearchSettings


@dataclasses.dataclass(frozen=True)
class AxisCaseSettings:
    """`diagnose` of an axis or of a machine of the user's."""

    skipped_samples: int = 20  # of a free run's figure: convention (the benchmark of EMPS)
    hold_steps: int = 4  # of the refit by which a log's hold is judged once more: time
    relative: float = RefitsSettings.relative  # of the cost, below whose fall it ends: time


@dataclasses.dataclass(frozen=True)
class DiagnoseSettings:
    """`diagnose`: a case in, a verdict with its evidence out."""

    # s, after which Omega and the rolled lengths of a rig start anew: prototype (the margin of a
    # dry friction against rolling is 916 at 0.1 s and 1.6e5 at 1 s; slow errors stay out)
    window: float = 1.0
    # RMS of a channel over its white part, below which all of it is noise: chosen (more takes gaps
    # for noise, less takes noise of a colour for gaps)
    white_ratio: float = 1.25
    # 1-sigma of a measured level, up to which the model may show more: convention (four are sure)
    level_errors: float = SearchSettings.sure_sigmas
    # share of the level that is allowed beside those: chosen (levels of runs are not quite alike)
    level_share: float = 0.05
    # factor over a declared or assumed level, up to which the model may show: chosen (a data sheet
    # is right "to some ten per cent, sometimes to a factor", say the formats)
    assumed_factor: float = 2.0


@dataclasses.dataclass(frozen=True)
class NoiseSettings:
    """The noise of a channel before anything is fitted: declared, measured, or guessed."""

    declared_error: float = 0.3  # relative 1-sigma of a declared noise: chosen (the same words)
    # standard errors within which a declaration is kept as it is: convention (four are sure)
    agreed_errors: float = SearchSettings.sure_sigmas
    # relative 1-sigma of a noise of which nothing is known but a bound: chosen (all of it)
    unknown_error: float = 1.0
    # steps of a quantised channel, in sigma, below which they are part of the noise: chosen (they
    # add step^2 / 12 to its power, 0.4 % to its level)
    finest_step: float = 0.3
    # order of differences that leave of a motion its noise: derived (the highest of those tried)
    difference: int = LevelsSettings.differences[-1]
    # of a channel's RMS, where they leave nothing: chosen (an upper bound)
    guessed_share: float = 1e-3
    fewest_levels: int = 3  # of a quantised channel: derived (two gaps, to be compared)
    rounding_gap: float = 1e-3  # of the usual gap between levels, below which it is none: rounding
    # of a step, by which a gap may be off a whole number of them: chosen (written digits round it)
    grid_error: float = 0.02
    grid_share: float = 0.95  # of the gaps, that must be such numbers: chosen (digits get lost)
    # 1-sigma of channels without noise over their RMS, whose fits err by a tenth of it
    free_elastic: float = 0.02  # dR and a: measured (the fit's own numerics are a tenth of it)
    free_turning: float = 2e-4  # Omega: measured (the same)
    free_angle: float = 3e-6  # theta: measured (the same)


@dataclasses.dataclass(frozen=True)
class RoomSettings:
    """What a case needs of memory and samples."""

    # samples that a period of the slowest mode, at which the sphere shakes, must keep: chosen
    # (thinned further a run loses what is asked of it)
    period_samples: int = 10
    fewest_samples: int = 100  # of a run: chosen (fewer tell nothing of a machine's frequencies)
    deflection: float = 1e-6  # m: chosen (any will do: the candidates' number does not hang on it)
