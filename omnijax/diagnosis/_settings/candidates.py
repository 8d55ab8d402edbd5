"""What is tried: the candidates of a rig, and where joint refits begin."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class CandidatesSettings:
    """Numbers of laws that are no strengths: a scan tries them, a refit moves them."""

    # RMS deflections of a mount: prototype (0.5 to 2.5), chosen (the others)
    plays: tuple[float, ...] = (0.3, 0.5, 1.0, 1.5, 2.5, 4.0, 7.0)
    # shares of the largest torque: chosen (`starts.halvings` looks between them)
    torque_limits: tuple[float, ...] = (0.97, 0.9, 0.75, 0.5)
    # s: prototype (the first four), chosen (two octaves more)
    delays: tuple[float, ...] = (0.001, 0.002, 0.004, 0.008, 0.016, 0.032)
    # s: chosen (three times the longest that is tried; more asks for a longer past of a run)
    longest_delay: float = 0.1
    least_play: float = 1e-4  # RMS deflections of a mount: chosen (a smaller one moves nothing)
    # plays far below a deflection, by their tangent: own cases (one of 1.1 sigma had been named
    # mount-cubic)
    small_plays: tuple[float, ...] = (0.01, 0.05)
    # s: prototype (four of them)
    relaxation: tuple[float, ...] = (0.003, 0.01, 0.03, 0.1)
    # of the wheels' RMS speed, where friction falls: chosen (what 0.1 to 3 rad/s had been in
    # machines of 7 rad/s; as such speeds they hardly covered fast wheels)
    stribeck: tuple[float, ...] = (0.015, 0.05, 0.15, 0.5)
    # SI, of a constant of a user's law without range: chosen (two a decade)
    any_values: tuple[float, ...] = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0)
    values_between: int = 4  # tried between a shape constant's bounds: time
    # of the way to a law without strength, that its tangent has to ask for at least: chosen (less
    # is noise, more leaves weak laws out)
    least_share: float = 0.05
    whole_orders: int = 24  # that are tried whatever stands out: prototype
    # of an order, by which one that stands out is no whole one: chosen (a nearer one is tried)
    order_apart: float = 0.05
    least_time: float = 1e-6  # s, of a time that is fitted: rounding


@dataclasses.dataclass(frozen=True)
class StartsSettings:
    """Where joint refits begin: by tangent, or at finite strength where effects are strong."""

    equal_gain: float = 0.97  # share of the best line's gain from which others are refitted: time
    # so many more: own cases (eight orders of a short travel lie within `equal_gain`, the right one
    # was not among three)
    other_lines: int = 7
    # share of the best refit's gain from which the others of a name are refitted: time
    name_gain: float = 0.9
    together: int = 8  # sets of lines of one name that are refitted: time
    # errors of what held-out runs show of a line, up to which it is as foretold: chosen (a wrong
    # order passes it as often as three sigma say)
    as_foretold: float = 3.0
    # of the distance between limits or times that are tried: time (3 leave a tenth of it)
    halvings: int = 3


@dataclasses.dataclass(frozen=True)
class ThroughLawsSettings:
    """Signatures beside laws that are stepped in time, by differences."""

    most_columns: int = 32  # each is a run: time
    variants: int = 4  # of one law at one place: time


@dataclasses.dataclass(frozen=True)
class FunctionModelSettings:
    """A model of the user's own: the strength at which a law's tangent is taken."""

    least_change: float = 1e-7  # of the residual: rounding
    # of it, a change that is still in proportion: chosen (a bent law errs by as much)
    most_change: float = 1e-3
    weaker: float = 0.1  # times the strength, where it changes more: time
    stronger: float = 30.0  # where it changes less: time
    # strengths, down to 1e-60 and up to 1e88: time (a law that has none in proportion is dead)
    most_strengths: int = 60
