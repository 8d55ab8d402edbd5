"""The answer: the verdict with its evidence, the learned term, and the next experiment."""

import dataclasses

from .search import SearchSettings


@dataclasses.dataclass(frozen=True)
class VerdictSettings:
    """The four answers: none, named, ambiguous, unknown."""

    # sigma: below this in every channel, simulation and data agree: prototype
    excess: float = 0.3
    # 1-sigma, by which held-out runs may show another size: chosen (chance is beyond it once in two
    # million)
    size_sigmas: float = 5.0
    # share of the held-out gap that a named set has to close: prototype (right ones closed 0.998
    # and more, wrong ones up to 0.77), own cases (a hard limit in place of a soft one: 0.977)
    closing: float = 0.99
    # share by which held-out runs may show a named effect at another size: own cases
    size_tolerance: float = 0.05
    # of what a sensor's law explains, that may be another function of what it reads: own cases (a
    # soft limit beside a hard one left 4.8 %, a right one of 250 sigma nothing)
    reading_tolerance: float = 0.02


@dataclasses.dataclass(frozen=True)
class ShownSettings:
    """The noise that the data show once all that is known is in, beside what was declared."""

    # share by which a level may be off before the search is made again: time
    search_again: float = 0.1
    # power over the noise's, by what hangs on a state: derived (the verdict's excess)
    structure_power: float = VerdictSettings.excess**2
    # share by which a level has to be off to be mended: chosen (4.5 % had made a healthy machine
    # unknown)
    level_share: float = 0.03
    # standard errors of the same: convention (four are sure)
    level_errors: float = SearchSettings.sure_sigmas
    # of them, from which a declared level is said to be another one: convention (three are told)
    told_errors: float = 3.0


@dataclasses.dataclass(frozen=True)
class StretchesSettings:
    """Stretches of a held-out run that lie farther off than any noise of their channel."""

    # samples: chosen (one or two beside each other are a shock or a bad reading)
    fewest_samples: int = 3


@dataclasses.dataclass(frozen=True)
class RigEvidenceSettings:
    """The sphere on its wheels as evidence."""

    # 1-sigma by which a clock has to be off to be spoken of: convention (four are sure)
    clock_sigmas: float = SearchSettings.sure_sigmas


@dataclasses.dataclass(frozen=True)
class AnswerResultSettings:
    """What a diagnosis returns, and the file in which it is written."""

    # times the noise, above which something else is missing too: derived (1 sigma beside it: 2^0.5)
    remaining_ratio: float = 1.4
    # prior sigmas, below which the runs have told a parameter: derived (as well as it was known:
    # 2^-0.5)
    determined_sigma: float = 0.7
    # of chi2 by the noise that is left, which one more step promises: derived (one sigma)
    unended_fall: float = 1.0


@dataclasses.dataclass(frozen=True)
class SizesSettings:
    """What the held-out runs leave unexplained at every size of a named effect."""

    # of the size in the answer, beside 0 and 1: chosen (a slider's marks)
    shares: tuple[float, ...] = (0.25, 0.5, 0.75, 1.25, 1.5)
    # of a difference, that means over blocks have to keep: chosen (longer blocks make smaller pages
    # and blur them)
    kept_power: float = 0.8


@dataclasses.dataclass(frozen=True)
class UnlistedSettings:
    """Numbers that the rig file takes for exact: whether one of them, off, closes a gap.

    The numbers of parts are the relative 1-sigma that is granted to one that the drawing does not
    leave open: three times a common tolerance, for a part that is out of it is what is looked for.
    """

    sphere_inertia: float = 0.1  # three common tolerances: chosen
    sphere_mass: float = 0.1  # three common tolerances: chosen
    sphere_radius: float = 2e-3  # three common tolerances: chosen
    platform_mass: float = 0.1  # three common tolerances: chosen
    wheel_radius: float = 2e-3  # three common tolerances: chosen
    wheel_roundness: float = 0.05  # three common tolerances: chosen
    wheel_inertia: float = 0.2  # three common tolerances: chosen
    wheel_mass: float = 0.2  # three common tolerances: chosen
    step: float = 0.02  # of that, over which differences are taken: chosen (in proportion)
    # of the gap, that must follow to first order for a refit: time
    followed_share: float = 0.5
    refitted: int = 2  # of which the best are refitted: time


