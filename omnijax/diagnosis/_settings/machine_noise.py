"""The noise of a rig's data: what is whitened, and what is told beside the starts of windows."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class DataVectorSettings:
    """The data vector: whitened residual rows, and the directions that are left out of it."""

    # s after an unknown input in which the elastic channels are not used: chosen (what
    # rings at 10 Hz and more has turned three times)
    settle: float = 0.3
    shortest_window: int = 20  # samples: chosen (its start takes up most of a shorter one)


@dataclasses.dataclass(frozen=True)
class EncodersSettings:
    """What the encoders' noise leaves in dR and a: a covariance of low rank."""

    most_modes: int = 100  # a wheel; a rougher smoother's are cut off: memory
    # of the smoother, below which a mode does not count: chosen (weaker modes cost time and change
    # little)
    least_gain: float = 0.05
    parts: int = 4  # points a sample: time (a covariance needs no more)
    # change of a row's, below which it is left alone: chosen (half a per cent of a sigma)
    least_variance: float = 0.01
    spare_modes: int = 16  # beyond those that count, from which these are told: rounding


@dataclasses.dataclass(frozen=True)
class NoiseModelSettings:
    """What the noise of one channel does to the others."""

    # rad, 1-sigma of the start angle of a wheel without encoder: chosen (more leaves dR and a less
    # to say)
    start_angle: float = 0.01
    # of the readings' spread: a change over which sensors' laws count as straight: rounding
    straight_change: float = 1e-4


@dataclasses.dataclass(frozen=True)
class TurningNoiseSettings:
    """Noise of a colour in Omega and theta, told beside the free start of every window."""

    # Hz, above which a free start takes up nothing of noise: derived (a window of about 1 s)
    told_from: float = 1.0
    fewest_waves: int = 100  # that tell a level: chosen (to 7 %)
    # of a walk's power at a run's slowest wave over white noise's, and of an offset's: chosen (a
    # smaller one is not seen, a larger one hides all)
    decades: tuple[float, float] = (-1.0, 7.0)
    # of them tried: chosen (three a decade: a walk's size is then known to 20 %, as 25 waves above
    # the noise tell it)
    powers: int = 24
    # in which low-pass noise is told again beside the starts: measured (it stays then)
    low_pass_turns: int = 2
    moved_powers: int = 2  # up and down, to which one that was taken in may move at once: time
    start_weight: float = 1e-13  # at which nothing but rounding tells a start: rounding
