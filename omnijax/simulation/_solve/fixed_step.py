"""`simulate_many`: torque-driven runs of many rigs at one fixed step, for sweeps.

Both methods are of order 4 and see the wheels' shapes as `passage` says.  The classical
Runge-Kutta method takes some 0.7 radians of the fastest mode a step; the exponential one as long a
step as what is not linear allows, each for some eight of the former.
"""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, Int

from ..._compiling import Effort
from ..._errors import InputError
from ..._programs import kept
from ..._status import Status
from ...dynamics import Model, linear_system, position_input, torque_driven
from ...rig import Rig
from .._batch_last import side_by_side
from .._channels import trajectory
from .._commands import torque_inputs
from .._drives import TorqueDrive, as_times, check_drive
from .._one_kernel import is_asked
from .._trajectory import Trajectory
from . import exponential_step as exponential
from .passage import Passage, StepGrid, shapes_ahead
from .state_vector import (
    build_model,
    initial_state,
    initial_state_like,
    pack,
    state_scale,
    unpack,
    vector_field,
)

RUNGE_KUTTA, EXPONENTIAL = "runge-kutta", "exponential"
METHODS = (RUNGE_KUTTA, EXPONENTIAL)
GRIDS = {RUNGE_KUTTA: StepGrid.of(1, 6), EXPONENTIAL: exponential.GRID}
SOFT = 8.0  # radians of the fastest mode from sample to sample, up to which Runge-Kutta costs less
RADIANS = 1.0  # of the fastest mode a step, up to which Runge-Kutta is as exact as the other


def fixed_methods(rigs: Sequence[Rig], step: float, model: str = "coupled") -> tuple[str, ...]:
    """Methods for samples every `step` s, the one that promises to cost less first."""
    soft = all(_fastest(_matrix(rig, model)) * step <= SOFT for rig in rigs)
    return METHODS if soft else (EXPONENTIAL,)


def _fastest(A: Float[Array, "*b m m"]) -> float:
    """Largest eigenvalue in size, 1/s; inf where the numbers are unknown."""
    return np.inf if isinstance(A, Tracer) else np.abs(np.linalg.eigvals(np.asarray(A))).max()


@eqx.filter_jit
def _matrix(rig: Rig, model: str) -> Float[Array, "m m"]:
    return linear_system(build_model(rig, model).translation).A


# of the stages: time, in half steps; weight of the rate in the state a step later, and in what a
# cubic's middle is beside the mean of its ends
_STAGES = (
    np.array([0, 1, 1, 2]),
    np.array([1, 2, 2, 1]) / 6,
    np.array([1, 0, 0, -1]) / 8,
)


def _runge_kutta(field, h, t, y):
    """(state half a step later, state a step later, rate there): classical, cubic in between."""

    def stage(carry, row):
        rate, end, bend = carry
        i, weight, bent = row
        later = h * i / 2
        rate = field(t + later, y + later * rate, i)
        return (rate, end + h * weight * rate, bend + h * bent * rate), None

    none, apart = jnp.zeros_like(y), not is_asked()  # without kernels a loop waits for each
    (rate, end, bend), _ = jax.lax.scan(stage, (none, y, none), _STAGES, unroll=apart)
    return (y + end) / 2 + bend, end, rate


class Stepper(eqx.Module):
    """Steps of one rig under one drive, all of one size; the state in units of `scale`."""

    model: Model
    drive: TorqueDrive
    start: Any  # s, of the run
    scale: Float[Array, " s"] | float
    step: Any  # s
    tables: exponential.StepTables | None  # none: by Runge-Kutta

    @classmethod
    def of(cls, model: Model, drive: TorqueDrive, start, step, method: str) -> "Stepper":
        """That of one of `METHODS`."""
        if method == RUNGE_KUTTA:  # its steps are the same in all units
            return cls(model, drive, start, 1.0, step, None)
        scale = ravel_pytree(state_scale(model))[0]
        return cls(model, drive, start, scale, step, exponential.step_tables(model, scale, step))

    @property
    def _grid(self) -> StepGrid:
        return GRIDS[RUNGE_KUTTA if self.tables is None else EXPONENTIAL]

    def begun(self):
        """What the first step begins with: state, dOmega/dt, shapes ahead."""
        state = initial_state(self.model, self.drive, self.start)
        rate = vector_field(self.start, state, (self.model, self.drive, self.start))
        return self._next(pack(self.model, state, self.scale), state, rate.angular_velocity)

    def _next(self, y, state, turning):
        return y, turning, shapes_ahead(self._grid, self.model.rig, state, turning, self.step)

    def __call__(self, t, carry):
        """The state half a step later, and what the next step begins with."""
        y, turning, ahead = carry
        model, scale, h = self.model, self.scale, self.step
        shapes = ravel_pytree(initial_state_like(model))[1]
        passage = Passage.over(self._grid, model.rig, shapes(y * scale), turning, ahead, h)

        seen = passage.at if self.tables is None else passage.without_shape

        def field(t, y, i):
            state = unpack(model, y, scale)
            inputs = torque_inputs(model.rig, self.drive, t, self.start)
            rate = torque_driven(model, state, inputs, seen(i))
            return ravel_pytree(rate._replace(position=state.drift))[0] / scale

        def shape(y):
            state = shapes(y * scale)
            return position_input(model.rig, state.angle, state.attitude)

        if self.tables is None:
            halfway, y, rate = _runge_kutta(field, h, t, y)
        else:
            halfway, y, rest = exponential.exponential_step(
                field, shape, self.tables, passage.fit, h, t, y
            )
            rate = jnp.concatenate([jnp.zeros(len(y) - len(rest)), rest])
        turning = shapes(rate * scale).angular_velocity
        return halfway, self._next(y, shapes(y * scale), turning)


