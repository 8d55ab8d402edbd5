"""How a steady state shows itself: a table, a figure, labelled arrays."""

from typing import Any

import jax
import numpy as np

from ..._plot import COLOURS, new_axes, styled
from ..._status import Status

HEADER = ("figure", "value", "unit")


def summary_rows(state: Any) -> list[tuple[str, float, str]]:
    """(name, value, unit) of the scalar figures and of each component."""
    rows = [
        (name, float(getattr(state, name)), state.UNITS[name])
        for name in ("rms", "peak", "elastic_rms", "elastic_peak", "sphere_acceleration_rms")
    ]
    for name in ("rms_component", "peak_component", "peak_to_peak", "mean"):
        values = np.asarray(getattr(state, name))
        rows += [
            (f"{name} {axis}", float(v), state.UNITS[name])
            for axis, v in zip("xyz", values, strict=True)
        ]
    return rows


@styled
def plot_orders(state: Any, *, ax: Any = None) -> Any:
    """Amplitudes of |dR| in micrometres over the order of each wheel's rotation."""
    ax = new_axes(ax, 3.5)
    amplitude = 1e6 * np.linalg.norm(np.abs(np.asarray(state.spectrum)), axis=-1)
    order, below = np.asarray(state.order), {}
    for signal, wheel in enumerate(state.wheel):  # on top of each other, each exactly at its order
        for x, y in zip(order[signal], amplitude[signal], strict=True):
            if x > 0:
                foot = below.get(float(x), 0.0)
                below[float(x)] = foot + float(y)
                ax.vlines(x, foot, foot + y, color=COLOURS[wheel % len(COLOURS)], lw=3)
    for wheel in dict.fromkeys(state.wheel):
        ax.plot([], [], color=COLOURS[wheel % len(COLOURS)], lw=3, label=state.names[wheel])
    ax.set_xlabel("order (multiple of the wheel's rotation)")
    ax.set_ylabel("|ΔR| (µm)")
    ax.set_ylim(bottom=0)
    if state.wheel:
        ax.legend()
    return ax


def to_xarray(state: Any) -> Any:
    """An `xarray.Dataset` of every figure with its unit; signals are named by their wheel.

    Complex amplitudes are split into `spectrum_real` and `spectrum_imag`, which every store takes.
    """
    import xarray as xr

    component = ("component",)
    lines = ("signal", "harmonic")
    dims: dict[str, tuple[str, ...]] = {"order": lines, "transmissibility": lines}
    for name in ("rms_component", "peak_component", "peak_to_peak", "mean"):
        dims[name] = component
    data = {}
    for name, unit in state.UNITS.items():
        value, attributes = np.asarray(getattr(state, name)), {"units": unit}
        if name == "spectrum":
            data["spectrum_real"] = ((*lines, "component"), np.real(value), attributes)
            data["spectrum_imag"] = ((*lines, "component"), np.imag(value), attributes)
        else:
            data[name] = (dims.get(name, ()), value, attributes)
    names = [state.names[wheel] for wheel in state.wheel]
    coords = {"component": list("xyz"), "signal": names, "wheel": list(state.names),
              "index": ("signal", np.asarray(state.wheel, int))}  # fmt: skip
    return xr.Dataset(data, coords, {"status": Status(int(state.status)).text})


def from_xarray(cls: Any, data: Any) -> Any:
    """The steady state of which `to_xarray` made `data`."""
    arrays = {name: data[name].values for name in cls.UNITS if name != "spectrum"}
    arrays["spectrum"] = data["spectrum_real"].values + 1j * data["spectrum_imag"].values
    return cls(
        **{name: jax.device_put(value) for name, value in arrays.items()},
        status=jax.device_put(np.asarray(Status.of(data.attrs["status"]), int)),
        wheel=tuple(int(i) for i in data["index"].values),
        names=tuple(str(name) for name in data["wheel"].values),
    )
