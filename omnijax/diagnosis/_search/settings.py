"""The numbers that steer a search, in one place, each with where it comes from.

"prototype" is a first program that knew the truth of the twelve public recordings; "own cases" are
misses of `benchmarks/hidden_effects` with seeds below 100, which are for work; "derived" follows
from the statement beside it.
"""

import dataclasses


@dataclasses.dataclass(frozen=True)
class SearchSettings:
    """Frozen: one object steers a diagnosis."""

    # acceptance
    alpha: float = 1e-3  # chance of a false candidate in a whole scan: chosen
    shuffles: int = 4  # shuffled residuals whose best candidate is to be beaten: chosen
    sure: float = 4.0  # standard deviations by which held-out runs confirm a change: chosen
    share: float = 1.5  # factor by which a change there may be off the foretold one: own cases
    margin: float = 25.0  # chi2 by which an effect has to be needed, and a width: prototype
    equal: float = 12.0  # below it two rivals are equals; a wrong one leads by it by chance at most
    # 3e-4 of the time: derived (the gap of two fits is normal, of mean d^2 and variance 4 d^2)
    material: float = 0.01  # least change of a group's RMS that is named: required of the project
    exact: float = (
        5e-4  # share of all effects' change by which its prediction may be wrong: what is
    )
    # linear between samples misses (2 pi f h)^2 / 12 of a line, 3 Hz at 250 Hz: derived
    price: float = 12.0  # half of log N a column, N = 1e5 samples: derived (BIC)
    # how far a search goes
    most: int = 8  # effects: required of the project
    tried: int = 4  # candidates that are refitted a step: time
    runners_up: int = 1  # first effects gone on from as well: time
    close: float = 3.0  # their cost, times the best one's: own cases
    nearly: float = 1.3  # chi2 a degree of freedom at which nothing else is tried first: time
    hopeless: float = 3.0  # times the best trial's cost: three rounds are enough: time
    rest: float = 0.005  # share of a gap that counts as wrongly assumed noise: own cases
    lead: float = 0.0  # share of the cost by which a runner-up's way must be better: chosen
    # strong effects
    strong: float = 4.0  # chi2 a degree of freedom from which tangents do not rank: own cases
    ladder: tuple[float, ...] = (0.2, 0.6, 2.0)  # finite strengths tried: own cases
    ran_off: float = 2.0  # prior sigmas from which a calibration was bent: own cases
    both: bool = (
        False  # then finite strengths are tried about the calibrated machine too: own cases
    )
    worth: float = 0.2  # share of the best promise below which nothing is refitted: time
    little: float = 0.02  # share of a strong gap that a law must close: own cases
    openings: tuple[float, ...] = (0.1, 0.2, 0.35, 0.6)  # shares of the motion: own cases
    promise: float = 0.2  # share of an opening's gap to be followed further: own cases
    # calibration
    caught: float = 0.2  # share of parameters at their bounds that no effect bends: own cases
    restarts: int = 3  # other starts of one that is caught: time
    # refits and rivals
    settles: int = 5  # rounds of smoothing anew at most: own cases
    settled: float = 1.02  # chi2 a row at which they end: own cases
    near: float = 100.0  # margin by tangent below which a rival is refitted: 4 margins
    like: float = 0.9  # share of an effect's gain from which a rival is: own cases
    few: int = 4  # of those: time
    rivals: int = 8  # candidates looked at as rivals: time
    swaps: int = 3  # times an effect may give way to a rival: time
    far: float = 10.0  # times the cost: a rival above it after one round imitates nothing: time


SETTINGS = SearchSettings()
