"""The search for what is missing: what is accepted, what is tried, and when it ends."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class SearchSettings:
    """Frozen: one object steers a diagnosis, and every model has one of its own to vary."""

    # acceptance
    # chance of a false candidate in a whole scan: prototype (13 healthy runs of 220 candidates)
    alpha: float = 1e-3
    # shuffled residuals whose best candidate is to be beaten: chosen (each costs a scan; chance
    # alone beats four of them once in five times, so `alpha` is asked too)
    shuffles: int = 4
    # standard deviations by which something is sure: here by which held-out runs confirm a change:
    # chosen (chance reaches it once in 3e4; the more, the larger an effect has to be)
    sure_sigmas: float = 4.0
    size_factor: float = 1.5  # by which a change there may be off the foretold one: own cases
    # share of it that noise may add to that factor at most: own cases
    size_noise: float = 0.15
    margin: float = 25.0  # chi2 by which an effect has to be needed, and a width: prototype
    # chi2 below which two rivals are equals: derived (the gap of two fits is normal, of mean d^2
    # and variance 4 d^2: a wrong one leads by 12 with a chance of at most Phi(-12^0.5) = 3e-4)
    equal_margin: float = 12.0
    material_change: float = 0.01  # least change of a group's RMS that is named: required
    # share of all effects' change by which its prediction may be wrong: derived (what is linear
    # between samples misses (2 pi f h)^2 / 12 of a line, of 3 Hz at 250 Hz)
    prediction_error: float = 5e-4
    # chi2 that a free number has to be worth: derived (BIC: log N of N = 1e5 samples is 11.5)
    column_price: float = 12.0

    # how far a search goes
    most_effects: int = 8  # effects that are named at once: required
    refitted: int = 4  # candidates that are refitted a step: time
    runners_up: int = 1  # first effects gone on from as well: time
    runner_up_cost: float = 3.0  # their cost, times the best one's: own cases
    near_noise: float = 1.3  # chi2 a degree of freedom at which nothing else is tried first: time
    hopeless_cost: float = 3.0  # times the best trial's cost: three rounds are enough: time
    noise_share: float = 0.005  # of a gap, that counts as wrongly assumed noise: own cases
    # share of the cost by which a runner-up's way must be better: chosen (0: the better one wins)
    runner_up_lead: float = 0.0

    # strong effects
    strong_misfit: float = 4.0  # chi2 a degree of freedom from which no tangent ranks: own cases
    # finite strengths tried, in those whose tangent is as large as the residual: own cases
    strengths: tuple[float, ...] = (0.2, 0.6, 2.0)
    bent_sigmas: float = 2.0  # prior sigmas from which a calibration was bent: own cases
    # whether finite strengths are tried about the calibrated machine then too: own cases (machines
    # that are run freely set it)
    both_anchors: bool = False
    promise_share: float = 0.2  # of the best promise, below which nothing is refitted: time
    # share of a strong gap that a law must close: own cases (what none does is unknown at once)
    least_closed: float = 0.02
    # share of what a part of the channels shows of a strong gap, from which a law that closes
    # nothing elsewhere is refitted: own cases
    part_closed: float = 0.9
    # share of a gap that a law closes which is confirmed later, or, where the gap is strong, earns
    # a new budget: own cases (overlapping effects, that held-out runs refuse one by one)
    trusted_closed: float = 0.5
    # shares of the motion that a strong law is refitted to first: own cases (laws of contacts and
    # mounts)
    openings: tuple[float, ...] = (0.1, 0.2, 0.35, 0.6)
    opening_closed: float = 0.2  # share of an opening's gap to be followed further: own cases

    # calibration
    # share of parameters at their bounds that no missing effect bends: own cases (a resonance
    # beside a line of the excitation)
    caught_share: float = 0.2
    restarts: int = 3  # other starts of one that is caught: time

    # refits and rivals
    settle_rounds: int = 5  # of smoothing anew at most: own cases (runs that begin rolling)
    settled_misfit: float = 1.02  # chi2 a row at which they end: own cases (the same)
    # margin by tangent below which a rival is refitted, four of those that it needs: chosen (more
    # of them cost refits, fewer trust tangents)
    near_margin: float = 4 * margin
    like_gain: float = 0.9  # share of an effect's gain from which a rival is refitted: own cases
    like_rivals: int = 4  # of those: time
    most_rivals: int = 8  # candidates looked at as rivals: time
    swaps: int = 3  # times an effect may give way to a rival: time
    # times the cost: a rival above it after one round imitates nothing: time
    far_cost: float = 10.0

    # standard deviations of chi2 within which what is left is noise: convention (as `sure_sigmas`)
    noise_sigmas: float = sure_sigmas
    shown_most: int = 12  # of what stands out, in answers: chosen (the length of a table)