@dataclasses.dataclass(frozen=True)
class ExperimentSettings:
    """The next experiment: the feasible motion of the sphere under which rivals differ most."""

    # of a proposed run: chosen (longer runs tell more and are recorded less gladly)
    seconds: float = 5.0
    # s, of them until the wheels turn at speed: chosen (a shorter one asks for more torque)
    spin_up: float = 0.5
    # s, between which a turn's speed is: chosen (three speeds, one of them reversed)
    times: tuple[float, ...] = (0.0, 1.2, 1.5, 2.7, 3.2, seconds)
    # so many times the top one: chosen (the same)
    levels: tuple[float, ...] = (0.25, 0.25, 0.5, 0.5, -1.0, -1.0)
    # Hz, about all axes at once: chosen (no two alike, so that the axis of the turn goes round)
    slow_rates: tuple[float, ...] = (0.2, 0.3, 0.4)
    fast_rates: tuple[float, ...] = (0.7, 0.9, 1.2)  # Hz, the same: chosen (the same)
    written: float = 0.02  # s, between the values that are written down: chosen (a file one reads)
    # of a run in which a rival runs away, half as fast or half as large: time
    halvings: int = 4


@dataclasses.dataclass(frozen=True)
class AnswerLearnedSettings:
    """A learned, uninterpreted term on one port, where no known effect closes the gap."""

    # RMS: beyond that a term is not followed: chosen (beyond it few rows tell a term)
    followed_to: float = 10.0
    # of the held-out gap, that the network has to add: chosen (less is not worth a network)
    network_share: float = 0.01
    round_gain: float = 1e-3  # of the misfit, that a round must take away for another: time
    rounds: int = 5  # of a refit of the term and the machine together: time
    inner: int = 5  # steps of the term in each: time
    hidden: int = 6  # nodes of the network: chosen (more follow noise)
    # times the ridge, until a step fits better: own cases (the tangents know nothing of what a term
    # feels of itself; a coupling of two contacts stopped at 0.87 of the gap)
    dampings: tuple[float, ...] = (1.0, 30.0, 1e3, 3e4, 1e6)
    # RMS of an input, to each side of 0, over which a term is drawn: chosen (most rows lie within)
    drawn_to: float = 2.5
    points: int = 101  # of a curve: chosen (a smooth line)
    grid: int = 41  # of a map, to each side: chosen (the same)
    drawn_rows: int = 4000  # that say on which inputs it hangs most: time
    mean_rows: int = 50  # of them over which a curve is a mean: time
    angle_harmonics: int = 4  # of a wheel's angle in the basis: chosen (more follow noise)
    # RMS of a command, at which functions of it bend: chosen (octaves, as a sum of two neighbours
    # bends nearly anywhere between, from a motor's dead zone to where it saturates)
    knees: tuple[float, ...] = (1 / 16, 1 / 8, 1 / 4, 1 / 2, 1.0, 2.0)
    # in a wheel's shape, beside those of its pitch: chosen (more follow noise)
    shape_harmonics: int = 8
    near_laws: int = 12  # of the library's that act there, asked how near they come: time
    nearest: int = 2  # of them drawn: chosen (a picture holds no more)
    # with what the term does, below which a law is not near: chosen (less is no likeness)
    near_cosine: float = 0.5
    # of the strongest's change, below which a part is not drawn: chosen (less is not seen beside
    # it)
    drawn_part: float = 0.1
    least_square: float = 1e-6  # of a function's beside those that are in: rounding
    # of the speed's RMS in one, how steeply the basis knows its sign: chosen (a steeper one is
    # stiff, a flatter one no sign)
    sign_sharpness: float = 20.0
    # on columns of length 1
    basis_ridge: float = 1e-6  # of the smooth basis: chosen (next to none)
    network_ridge: float = 1e-3  # of the network: chosen (less follows noise)
