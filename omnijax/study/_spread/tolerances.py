"""`tolerances`: how far the parts of each wheel may be off while the vibration stays below a limit.

To first order f = f0 + sum g_p d_p with d_p the relative deviation of a part.  Uniform deviations
within +-t_p add a variance of sum (g_p t_p)^2/3; the parts get equal shares of what the limit
leaves, g_p t_p equal, capped at the widest tolerance.  Where curvature spoils this, all tolerances
shrink until enough drawn machines stay below the limit, by the lower 95 % bound of their share.
New machines, drawn after the tolerances are set, then say what share these keep.
"""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from scipy.special import ndtri

from ..._arrays import largest
from ..._compiling import quick_jit
from ..._errors import InputError, RunError
from ..._text import quantity_text, split_names
from ...rig import Rig, parameter_info
from ...vibration import METRICS
from .._batches import each
from .._design import RigCases
from .._file import Study, reach, study_of
from .._parameters import checked_parameters, values_of
from .._study_folder import Report, folder_of
from .draws import Machines
from .tolerance_result import WIDEST, Tolerances

DRAWS, LEAST = 1024, 64
SIGMAS = 1.96  # 95 % on both sides
SHRINKS = 40  # down to 5 % of what the derivatives allow
PARTS = ("wheel.radius", "wheel.roundness", "contact.stiffness", "contact.damping",
         "mount.stiffness", "mount.damping", "closure.stiffness")  # fmt: skip


