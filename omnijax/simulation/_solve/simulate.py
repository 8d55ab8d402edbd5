"""`simulate`: a rig and a drive in, a trajectory out."""

from pathlib import Path
from typing import TYPE_CHECKING

from ..._errors import InputError, tell
from ...rig import Rig, as_rig, typed_above_zero, whole_number
from .._between import at_samples, to_be_seen
from .._drives import AbstractDrive, SpeedDrive, Values, as_times, drive_for
from .._exact import propagated, propagation_obstacle
from .._remarks import ends, remarks
from .._signals import Vector
from .._trajectory import Trajectory
from .defaults import MAX_STEPS, RTOL
from .state_vector import build_model

if TYPE_CHECKING:
    import diffrax as dfx


def simulate(
    rig: Rig | str | Path,
    drive: AbstractDrive | Values,
    ts: Vector | float | str | None = None,
    *,
    duration: float | str | None = None,
    rate: float | str | None = None,
    model: str = "coupled",
    solver: str = "auto",
    rtol: float = RTOL,
    max_steps: int = MAX_STEPS,
    keep_radius_rate: bool = False,
    adjoint: "dfx.AbstractAdjoint | None" = None,
) -> Trajectory:
    """Simulate `rig` under `drive`: `simulate("atlas", "30 rpm, 0, 10 rpm", "2 s")`.

    `rig` may be a rig file or the name of a bundled rig, `drive` wheel speeds (n,) as `speeds`
    takes them, and `ts` sample times (t,) in s (increasing; the run starts at `ts[0]`) or a
    duration (2.0, "2 s"), which may be named: `duration="2 s", rate="1 kHz"` (500 Hz where no rate
    is given).  Starts at static equilibrium, q = identity.  Returns a `Trajectory` in SI: channels
    (t, 3), of wheels (t, n).

    `model` is `coupled` or `paper`.  `solver` `auto` takes the closed form (`exact`, see
    `propagate`) where prescribed speeds drive a linear rig, else the exponential method for a stiff
    rig and `dopri8` for others; or name one of them, `tsit5` or `kvaerno5`.  `rtol` is the solvers'
    relative tolerance per step (absolute: the same in units of the gap's depth), `adjoint`
    diffrax's way to differentiate them; giving one asks for a solver.  For sensors that remember (a
    delay, a lag) the run knows points between its samples too (see `measured`).  Warns of speeds
    that do not fit each other, and of an axis that the wheels hardly drive.  Raises `InputError`
    for input that does not fit; never for a failed run: see `Trajectory.status`.

    Source: the paper's eqs. 1-11 and 32-46 with the errata of `docs/theory.md`; Hochbruck and
    Ostermann, Acta Numerica 2010 (exponential methods).
    """
    rig = as_rig(rig)
    drive, ts = drive_for(rig, drive), as_times(ts, duration, rate)
    rtol, max_steps = typed_above_zero("rtol", rtol, "1"), whole_number("max_steps", max_steps)
    tell(remarks(rig, drive, ends(ts), model))
    return simulated(
        rig, drive, ts, model=model, solver=solver, rtol=rtol, max_steps=max_steps,
        keep_radius_rate=keep_radius_rate, adjoint=adjoint,
    )  # fmt: skip


def simulated(
    rig: Rig,
    drive: AbstractDrive,
    ts,
    *,
    model: str,
    solver: str,
    rtol: float,
    max_steps: int,
    adjoint: "dfx.AbstractAdjoint | None",
    keep_radius_rate: bool = False,
) -> Trajectory:
    """`simulate` of a drive that fits its rig, for studies: one of many runs warns of nothing."""
    rig, fine, points = to_be_seen(rig, ts)
    built = build_model(rig, model, keep_radius_rate)
    exact = goes_exactly(rig, drive, fine, model, solver, keep_radius_rate)
    if exact and (solver == "exact" or adjoint is None):
        assert isinstance(drive, SpeedDrive)  # other drives are an obstacle
        return at_samples(propagated(rig, drive, fine, model=model), points)
    from .solve import solve  # diffrax takes as long to import as an exact run takes

    return at_samples(solve(built, drive, fine, solver, rtol, max_steps, adjoint), points)


def goes_exactly(
    rig: Rig, drive: AbstractDrive, ts, model: str, solver: str, keep_radius_rate: bool = False
) -> bool:
    """Whether `solver` and the run let the closed form be taken.

    Raises `InputError` where `exact` is asked for and the run has none.
    """
    if solver not in ("auto", "exact"):
        return False
    obstacle = exact_run_obstacle(rig, drive, ts, model, keep_radius_rate)
    if solver == "exact" and obstacle is not None:
        raise InputError(f"`solver` cannot be exact: {obstacle}; take auto.")
    return obstacle is None


def exact_run_obstacle(
    rig: Rig, drive: AbstractDrive, ts, model: str = "coupled", keep_radius_rate: bool = False
) -> str | None:
    """Why this run has no closed form, in words; None where it has one."""
    if keep_radius_rate:
        return "the rate of the rolling radius is kept"
    return propagation_obstacle(rig, drive, ts, model)
