"""The channels of a run with their names and units, and how it ended."""

import abc
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._batch import batch_words, check_single, single_status
from .._errors import did_you_mean
from .._root import root

PER_WHEEL = {  # channels with one column a wheel
    "theta", "omega", "shape", "deflection", "deflection_rate", "mount_deflection", "mount_rate",
    "normal_force", "drive_force", "slip_margin", "shaft_torque", "torque",
}  # fmt: skip


class ContactLoss(NamedTuple):
    """A contact that opens or slips.  Without a law for this the run is wrong from there on."""

    kind: str  # "lifts off" or "slips"
    wheel: str
    time: float  # s, of the first sample

    def __str__(self) -> str:
        return f"{self.wheel} {self.kind} at {self.time:.4g} s"


class Between(NamedTuple):
    """What sensors read of a run, at even points between its samples too."""

    t: Float[Array, " p"]
    dR: Float[Array, "p 3"]
    theta: Float[Array, "p n"]
    Omega: Float[Array, "p 3"]
    a: Float[Array, "p 3"]


class AbstractRun(eqx.Module):
    """The numbers of a run, as its pictures, tables, files and sensors know them."""

    t: Float[Array, " t"]
    theta: Float[Array, "t n"]
    omega: Float[Array, "t n"]
    Omega: Float[Array, "t 3"]
    attitude: Float[Array, "t 4"]
    dR: Float[Array, "t 3"]
    dR_rate: Float[Array, "t 3"]
    dR_elastic: Float[Array, "t 3"]
    R_l: Float[Array, "t 3"]
    V_l: Float[Array, "t 3"]
    a: Float[Array, "t 3"]
    a_sphere: Float[Array, "t 3"]
    shape: Float[Array, "t n"]
    deflection: Float[Array, "t n"]
    deflection_rate: Float[Array, "t n"]
    mount_deflection: Float[Array, "t n"]
    mount_rate: Float[Array, "t n"]
    normal_force: Float[Array, "t n"]
    drive_force: Float[Array, "t n"]
    slip_margin: Float[Array, "t n"]
    shaft_torque: Float[Array, "t n"]
    torque: Float[Array, "t n"]
    force: Float[Array, "t 3"]
    status: Int[Array, ""]
    steps: Int[Array, ""]
    method: str = eqx.field(static=True, default="")
    names: tuple[str, ...] = eqx.field(static=True, default=())
    between: Between | None = None

    UNITS: ClassVar[dict[str, str]] = {
        "t": "s",
        "theta": "rad",
        "omega": "rad/s",
        "Omega": "rad/s",
        "attitude": "1",
        "dR": "m",
        "dR_rate": "m/s",
        "dR_elastic": "m",
        "R_l": "m",
        "V_l": "m/s",
        "a": "m/s^2",
        "a_sphere": "m/s^2",
        "shape": "m",
        "deflection": "m",
        "deflection_rate": "m/s",
        "mount_deflection": "m",
        "mount_rate": "m/s",
        "normal_force": "N",
        "drive_force": "N",
        "slip_margin": "N",
        "shaft_torque": "N m",
        "torque": "N m",
        "force": "N",
    }

    def __getitem__(self, name: str | int) -> Float[Array, "..."]:
        """A channel (`run["dR"]`: (t, 3)) or one column of it (`run["dR_y"]`, `run["theta_2"]`).

        Columns are named as in recordings, wheels by number or name.  Raises `KeyError` with the
        nearest name for an unknown one.
        """
        if name in self.UNITS or name == "distance":
            return getattr(self, str(name))
        channel, _, end = str(name).rpartition("_")
        if channel in self.UNITS and channel != "t":
            for ends in (self.ends(channel), self.names if channel in PER_WHEEL else ()):
                if end in ends:
                    return getattr(self, channel)[..., ends.index(end)]
        raise KeyError(f"a run has no channel {name!r}.{did_you_mean(str(name), self.UNITS)}")

    def __iter__(self):
        raise TypeError("a run is no list: `run.UNITS` names its channels, `run[name]` gives one.")

    @classmethod
    def unit(cls, name: str) -> str:
        """SI unit of a channel or of one of its columns."""
        whole = name in cls.UNITS or name == "distance"
        return cls.UNITS.get(name if whole else name.rpartition("_")[0], "m")

    def ends(self, channel: str) -> tuple[str, ...]:
        """What the columns of a channel are named by: x, y, z, or the number of the wheel."""
        if channel in PER_WHEEL:
            return tuple(str(i + 1) for i in range(self.theta.shape[-1]))
        return tuple("wxyz" if channel == "attitude" else "xyz")

    @property
    def distance(self) -> Float[Array, " t"]:
        """|dR| in m."""
        return root(jnp.sum(self.dR**2, axis=-1))

    @property
    def ok(self) -> bool:
        """Whether the run reached its end; `ValueError` for a batch of `jax.vmap`."""
        return single_status(self.status) == 0

    @property
    def time_reached(self) -> float:
        """Last time with finite channels, s."""
        check_single(self.status.shape)
        good = np.isfinite(np.asarray(self.dR)).all(axis=-1)
        t = np.asarray(self.t)
        return float(t[good][-1]) if good.any() else float("nan")

    @property
    def lift_off(self) -> bool:
        """Whether a contact was without load at a sample: its normal force zero, or below.

        With the law `lift-off` a contact that parts has none.
        """
        check_single(self.status.shape)
        return bool(jnp.any(self.normal_force <= 0))

    @property
    def slip(self) -> bool:
        """Whether a drive force went above friction times normal force at a sample."""
        check_single(self.status.shape)
        return bool(jnp.any(self.slip_margin < 0))

    def contact_losses(self) -> list[ContactLoss]:
        """Where each wheel first lifts off and first slips, earliest first."""
        check_single(self.status.shape)
        time, losses = np.asarray(self.t), []
        off, slips = np.asarray(self.normal_force) <= 0, np.asarray(self.slip_margin) < 0
        for kind, lost in {"lifts off": off, "slips": slips}.items():
            for wheel in np.flatnonzero(lost.any(axis=0)):
                first = float(time[np.argmax(lost[:, wheel])])
                name = self.names[wheel] if self.names else f"wheel {wheel + 1}"
                losses.append(ContactLoss(kind, name, first))
        return sorted(losses, key=lambda loss: loss.time)

    def message(self) -> str:
        """One sentence on how the run ended, what to change if it failed; a batch is counted."""
        if words := batch_words(self.status):
            return words
        if self.ok:
            lost = "".join(f", but {loss}" for loss in self.contact_losses()[:1])
            more = len(self.contact_losses()) - 1
            lost += f" ({more} more of slip or lift-off)" if more > 0 else ""
            end = f"{len(self.t)} samples to {float(self.t[-1]):g} s ({self.method})."
            return f"ok{lost}: {end}"
        ended = single_status(self.status)
        return f"{ended.text} after {self.time_reached:g} s: {ended.remedy}"

    @abc.abstractmethod
    def plot_channel(self, name: str, *, ax=None) -> Any:
        """One channel over time; returns the axes."""
