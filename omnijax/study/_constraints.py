"""What a design may be held to: margins, frequencies, preload, pressure, and any metric."""

import dataclasses
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..laws import effective_modulus, effective_radius, peak_pressure
from ..rig import Rig
from ..simulation import Trajectory
from ..vibration import METRICS, SteadyRun, natural_frequencies
from ._problem import Limit


@dataclasses.dataclass(frozen=True)
class Constraint:
    """One constraint of a study: a quantity of `QUANTITIES` or a metric, and its bounds (SI)."""

    quantity: str
    low: float | None = None
    high: float | None = None
    orders: tuple[int, ...] = (1,)
    materials: tuple[float, ...] = ()  # E of sphere and wheel, Poisson's ratio of both

    @property
    def sides(self) -> tuple["Constraint", ...]:
        """The constraint with its lower bound alone, and with its upper one."""
        low = [] if self.low is None else [dataclasses.replace(self, high=None)]
        return (*low, *([] if self.high is None else [dataclasses.replace(self, low=None)]))

    @property
    def sense(self) -> int:
        """1 where one side holds values from above, -1 where it does from below."""
        return 1 if self.low is None else -1

    @property
    def text(self) -> str:
        """One side of it in words."""
        kind = QUANTITIES.get(self.quantity)
        unit = kind.unit if kind else METRICS[self.quantity].unit
        return self.limits((self.quantity,), unit, "")[0].text

    def limits(self, names: tuple[str, ...], unit: str, case: str) -> list[Limit]:
        """The limits of one side on the entries `names`, as g <= bound; g is `sense` the entry."""
        suffix = f" ({case})" if case else ""
        bound = self.high if self.low is None else self.low
        assert bound is not None
        sense = self.sense
        return [Limit(n + suffix, sense * bound, abs(bound), unit, sense) for n in names]


class CaseResult(NamedTuple):
    """What a constraint may look at: the rig, its run, and constant speeds (rad/s) if any.

    Without a run where no constraint `reads_run`.
    """

    rig: Rig
    run: SteadyRun | Trajectory | None
    speeds: Any
    model: str


class ConstraintKind(NamedTuple):
    """Unit, names of the entries, and the entries of a rig in one case; of one side each."""

    unit: str
    names: Callable[[Constraint, Rig], tuple[str, ...]]
    of: Callable[[Constraint, CaseResult], Array]
    meaning: str
    parameter: str = ""  # end of the only paths it depends on; empty: on drive and load
    reads_run: bool = False


def _per_wheel(label: str):
    return lambda wanted, rig: tuple(f"{label} of {name}" for name in rig.names)


def _separation_names(wanted: Constraint, rig: Rig) -> tuple[str, ...]:
    return tuple(
        f"separation of mode {mode + 1} from order {order}n of {name}"
        for mode in range(3 + rig.size)
        for name in rig.names
        for order in wanted.orders
    )


def _separation(wanted: Constraint, point: CaseResult) -> Array:
    """|f_mode / (h n |omega| / 2 pi) - 1| of every mode, wheel and order; a wheel at rest: none."""
    passing = point.rig.wheels.rollers * jnp.abs(point.speeds) / (2 * math.pi)
    lines = passing[:, None] * jnp.asarray(wanted.orders, float)
    moving = lines > 0
    ratio = natural_frequencies(point.rig, point.model)[:, None, None] / jnp.where(
        moving, lines, 1.0
    )
    return jnp.where(moving, jnp.abs(ratio - 1), 1e3).reshape(-1)


def _pressure(wanted: Constraint, point: CaseResult) -> Array:
    """Hertz' greatest pressure at the greatest normal force of each contact, Pa."""
    sphere, wheel, sphere_ratio, wheel_ratio = wanted.materials
    run, rig = point.run, point.rig
    assert run is not None
    steady = isinstance(run, SteadyRun)
    load = run.greatest_normal_force() if steady else jnp.max(run.normal_force, axis=0)
    radius = effective_radius(rig.sphere.radius, rig.wheel_radius)
    modulus = effective_modulus(sphere, sphere_ratio, wheel, wheel_ratio)
    return peak_pressure(load, radius, modulus)


def _preload(wanted: Constraint, point: CaseResult) -> Array:
    """The greatest preload where it is limited from above, else the least, N."""
    preload = point.rig.wheels.closure.preload
    return (jnp.min(preload) if wanted.sense < 0 else jnp.max(preload))[None]


QUANTITIES: dict[str, ConstraintKind] = {
    "preload": ConstraintKind(
        "N",
        lambda wanted, rig: ("preload",),
        _preload,
        "static normal force of the contacts",
        parameter="closure.preload",
    ),
    "patch_pressure": ConstraintKind(
        "Pa",
        _per_wheel("patch pressure"),
        _pressure,
        "greatest Hertz pressure of each contact",
        reads_run=True,
    ),
    "frequency_separation": ConstraintKind(
        "1",
        _separation_names,
        _separation,
        "relative distance of each natural frequency from the roller-passing frequencies, without "
        "laws at contacts and mounts",
    ),
}


def metrics_of(constraints: tuple[Constraint, ...]) -> tuple[str, ...]:
    """Metrics among the constraints."""
    return tuple(dict.fromkeys(c.quantity for c in constraints if c.quantity not in QUANTITIES))


def reads_runs(constraints: tuple[Constraint, ...]) -> bool:
    """Whether a constraint looks at more of a run than its metrics."""
    return any(c.quantity in QUANTITIES and QUANTITIES[c.quantity].reads_run for c in constraints)


def _sides(constraints: tuple[Constraint, ...]) -> list[Constraint]:
    return [side for wanted in constraints for side in wanted.sides]


class CaseNames(NamedTuple):
    """What the cases are called: drives first, loads second; and the paths that loads set."""

    cases: tuple[str, ...]
    loads: tuple[str, ...] = ("",)
    paths: tuple[str, ...] = ()

    def held(self, parameter: str) -> tuple[str, ...]:
        """Names of the first cases, in which what depends on `parameter` alone shows every value.

        These are all cases without `parameter`, else those of the first drive under each load, or
        one without a name where no load changes it.
        """
        if not parameter:
            return self.cases
        return self.loads if any(path.endswith(parameter) for path in self.paths) else ("",)


def all_limits(
    constraints: tuple[Constraint, ...], rig: Rig, names: CaseNames
) -> tuple[list[Limit], np.ndarray]:
    """The limits of all cases, and where they stand in the stacked `all_values` (k c,).

    What depends on one parameter alone is held once for each load that changes it.
    """
    limits_of_all, place, index = [], 0, []
    for k in range(len(names.cases)):
        for wanted in _sides(constraints):
            kind = QUANTITIES.get(wanted.quantity)
            held = names.held(kind.parameter if kind else "")
            entries = kind.names(wanted, rig) if kind else (wanted.quantity,)
            unit = kind.unit if kind else METRICS[wanted.quantity].unit
            if k < len(held):
                limits_of_all += wanted.limits(entries, unit, held[k])
                index += range(place, place + len(entries))
            place += len(entries)
    return limits_of_all, np.array(index, int)


def all_values(
    constraints: tuple[Constraint, ...], point: CaseResult, metrics: dict[str, Array]
) -> Float[Array, " c"]:
    """g of one case; `metrics` holds those that are metrics."""
    parts = []
    for wanted in _sides(constraints):
        kind = QUANTITIES.get(wanted.quantity)
        values = kind.of(wanted, point) if kind else metrics[wanted.quantity][None]
        parts.append(wanted.sense * values)
    return jnp.concatenate(parts) if parts else jnp.zeros(0)