def simulate_fixed(
    rig: Rig,
    drive: TorqueDrive,
    ts,
    model: str = "coupled",
    substeps: int | Int[Array, ""] = 1,
    method: str = EXPONENTIAL,
) -> Trajectory:
    """One rig's run by fixed steps, `substeps` of them for two samples of the even `ts`."""
    built = build_model(rig, model)
    pairs = len(ts) // 2  # one step passes two samples
    h = 2 * (ts[-1] - ts[0]) / ((len(ts) - 1) * substeps)
    step = Stepper.of(built, drive, ts[0], h, method)
    first = step.begun()

    def pair(carry, t):
        def one(i, reached):
            mid, carry = step(t + i * h, reached[0])
            halfway = jnp.where(2 * i + 1 == substeps, mid, reached[1])
            return carry, jnp.where(2 * i + 2 == substeps, carry[0], halfway)

        carry, halfway = jax.lax.fori_loop(0, substeps, one, (carry, carry[0]))
        return carry, jnp.stack([halfway, carry[0]])

    _, ys = jax.lax.scan(pair, first, ts[0] + substeps * h * jnp.arange(pairs))
    ys = jnp.concatenate([first[0][None], ys.reshape(2 * pairs, -1)])[: len(ts)]
    states = jax.vmap(lambda y: unpack(built, y, step.scale))(ys)
    steps = jnp.asarray(pairs * substeps)
    return trajectory(built, drive, ts, states, Status.OK, steps, f"fixed {method}")


def simulate_many(
    rigs: Rig,
    drive: TorqueDrive,
    ts: Float[Array | np.ndarray, " t"],
    *,
    model: str = "coupled",
    substeps: int | Int[Array, ""] = 1,
    method: str = "auto",
) -> Trajectory:
    """Trajectories of `rigs` (every leaf with a leading axis) under one torque drive.

    Rigs are such as `jax.vmap` makes them.  `ts` are evenly spaced; `substeps` steps pass two
    samples.  Errors are not controlled: compare with twice the substeps, or with `simulate` on one
    rig.  Under `jax.jit` only those channels cost anything that are used.

    `method` is `exponential`, `runge-kutta` (a third of the time a step and less, for steps of a
    radian of the fastest mode at most), or `auto`: the latter where the steps are as short, as far
    as the rigs' numbers are known (they are not under `jax.jit`).

    Arrays (rigs, samples, ...) in SI: `evaluate` takes them inside `jax.vmap`.  Raises `InputError`
    for input that does not fit; nothing for a run that diverges: its status is non-finite.

    Source: as `simulate`; Krogstad, J. Comput. Phys. 203 (2005).
    """
    if method not in ("auto", *METHODS):
        raise InputError(f"`method` must be one of {['auto', *METHODS]}, but is {method!r}.")
    ts = as_times(ts)
    _check_batch(rigs, drive, ts, substeps)
    if method == "auto":
        unknown = any(isinstance(x, Tracer) for x in (ts, substeps))
        radians = (
            np.inf
            if unknown
            else _fastest(_matrices(rigs, model)) * 2 * np.ptp(np.asarray(ts)[:2]) / int(substeps)
        )
        method = RUNGE_KUTTA if radians <= RADIANS else EXPONENTIAL
    return _simulate_many(rigs, drive, ts, model, jnp.asarray(substeps), method, effort=Effort.MOST)


def _check_batch(rigs: Any, drive: Any, ts: Float[Array, " t"], substeps: Any) -> None:
    """`InputError` for what `simulate_many` cannot take."""
    sizes = {jnp.shape(x)[:1] for x in jax.tree.leaves(eqx.filter(rigs, eqx.is_array))}
    if not isinstance(rigs, Rig) or len(sizes) != 1 or sizes == {()}:
        raise InputError(
            "`rigs` must be a `Rig` of which every number has one more axis in front, as "
            "`jax.vmap` makes it of many values; `simulate` takes one rig."
        )
    if not isinstance(drive, TorqueDrive):
        raise InputError(
            "`drive` must be motor torques, as `torques` makes them, but is a "
            f"{type(drive).__name__}."
        )
    check_drive(rigs, drive)
    if not isinstance(ts, Tracer):
        steps = np.diff(np.asarray(ts))
        if len(steps) < 1 or np.ptp(steps) > 1e-6 * steps.mean():
            raise InputError("`ts` must be two times or more at even steps.")
    if not isinstance(substeps, Tracer) and (
        not np.issubdtype(np.asarray(substeps).dtype, np.integer) or np.any(np.less(substeps, 1))
    ):
        raise InputError(f"`substeps` must be a whole number of 1 and above, but is {substeps}.")


@eqx.filter_jit
def _matrices(rigs: Rig, model: str) -> Float[Array, "b m m"]:
    return eqx.filter_vmap(lambda rig: _matrix(rig, model))(rigs)


@kept
def _simulate_many(rigs, drive, ts, model: str, substeps, method: str) -> Trajectory:
    arrays, static = eqx.partition(rigs, eqx.is_array)

    def one(arrays):
        return simulate_fixed(eqx.combine(arrays, static), drive, ts, model, substeps, method)

    return side_by_side(one)(arrays)