def share_bounds(good: int, total: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share."""
    from scipy.stats import binomtest

    interval = binomtest(good, total).proportion_ci(0.95, "wilson")
    return float(interval.low), float(interval.high)


def allocate(
    slopes: np.ndarray, room: float, confidence: float, widest: np.ndarray | float = WIDEST
) -> np.ndarray:
    """Relative half widths that use up `room`, to first order, at equal shares of the variance.

    z sqrt(sum (g t)^2/3) = room with z the confidence's quantile; capped parts leave theirs to the
    others.
    """
    spread = np.sqrt(3.0) * room / ndtri(confidence)
    widest = np.broadcast_to(widest, slopes.shape)
    width, open_ = widest.copy(), np.abs(slopes) > 0
    for _ in range(len(slopes)):
        used = np.sum((slopes[~open_] * width[~open_]) ** 2)
        if used >= spread**2 or not open_.any():
            break
        each = np.sqrt((spread**2 - used) / open_.sum())
        fair = each / np.abs(np.where(open_, slopes, np.inf))
        over = open_ & (fair > widest)
        if not over.any():
            width[open_] = fair[open_]
            break
        open_ &= ~over
    return width


def tolerances(
    study: str | Path | Mapping | Study,
    *,
    parts: Sequence[str] | str = (),
    draws: int = DRAWS,
    out: str | Path | None = None,
    resume: bool = False,
    report: Report | None = None,
) -> Tolerances:
    """Tolerances of each wheel's parts that keep a metric below `[limit]`: `max`, or a `rise`.

    The parts are `parts` (a list, or text with commas between), or those of `[tolerance]`, or all
    of `PARTS` that are not 0; deviations are independent and uniform. Over several cases the metric
    is its worst.  With `out` finished chunks of machines are stored there, which `resume` takes up.

    Widths are relative, figures SI.  Raises `InputError` for a wrong study and for one without
    `[limit]`, `RunError` where the nominal machine is above it.

    Source: first-order propagation with equal shares, then drawn machines.
    """
    asked = study_of(study)
    if asked.limit is None:
        raise InputError("tolerances need a [limit] with `metric` and `max` or `rise`.")
    _check(draws, asked.confidence)
    metric, limit, rise = asked.limit
    chosen = (
        tuple(split_names(parts) if parts else ())
        or tuple(p for p, _ in asked.tolerances)
        or usual_parts(asked.rig)
    )
    plain = dataclasses.replace(
        asked, variables=(), constraints=(), tolerances=tuple((p, 1.0) for p in chosen)
    )
    cases = RigCases(plain, (metric,))
    store = folder_of(out, plain.identity("tolerances", machines=draws), resume)

    machines = Machines(*_worst(cases, draws), len(cases.parts), draws, store, report)
    nominal, slopes = machines.slopes()
    limit = (1 + (rise or 0.0)) * nominal if limit is None else limit
    if not nominal < limit:
        unit = METRICS[metric].unit
        raise RunError(
            f"no tolerance keeps {metric} below {quantity_text(limit, unit)}: with nominal parts "
            f"it is {quantity_text(nominal, unit)} already."
        )
    linear = allocate(slopes, limit - nominal, asked.confidence, _widest(cases))
    fresh = asked.seed + 1
    width = _borne_out(machines, linear, asked, limit)
    new = machines.metric(width, fresh, "new", 1)
    untouched = machines.metric(linear, fresh, "linear", 0)
    good = int(np.sum(new < limit))
    low, high = share_bounds(good, draws)
    values = np.array(values_of(asked.rig, cases.parts))
    units = tuple(parameter_info(asked.rig, part).unit for part in cases.parts)
    return Tolerances(
        metric, METRICS[metric].unit, limit, nominal, asked.confidence, cases.parts, values, units,
        slopes, linear, width, good / draws, low, high, float(np.mean(untouched < limit)), draws,
        int(np.sum(~np.isfinite(new))),
    )  # fmt: skip


def _worst(cases: RigCases, draws: int) -> tuple[Callable, Callable]:
    """The metric's worst over the cases: of machines (n, p), and with its slope by a part."""
    size = len(cases.parts)
    if cases.in_bulk is None:

        def worst(deviation):
            return largest(cases.every(jnp.zeros(0), deviation[None])[0])

        slope = quick_jit(lambda push: jax.jvp(worst, (jnp.zeros(size),), (push,)))
        several = quick_jit(lambda rows: each(worst, [rows], cases.how.order))
        return several, lambda part: slope(np.eye(size)[part])

    def machines(deviations: np.ndarray) -> np.ndarray:
        no_variables = np.zeros((len(deviations), 0))
        return cases.many(no_variables, deviations, total=draws)[0].max(axis=(1, 2))

    @functools.cache
    def nominal() -> tuple[float, np.ndarray]:
        values, slopes = cases.many(np.zeros((1, 0)), np.zeros((1, size)), gradient=True)
        worst = np.argmax(values[0, :, 0])
        return values[0, worst, 0], slopes[0, worst, 0, -size:]

    def with_slope(part: int):
        value, slopes = nominal()
        return value, slopes[part]

    return machines, with_slope


def _widest(cases: RigCases) -> np.ndarray:
    """`WIDEST` of each part, or what keeps it within its parameter's range under every load."""
    rig, reached = cases.study.rig, reach(cases.study.rig, (), cases.study.loads)
    room = []
    for part, own in zip(cases.parts, values_of(rig, cases.parts), strict=True):
        highest, info = reached.get(part, (own, own))[1], parameter_info(rig, part)
        room.append(info.high / highest - 1 if highest > 0 else WIDEST)
    return np.minimum(WIDEST, np.array(room))


def usual_parts(rig: Rig) -> tuple[str, ...]:
    """`PARTS` of every wheel, less those that are 0."""
    paths = checked_parameters(rig, PARTS)
    return tuple(p for p, v in zip(paths, values_of(rig, paths), strict=True) if v != 0)


def _check(draws: int, confidence: float) -> None:
    """`InputError` where so few machines could not show the share asked for, however good."""
    least = max(LEAST, int(np.ceil(SIGMAS**2 * confidence / (1 - confidence))))
    if draws < least:
        raise InputError(
            f"`draws` must be at least {least} for a confidence of {confidence:g}, but is {draws}."
        )


def _borne_out(machines: Machines, linear: np.ndarray, asked: Study, limit: float) -> np.ndarray:
    """Half widths, from `linear` down, at which enough machines stay below the limit."""
    width = linear
    for i in range(SHRINKS):
        good = int(np.sum(machines.metric(width, asked.seed, f"round-{i}", 2) < limit))
        if share_bounds(good, machines.draws)[0] >= asked.confidence:
            break
        width = 0.93 * width
    return width
