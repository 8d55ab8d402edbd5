"""How a rig's run is predicted: resolution, fixed points, starts, and the smoothing of angles."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class PredictionSettings:
    """How finely a run is predicted, and where its prediction starts from.

    The prototype's numerics had to stay below a tenth of the noise: 0.65 sigma made effects of
    healthy machines.  What each resolution leaves is below that in the recordings of the tests.
    """

    # resolution
    # forces and torques a sample, with trapezoids between them: measured (below 0.1 sigma)
    force_points: int = 8
    # wheel shapes a sample, as the gap's edges are kinks: measured (below 0.1 sigma)
    shape_points: int = 32
    # of laws at contacts and mounts a sample, which have kinks: measured (below 0.1 sigma)
    steps: int = 16
    # where laws are only ranked: derived (half as many; of second order, so four times the error)
    coarse_steps: int = steps // 2
    # share of a step's last change of a tension that the next one is taken to keep at most:
    # measured (0.48 -> 0.29 sigma at the truth of contact laws, dry friction 2 -> 0.1 % off in `a`)
    kept_change: float = 0.5
    thin: int = 4  # force points in one of a tangent's: chosen (torques are smooth: two a sample)
    rates_apart: float = 1e-4  # of the largest rate: nearer ones are divided as if so far: rounding
    # a turn of the wheel's tables: measured (0.38 mrad apart, errors below 1e-8 m)
    table_points: int = 2**14

    # fixed points
    # of N and f from N at the last rebase: derived (N changes f by some 1e-2, so 1e-4 is left)
    normal_turns: int = 2
    # of smoothing about a prediction that hangs on the motion itself: prototype (three to five)
    rebase_turns: int = 4
    # of the noise of a rolled length, a change that ends those turns: chosen (a third of a sigma)
    settled_noise: float = 0.3
    angle_turns: int = 20  # at most of taking the sensors' laws off measured angles: time
    angle_noise: float = 1e-4  # rad, of an encoder, where none is measured: convention (formats)
    angle_change: float = angle_noise / 10  # rad, what ends those turns: derived (a tenth of it)
    # times the least misfit, above which such a turn runs away: chosen (less ends turns that would
    # come back)
    angle_away: float = 2.0
    angle_step: float = 3e-4  # rad (rad/s) to each side, for a reading's slope: derived (3 sigma)
    # below which a reading tells nothing of the value: chosen (a sensor at its limit has none)
    least_slope: float = 1e-3
    # moments of a run that say where a folded angle may have begun: chosen (more find it more
    # surely, and cost steps)
    begins: int = 6
    begin_turns: int = 4  # Newton steps from each: chosen (readings are straight by pieces)

    # the motion before a rolling start
    opening_samples: int = 20  # that tell it: chosen (more bends, fewer scatter)
    # of the polynomial through them: chosen (a lower one misses bends, a higher one follows noise)
    opening_degree: int = 3

    # friction near a reversal
    pull: float = 5.0  # 1/s, at which Omega is held to the measured one: chosen (see `observer`)
    # rad/s, a step that errs by more is halved: chosen (a tenth of usual noise)
    turning_error: float = 1e-5
    still_share: float = 1e-5  # of that, below which nothing swings: rounding
    # of a step, at which that ends: chosen (a stiffness of 2e5 / s at 1 kHz)
    shortest_turn: float = 1 / 64

    # of an encoder's noise, within which an angle tells no row of a dual-row wheel: own cases
    # (0.73 -> 0.17 sigma at the truth of the one draw of 65 that failed)
    row_blur: float = 5.0

    # clocks of loggers
    # s, 1-sigma of an offset: chosen (started together they are off by parts of a millisecond; the
    # issue that asked for it had 0.7 ms)
    clock_error: float = 5e-4
    # s, above which it is a delay, and no clock's: derived (below a sample at 1 kHz)
    clock_most: float = 9.5e-4

    # times the angles that Omega tells, over which tables reach: chosen (less and a wheel may leave
    # its table, more costs memory)
    wider_angles: float = 1.2
    rest_steps: int = 12  # of Newton to the static rest of laws: measured (it is found to rounding)
    # angles, at which a shape that repeats each turn is told: chosen (fewer may miss a difference)
    probes: int = 64


@dataclasses.dataclass(frozen=True)
class SmoothSettings:
    """Smoothing of measured rolled lengths: white jerk, its intensity by likelihood."""

    # of the ratio, of missing samples: rounding (keeps long gaps solvable)
    missing_weight: float = 1e-13
    decades: float = 11.0  # of the ratio above one: chosen (the likeliest lies within)
    ratios: int = 2 * int(decades) + 1  # tried: derived (two a decade)


@dataclasses.dataclass(frozen=True)
class TangentsSettings:
    """Signatures of laws that are exact to first order."""

    radius_step: float = 1e-6  # of a wheel's radius, in which shapes are smooth: rounding
    # of a wave between moments, above which its torque is taken at all fine points: chosen (more is
    # coarse, less costs time)
    wave_angle: float = 0.5
