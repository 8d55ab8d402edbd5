"""Candidates: every law of the library at every place it may have, with its shape constants."""

import dataclasses
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np

from ...laws import AbstractLaw
from ...machine import PlacedLaw
from ...rig import Placed, Rig, place_law
from .._settings import SETTINGS

WHOLE = range(1, 25)  # orders that are tried whatever stands out


@dataclasses.dataclass(frozen=True)
class Candidate:
    """One law at one place with fixed shape constants: `columns` are its laws of unit strength.

    `decode(coefficients)` gives the law's parameters from the columns' coefficients, `trials` is
    how many independent trials the candidate stands for: a line picked for its size, all lines.
    """

    id: str
    place: str
    columns: tuple[Placed, ...] | tuple[PlacedLaw, ...]
    decode: Callable[[np.ndarray], dict[str, Any]]
    note: str = ""
    trials: int = 1

    @property
    def name(self) -> str:
        """id at place."""
        return f"{self.id}@{self.place}"

    def allowed(self, coefficients: np.ndarray) -> bool:
        """Whether the signs are physical: bounds kept, a law without strength not turned round."""
        law = self.columns[0].law
        known = law.parameters
        if not any(p.linear for p in known.values()):
            return bool(coefficients[0] > 0.05)
        values = self.decode(coefficients)
        if len(coefficients) == 1:
            key = next(k for k, p in known.items() if p.linear)
            sign = float(coefficients[0])
            return known[key].low <= sign <= known[key].high
        return all(known[k].low <= v <= known[k].high for k, v in values.items() if np.ndim(v) == 0)


class Context:
    """What enumerates candidates: the rig, the channels at hand, typical sizes, and lines.

    `samples` of the longest run is about how many lines (half a resolution apart) could be picked.
    `orders` holds by law and wheel the orders that stand out and of how many they were picked,
    `torques` the largest commanded torque of each wheel, `tops` what a channel hardly exceeds.
    """

    def __init__(self, rig: Rig, groups, mount_rms, lines: tuple[float, ...], samples: int,
                 orders=None, torques=None, tops=None):  # fmt: skip
        self.rig, self.groups, self.mount_rms, self.lines = rig, groups, mount_rms, lines
        self.samples, self.orders, self.tops = samples, orders or {}, tops or {}
        self.torques = np.zeros(len(rig.names)) if torques is None else torques


def number(x) -> Any:
    """A parameter as a float64 array."""
    return jnp.asarray(x, float)


def candidates(context: Context, laws: dict[str, type[AbstractLaw]]) -> list[Candidate]:
    """Every candidate of `laws` for a rig."""
    out: list[Candidate] = []
    for id, law in laws.items():
        if id in UNTRIED or (
            id in _NEEDS_GRAVITY and not np.any(np.asarray(context.rig.platform.gravity))
        ):
            continue
        make = _RECIPES.get(id, _generic)
        for place in places(law, context):
            out += make(law, place, context)
    return out


def places(law: type[AbstractLaw], context: Context) -> list[str]:
    """Places of a law on this rig, in channels that were measured."""
    names, groups = context.rig.names, context.groups
    wheels = range(1, len(names) + 1)
    channels = [f"{g}_{i}" for g in groups for i in (wheels if g == "theta" else "xyz")]
    known = {
        "wheel": list(names),
        "all": ["all"] if len(names) > 1 else [],
        "group": list(groups),
        "channel": channels,
        "encoder": [c for c in channels if c.startswith("theta")],
    }
    out: list[str] = []
    for place in law.places:
        default = [place] if place in groups or place in ("sphere", "platform") else []
        out += known.get(place, default)
    return out


def build(law: type[AbstractLaw], place: str, context: Context, **values) -> Placed:
    """A law with these parameters, placed."""
    made = law(**{k: number(v) for k, v in values.items()})
    return place_law(made, place, context.rig.names, context.rig.profiles)


def _strengths(law) -> list[str]:
    return [k for k, p in law.parameters.items() if p.linear]


def _generic(law, place, context) -> list[Candidate]:
    """A law by its table of parameters: a column a strength, shape constants from a ladder.

    One of one strength with a `phase` is a wave; with any other a `phase` begins at 0.
    """
    linear, shapes = _strengths(law), unknown_shapes(law)
    ladders = [values_to_try(k, law.parameters[k]) for k in shapes]
    out = []
    for values in itertools.product(*ladders):
        fixed = dict(zip(shapes, values, strict=True))
        note = ", ".join(f"{k} {v:.3g}" for k, v in fixed.items())
        if is_wave(law):
            out.append(_waves(law, place, context, note, 1, **fixed))
            continue
        fixed |= {"phase": 0.0} if "phase" in law.parameters else {}
        columns = []
        for key in linear or [None]:
            size = law.parameters[key].shape if key else 0
            for unit in np.eye(size) if size else [1.0]:
                zero = {k: np.zeros(law.parameters[k].shape or ()) for k in linear}
                chosen = zero | ({key: unit} if key else {}) | fixed
                columns.append(build(law, place, context, **chosen))
        out.append(Candidate(law.id, place, tuple(columns), _decoder(linear, law, fixed), note))
    return out


