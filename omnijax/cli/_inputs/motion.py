"""Options that runs, sweeps and sensitivities share: drive, length, and how it is computed."""

from dataclasses import dataclass
from typing import Literal

from cyclopts import Parameter

from .options import MaybeWhole, above_zero

MOST_STEPS = 2**31 - 1


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class MotionOptions:
    """How the wheels are driven, and for how long."""

    speed: str | None = None
    """Wheel speeds in rad/s, one a wheel; or with units (30 rpm,0,10 rpm)."""
    omega: str | None = None
    """The sphere's angular velocity in rad/s: x,y,z (or 0,0,10 rpm), by wheel speeds that fit."""
    torque: str | None = None
    """Motor torques in N m, one a wheel, instead of speeds."""
    force: str | None = None
    """Force on the platform in N: x,y,z."""
    duration: str | None = None
    """Length of a run (2, 2s, 500ms); else 8 s in `simulate`, the steady state in studies."""
    rate: str | None = None
    """Samples per s (1000, 1kHz); 500 where not given."""

    @property
    def seconds(self) -> float | None:
        """The duration in s."""
        return above_zero("duration", self.duration, "s")

    @property
    def hertz(self) -> float | None:
        """The rate in samples per s."""
        return above_zero("rate", self.rate, "Hz")


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class NumericsOptions:
    """How runs are computed."""

    model: Literal["coupled", "paper"] = "coupled"
    """Translation model."""
    solver: Literal["auto", "exact", "exponential", "dopri8", "tsit5", "kvaerno5"] = "auto"
    """`auto`: exact where speeds are constant and the rig linear, else what fits its stiffness."""
    rtol: float | None = None
    """Relative tolerance of the solvers."""
    max_steps: MaybeWhole = None
    """Most steps before a run stops with the status `step limit`."""

    def checked(self) -> "NumericsOptions":
        """Itself; `InputError` for figures that no solver takes."""
        from ..._errors import InputError

        if self.rtol is not None and not 0 < self.rtol <= 0.01:
            raise InputError(f"`rtol` must lie in (0, 0.01], but is {self.rtol:g}.")
        if self.max_steps is not None and self.max_steps < 1:
            raise InputError(f"`max-steps` must be at least 1, but is {self.max_steps}.")
        if self.max_steps is not None and self.max_steps > MOST_STEPS:
            raise InputError(f"`max-steps` must be at most {MOST_STEPS}, but is {self.max_steps}.")
        return self
