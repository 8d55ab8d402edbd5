"""The numbers that steer the prediction of a run, each with where it comes from."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class MachineSettings:
    """How finely a run is predicted, and where its prediction starts from."""

    # resolution: what is left by each is below a tenth of the noise of the recordings in the tests
    force_points: int = 8  # forces and torques a sample; trapezoids between them
    shape_points: int = 32  # wheel shapes a sample: the gap's edges are kinks
    steps: int = 16  # steps a sample of laws at contacts and mounts, which have kinks
    coarse_steps: int = 8  # where laws are only ranked; second order: four times the error
    thin: int = 4  # force points in one of a tangent's: torques are smooth
    table_points: int = 16384  # a turn of the wheel's tables: 0.38 mrad, errors below 1e-8 m
    # fixed points
    normal_turns: int = 2  # of N and f from N at the last rebase; N changes f by some 1e-2
    rebase_turns: int = 4  # of smoothing about a prediction that hangs on the motion itself
    settled: float = 0.3  # of the noise of a rolled length: a smaller change ends those turns
    angle_turns: int = 3  # of taking the sensors' laws off measured angles, each a factor of 1e-2
    # friction near a reversal
    pull: float = 5.0  # 1/s, at which Omega is held to the measured one (see `observer`)

    # clocks of loggers: started together they are off by parts of a millisecond (issue 17: 0.7 ms)
    clock: float = 5e-4  # s, 1-sigma of an offset: chosen
    clock_most: float = 9.5e-4  # s; what is read later is a delay: below a sample at 1 kHz


SETTINGS = MachineSettings()