def is_wave(law) -> bool:
    """Whether a law is one strength times a wave of a `phase`: two of its phases give all."""
    linear = _strengths(law)
    return "phase" in law.parameters and len(linear) == 1 and not law.parameters[linear[0]].shape


def _decoder(linear, law, fixed):
    def decode(c):
        values, at = dict(fixed), 0
        for key in linear:
            size = law.parameters[key].shape
            values[key] = np.array(c[at : at + size]) if size else float(c[at])
            at += max(1, size)
        return values

    return decode


def unknown_shapes(law) -> list[str]:
    """Shape constants of a law that have no default; a wave's phase is no such constant."""
    fields = law.__dataclass_fields__
    return [
        k for k, p in law.parameters.items()
        if not (p.linear or p.optional or p.shape or k == "phase")
        and fields[k].default is dataclasses.MISSING
    ]  # fmt: skip


def values_to_try(key: str, parameter) -> Sequence[float]:
    """Values of an unknown shape constant: whole orders, within its bounds, or a decade about 1."""
    low, high = parameter.low, parameter.high
    if key == "order":
        return [float(n) for n in WHOLE if low <= n <= high]
    if math.isfinite(low) and math.isfinite(high):
        return list(np.linspace(low, high, 6)[1:-1])
    return [0.03, 0.1, 0.3, 1.0, 3.0, 10.0]


def _waves(law, place, context, note: str = "", trials: int = 1, **fixed) -> Candidate:
    """A law of one strength and a phase as its cosine and sine parts."""
    (size,) = _strengths(law)
    columns = tuple(
        build(law, place, context, **{size: 1.0}, phase=p, **fixed) for p in (0.0, math.pi / 2)
    )
    return Candidate(law.id, place, columns, lambda c: fixed | {
        size: math.hypot(*c), "phase": math.atan2(c[1], c[0])}, note, trials)  # fmt: skip


def _runout(law, place, context):
    return [_waves(law, place, context)]


def _ripple(law, place, context):
    """Whole orders of a torque, and what stands out; of a current only what stands out."""
    lines, trials = context.orders.get(law.id, {}).get(place, ([], 1))
    whole = WHOLE if law.id == "motor-ripple" else ()
    broken = [n for n in lines if all(abs(n - k) > 0.05 for k in whole)]
    return [_waves(law, place, context, order=float(n)) for n in whole] + [
        _waves(law, place, context, f"order {n:.3g}", trials, order=n) for n in broken
    ]


def _roller(law, place, context):
    i = context.rig.names.index(place)
    count = int(np.asarray(context.rig.wheels.rollers)[i])
    return [
        Candidate(
            law.id, place, (build(law, place, context, roller=j, severity=1.0),),
            lambda c, j=j: {"roller": float(j), "severity": float(c[0])}, f"roller {j}",
        )
        for j in range(count)
    ]  # fmt: skip


_AXES = np.array([[1, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 1], [0, 1, 1]]) / np.array(
    [[1.0], [1.0], [2**0.5], [2**0.5], [2**0.5]]
)


def _out_of_round(law, place, context):
    columns = tuple(build(law, place, context, amplitude=1.0, axis=e) for e in _AXES)

    def decode(c):
        tensor = sum(k * (np.outer(e, e) - np.eye(3) / 3) for k, e in zip(c, _AXES, strict=True))
        values, vectors = np.linalg.eigh(tensor)
        at = int(np.argmax(np.abs(values)))
        return {"amplitude": 1.5 * float(values[at]), "axis": vectors[:, at]}

    return [Candidate(law.id, place, columns, decode)]


# times the RMS of a mount's deflection: mounts rest for most of a run, so that small gaps show too
LEAST_GAP = SETTINGS.candidates.least_gap
SMALL_GAPS = SETTINGS.candidates.small_gaps
GAPS = SETTINGS.candidates.gaps


