"""What one panel of the explore page shows, all of it computed by the library."""

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._errors import InputError
from .._text import quantity_text
from ..dynamics import rolling, sliding_of, sphere_velocity
from ..rig import Rig, put_parameter, read_parameter
from ..simulation import settled
from ..vibration import contact_load, natural_frequencies
from ._scene import machine_scene
from ._sliders import Slider, sliders

HARMONICS = 96
GRID_BITS = 7  # fewer search points than the default: the four figures shown need no more
WINDOW, SAMPLES = 2.0, 401  # s of vibration shown, and samples of it
PASSING = 3  # multiples of the roller-passing frequency in the resonance diagram
SHOWN_PASSINGS, LEAST_PASSINGS = 24, 4  # of roller passing: the order spectrum ends between them
FAINT = 0.01  # of the largest amplitude: orders beyond which all are smaller are left out
SLOWEST = 5.0  # % of the set speeds, where the resonance diagram begins


class Panel:
    """One rig of the page: its sliders, and the answer to their positions."""

    def __init__(self, name: str, rig: Rig, speeds: list[float], index: int):
        self.name, self.rig, self.speeds, self.index = name, rig, speeds, index
        self.sliders: list[Slider] = sliders(rig, speeds)

    def spec(self) -> dict[str, Any]:
        """What the page needs to draw the panel."""
        return {
            "index": self.index,
            "name": self.name,
            "machine": machine_scene(self.rig),
            "sliders": [slider._asdict() for slider in self.sliders],
        }

    def changed(self, values: Mapping[str, Any]) -> tuple[Rig, list[float]]:
        """The rig and the speeds at slider positions; only sliders that were moved change it."""
        rig, speeds = self.rig, list(self.speeds)
        known = {slider.path: slider for slider in self.sliders}
        for path, value in values.items():
            if path not in known:
                raise InputError(f"`{path}` is no slider of this page.")
            number = _number(path, value)
            low, high = known[path].low, known[path].high
            if not low - 1e-9 * abs(low) <= number <= high + 1e-9 * abs(high):
                raise InputError(f"`{path}` must lie in [{low:g}, {high:g}], but is {number:g}.")
            if known[path].whole and number != round(number):
                raise InputError(f"`{path}` must be a whole number, but is {number:g}.")
            if path.startswith("speed."):
                speeds[rig.names.index(path.removeprefix("speed."))] = number
            elif number != known[path].value:
                rig = put_parameter(rig, path, read_parameter(rig, path, number))
        return rig, speeds

    def evaluate(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Long-run vibration, order spectrum and resonances at slider positions.

        Raises `InputError` for a rig that has no steady state, or none in closed form.
        """
        rig, speeds = self.changed(values)
        still = jnp.zeros(rig.size)
        try:
            state = settled(
                rig, jnp.asarray(speeds, float), still, harmonics=HARMONICS, grid_bits=GRID_BITS
            )
        except ValueError as error:
            raise InputError(str(error)) from error
        if not state.ok:
            raise InputError(f"no steady state: {state.message()}")
        t = jnp.linspace(0.0, WINDOW, SAMPLES)
        frames = jax.tree.map(np.asarray, _motion(rig, jnp.asarray(speeds), state, t))
        order, spectrum = _lines(rig, state)
        return {
            "machine": machine_scene(rig),
            "figures": _figures(state) + _sliding(rig, speeds),
            "contacts": _contacts(rig, speeds),
            "t": np.asarray(t).tolist(),
            "distance": (1e6 * np.linalg.norm(frames["dR"], axis=1)).round(4).tolist(),
            "order": order,
            "spectrum": spectrum,
            "passing": _passing_orders(rig, max(order)),
            "campbell": _campbell(rig, speeds),
            "frames": {"t": np.asarray(t).tolist()}
            | {name: values.astype(np.float32).tolist() for name, values in frames.items()},
        }


def _number(path: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise InputError(f"`{path}` must be a number, but is {value!r}.")
    return float(value)


def _figures(state) -> list[dict[str, str]]:
    """What the long run comes to, in words and units."""
    return [
        {"label": label, "value": quantity_text(float(value), unit)}
        for label, value, unit in (
            ("|ΔR| peak", state.peak, "m"),
            ("|ΔR| RMS", state.rms, "m"),
            ("elastic part, RMS", state.elastic_rms, "m"),
            ("sphere's acceleration, RMS", state.sphere_acceleration_rms, "m/s^2"),
        )
    ]


def _sliding(rig: Rig, speeds: list[float]) -> list[dict[str, str]]:
    """By how much speeds that do not fit each other make a contact slide; empty where they fit."""
    slides = sliding_of(rig, np.asarray([speeds], float))
    if slides.fits:
        return []
    most = quantity_text(float(slides.speed.max()), "m/s")
    return [{"label": "speeds do not fit: a contact slides by", "value": most}]


def _contacts(rig: Rig, speeds: list[float]) -> list[dict[str, Any]]:
    """By wheel the least normal force and slip margin in N, and whether it slips or lifts off."""
    load = contact_load(rig, jnp.asarray(speeds))
    rows = zip(rig.names, np.asarray(load.least), np.asarray(load.slip_margin), strict=True)
    return [
        {
            "wheel": name,
            "normal": quantity_text(float(least), "N"),
            "margin": quantity_text(float(margin), "N"),
            "status": "lifts off" if least <= 0 else "slips" if margin <= 0 else "holds",
        }
        for name, least, margin in rows
    ]


@eqx.filter_jit
def _motion(rig: Rig, speeds, state, t) -> dict[str, jax.Array]:
    """dR from the closed-form spectrum; angles and orientation at the mean rolling radius."""
    rate = jnp.abs(speeds)[jnp.asarray(state.wheel)] if state.wheel else jnp.zeros(0)
    turn = jnp.exp(1j * (state.order[:, 1] * rate)[:, None] * t)  # orders are multiples of one
    lines = jnp.where(state.order[..., None] > 0, state.spectrum, 0.0)
    waves = jnp.polyval(jnp.moveaxis(lines, 1, 0)[::-1, :, None], turn[..., None])
    dR = state.mean + jnp.sum(waves.real, axis=0)
    round_rig = eqx.tree_at(lambda r: r.wheels.roundness, rig, jnp.zeros(rig.size))
    omega = sphere_velocity(rig, rolling(round_rig, jnp.zeros(rig.size), speeds), speeds)
    size = jnp.linalg.norm(omega)
    axis = omega / jnp.where(size > 0, size, 1.0)
    half = 0.5 * size * t[:, None]
    attitude = jnp.concatenate([jnp.cos(half), jnp.sin(half) * axis], axis=1)
    theta = t[:, None] * speeds
    return {"dR": dR, "attitude": attitude, "theta": theta, "mount": jnp.zeros_like(theta)}


def _lines(rig: Rig, state) -> tuple[list[float], list[list[float]]]:
    """Orders that matter, and each wheel's amplitudes of |dR| in micrometres at them."""
    order = np.asarray(state.order)
    amplitude = 1e6 * np.linalg.norm(np.abs(np.asarray(state.spectrum)), axis=-1)
    largest = float(amplitude[order > 0].max(initial=0.0))
    top = SHOWN_PASSINGS * float(np.max(rig.wheels.rollers))
    audible = order[(amplitude > FAINT * largest) & (order > 0) & (order <= top)]
    least = LEAST_PASSINGS * float(np.max(rig.wheels.rollers))
    highest = max(least, float(audible.max(initial=0.0))) if largest > 0 else least
    shown = (order > 0) & (order <= highest)
    every = np.unique(order[shown]) if shown.any() else np.array([1.0])
    rows = np.zeros((rig.size, len(every)))
    for signal, wheel in enumerate(state.wheel):
        at = np.searchsorted(every, order[signal][shown[signal]])
        np.add.at(rows[wheel], at, amplitude[signal][shown[signal]])
    return every.tolist(), rows.tolist()


def _passing_orders(rig: Rig, highest: float) -> list[float]:
    counts = {round(float(n)) for n in rig.wheels.rollers}
    return sorted({n * k for n in counts for k in range(1, int(highest // n) + 1)})


_frequencies = eqx.filter_jit(natural_frequencies)


def _campbell(rig: Rig, speeds: list[float]) -> dict[str, Any]:
    """Natural frequencies and roller-passing lines (Hz) over the drive's speed in per cent.

    Both axes are logarithmic: a multiple of the speed is a line of slope one, and modes far apart
    have room.  The speed runs until the fastest wheel's passing meets the highest mode.
    """
    frequencies = np.unique(np.round(np.asarray(_frequencies(rig)), 2))
    modes = frequencies[frequencies > 0]
    once = np.abs(speeds) * np.asarray(rig.wheels.rollers) / (2 * np.pi)
    fastest = once.max(initial=0.0)
    low, high = (modes.min(), modes.max()) if len(modes) else (1.0, 1.0)
    top = max(200.0, 130.0 * high / fastest) if fastest > 0 else 200.0
    scale = np.geomspace(SLOWEST, top, 81)
    series = [
        {"label": f"{f:.4g} Hz", "kind": "mode", "wheels": [], "times": 0,
         "values": [float(f)] * len(scale)}
        for f in modes
    ]  # fmt: skip
    for wheels in _together(once):
        names = ", ".join(rig.names[i] for i in wheels) if len(wheels) < rig.size else "all wheels"
        for k in range(1, PASSING + 1):
            line = (k * once[wheels[0]] * scale / 100).tolist()
            series.append({"label": f"{names} {k}×", "kind": "passing", "wheels": wheels,
                           "times": k, "values": line})  # fmt: skip
    slowest = min(once[once > 0].min(initial=np.inf) * SLOWEST / 100, low)
    return {"scale": scale.tolist(), "series": series,
            "range": [float(0.7 * slowest), float(1.5 * high)]}  # fmt: skip


def _together(once: np.ndarray) -> list[list[int]]:
    """The turning wheels in groups; the rollers of a group's wheels pass equally often."""
    groups: dict[float, list[int]] = {}
    for i, frequency in enumerate(once):
        if frequency > 0:
            groups.setdefault(round(float(frequency), 6), []).append(i)
    return list(groups.values())
