"""What a simulation returns: the channels of a run, with pictures, tables and files."""

from pathlib import Path
from typing import Any

import jax.numpy as jnp

from .._batch import batch_words, check_single
from .._html import html_table
from ._run import AbstractRun


class Trajectory(AbstractRun):
    """A run of t samples and n wheels in SI, one row a sample; `UNITS` names every channel's unit.

    `t` (t,) in s.  Of the sphere's centre relative to the platform (t, 3): `dR`, `dR_elastic` in m,
    `dR_rate` in m/s.  In the inertial frame (t, 3): the sphere's `Omega` in rad/s, the platform's
    `R_l` in m and `V_l` in m/s, the accelerations `a` of the platform and `a_sphere` in m/s^2;
    `attitude` (t, 4), the sphere's quaternion.
    Of the wheels (t, n): `theta` in rad, `omega` in rad/s, `shape`, `deflection`,
    `mount_deflection` in m, `deflection_rate` and `mount_rate` in m/s, `normal_force`,
    `drive_force`, `slip_margin` in N, `shaft_torque`, with all laws, and `torque`, the motors', in
    N m.  `force` (t, 3) on the platform in N.

    At prescribed speeds `torque` is what the motors have to be told for these speeds, but for laws
    with memory (lags) and delays of the command, which are left out.

    `status` is a code of `Status`; samples after the failure of a run are not finite, and
    `time_reached` is the last good one.  `lift_off` and `slip` say whether a contact was
    without load (N <= 0) or |f| above mu N at a sample.
    """

    def save(self, path, rig=None, rig_path=None, command: str = "") -> Path:
        """Write the run: `.nc` with everything, `.csv`, `.csv.gz` or `.parquet` as a recording.

        `omnijax.load_run` reads the `.nc` again.  With `rig` the file holds it, and what its
        sensors read.  Raises `InputError` for another ending.
        """
        from ._files import save_trajectory

        check_single(self.status.shape)
        return save_trajectory(self, path, rig, rig_path, command)

    @staticmethod
    def load(path) -> "Trajectory":
        """The run that was saved as `.nc`, to the last bit."""
        from ._files import read_run

        return read_run(path, Trajectory)

    def to_xarray(self, rig=None) -> Any:
        """The run as an `xarray.Dataset` with units."""
        from ._files import to_xarray

        check_single(self.status.shape)
        return to_xarray(self, rig)

    def to_dataframe(self) -> Any:
        """The run as a `pandas.DataFrame`: t in s as index, columns dR_x, theta_1 and so on, SI."""
        from ._show import to_dataframe

        check_single(self.status.shape)
        return to_dataframe(self)

    def summary(self) -> Any:
        """How the run ended, and least, largest and RMS of every column; prints as a table.

        `omnijax.evaluate(run, rig, "peak, rms")` gives the metrics.
        """
        from ._show import summary

        check_single(self.status.shape)
        return summary(self)

    def plot(self, channel: str | None = None, *, ax=None) -> Any:
        """ΔR, its elastic part, Ω and the platform's acceleration over time; returns the figure.

        With a `channel`, or on axes `ax`, one channel alone (ΔR unless named); returns the axes.
        Raises `ValueError` for an unknown channel.
        """
        from ._plots import figure_of_run

        check_single(self.status.shape)
        if channel is None and ax is None:
            return figure_of_run(self)
        return self.plot_channel(channel or "dR", ax=ax)

    def plot_displacement(self, *, ax=None) -> Any:
        """ΔR in µm over time; returns the axes."""
        from ._plots import plot_displacement

        check_single(self.status.shape)
        return plot_displacement(self, ax=ax)

    def plot_channel(self, name: str, *, ax=None) -> Any:
        """One channel over time; returns the axes."""
        from ._plots import plot_channel

        check_single(self.status.shape)
        return plot_channel(self, name, ax=ax)

    def _repr_html_(self) -> str:
        rows = [("status", self.message()), ("wheels", ", ".join(self.names))]
        if not batch_words(self.status):
            rows.append(("steps", str(int(self.steps))))
            largest = 1e6 * float(jnp.max(self.distance))
            rows.append(("largest |ΔR| of the samples", f"{largest:.4g} µm"))
        rows += [(key, f"{unit}, {getattr(self, key).shape}") for key, unit in self.UNITS.items()]
        return html_table("Trajectory", rows, ("channel", "unit and shape"))

    def __repr__(self) -> str:
        n = self.theta.shape[-1]
        return f"Trajectory({self.t.shape[-1]} samples, {n} wheels; {self.message()})"


def load_run(path: str | Path) -> Trajectory:
    """The run that `run.save("run.nc")` wrote, to the last bit.

    Raises `InputError` for another file: recordings (`.csv`, `.parquet`) by `read_recording`.

    Channels are SI.
    """
    return Trajectory.load(path)