def _backlash(law, place, context):
    """Gaps to try; the force -k clip(D, -b, b) of a small one is -k b sign D, in proportion."""
    names = context.rig.names
    rms = context.mount_rms[names.index(place)] if place in names else context.mount_rms.mean()

    def decode(c, k):
        share = float(np.clip(k * c[0], LEAST_GAP, GAPS[0])) if k in SMALL_GAPS else k
        return {"gap": rms * share}

    return [
        Candidate(law.id, place, (build(law, place, context, gap=k * rms),),
                  lambda c, k=k: decode(c, k), f"gap {k * rms:.2g} m")
        for k in (*SMALL_GAPS, *GAPS)
    ]  # fmt: skip


def _relaxation(law, place, context):
    return [
        Candidate(law.id, place, (build(law, place, context, K1=1.0, tau=tau),),
                  lambda c, tau=tau: {"K1": float(c[0]), "tau": tau}, f"tau {tau:g} s")
        for tau in (0.003, 0.01, 0.03, 0.1)
    ]  # fmt: skip


def _fixed_strength(law, place, context):
    return [Candidate(law.id, place, (build(law, place, context),), lambda c: {})]


CLIPPED = SETTINGS.candidates.clipped


def _limited(law, place, context):
    """A drive at its limit: nothing follows from small limits, so some are tried."""
    names = context.rig.names
    top = float(context.torques[names.index(place)] if place in names else context.torques.max())
    return [
        Candidate(law.id, place, (build(law, place, context, limit=k * top),),
                  lambda c, k=k: {"limit": k * top}, f"limit {k * top:.2g} N m")
        for k in CLIPPED if top > 0
    ]  # fmt: skip


def _clipped(law, place, context):
    """A sensor at its limit shows it: it hardly reads more."""
    top = context.tops.get(place, 0.0)
    if place.startswith("theta") or top <= 0:
        return []
    return [Candidate(law.id, place, (build(law, place, context, limit=top),),
                      lambda c: {"limit": top}, f"limit {top:.2g}")]  # fmt: skip


def _one_sided(law, place, context):
    return [] if place.startswith("theta") else _fixed_strength(law, place, context)


LATE = SETTINGS.candidates.late
LATEST = SETTINGS.candidates.latest


def _late(law, place, context):
    """A law of one time, tried at finite times: what it changes is in proportion to small ones."""
    (key,) = law.parameters
    return [
        Candidate(law.id, place, (build(law, place, context, **{key: d}),),
                  lambda c, d=d: {key: max(1e-6, min(LATEST, abs(d * float(c[0]))))},
                  f"{1e3 * d:g} ms")
        for d in LATE
    ]  # fmt: skip


def _stribeck(law, place, context):
    """Where friction falls with speed, over two decades of the speed at which it does."""
    return [
        Candidate(law.id, place, (build(law, place, context, torque=1.0, speed=v),),
                  lambda c, v=v: {"torque": float(c[0]), "speed": v}, f"speed {v:g} rad/s")
        for v in (0.1, 0.3, 1.0, 3.0)
    ]  # fmt: skip


def _floor(law, place, context):
    out = []
    for f in context.lines:
        columns = tuple(
            build(law, place, context, amplitude=1.0, frequency=f, phase=p, direction=e)
            for e in np.eye(3)
            for p in (0.0, math.pi / 2)
        )
        out.append(Candidate(law.id, place, columns, lambda c, f=f: _line(c, f), f"{f:.3f} Hz",
                             context.samples))  # fmt: skip
    return out


def _line(c, frequency):
    """Common phase and direction of three sine and cosine pairs: the largest singular pair."""
    u, s, v = np.linalg.svd(np.reshape(c, (3, 2)))
    return {
        "amplitude": float(s[0]), "frequency": frequency,
        "phase": math.atan2(v[0, 1], v[0, 0]), "direction": u[:, 0],
    }  # fmt: skip


# never proposed for a rig: the twin of creep, which is said beside it, and several lines at one
# place, which are found one by one and told as one effect
UNTRIED = {"wheel-radius", "cogging"}
_NEEDS_GRAVITY = {"unbalance"}
_RECIPES = {
    "wheel-runout": _runout, "motor-ripple": _ripple, "damaged-roller": _roller,
    "sphere-out-of-round": _out_of_round, "mount-backlash": _backlash,
    "contact-relaxation": _relaxation, "contact-hertz": _fixed_strength,
    "lift-off": _fixed_strength, "sensor-delay": _late, "sensor-lag": _late,
    "actuator-delay": _late, "actuator-lag": _late, "stribeck": _stribeck,
    "encoder-eccentricity": _runout, "floor-vibration": _floor, "current-ripple": _ripple,
    "actuator-saturation": _limited, "sensor-saturation": _clipped,
    "sensor-rectified": _one_sided,
}  # fmt: skip
