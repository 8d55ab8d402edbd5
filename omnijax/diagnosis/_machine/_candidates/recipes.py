"""Laws whose candidates on a rig are more than their table of parameters says."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ....laws import AbstractLaw
from ..._search import WHOLE, Candidate
from ..._settings import SETTINGS
from .unit_laws import Context, build, of_units

LEAST_PLAY = SETTINGS.candidates.least_play
SMALL_PLAYS = SETTINGS.candidates.small_plays
PLAYS = SETTINGS.candidates.plays
TORQUE_LIMITS = SETTINGS.candidates.torque_limits
DELAYS = SETTINGS.candidates.delays
LONGEST_DELAY = SETTINGS.candidates.longest_delay
ORDER_APART = SETTINGS.candidates.order_apart
LEAST_TIME = SETTINGS.candidates.least_time

Law = type[AbstractLaw]
Decode = Callable[[np.ndarray], dict[str, Any]]


def _one_column(
    law: Law, place: str, context: Context, decode: Decode, note: str = "", **values: float
) -> Candidate:
    """The candidate of one law with these parameters."""
    return Candidate(law.id, place, (build(law, place, context, **values),), decode, note)


def _runout(law: Law, place: str, context: Context) -> list[Candidate]:
    return [of_units(law, place, context, {})]


def _ripple(law: Law, place: str, context: Context) -> list[Candidate]:
    """Whole orders of a torque, and what stands out; of a current only what stands out."""
    lines, trials = context.orders.get(law.id, {}).get(place, ([], 1))
    whole = WHOLE if law.id == "motor-ripple" else ()
    broken = [n for n in lines if all(abs(n - k) > ORDER_APART for k in whole)]
    return [of_units(law, place, context, {"order": float(n)}) for n in whole] + [
        of_units(law, place, context, {"order": n}, f"order {n:.3g}", trials) for n in broken
    ]


def _roller(law: Law, place: str, context: Context) -> list[Candidate]:
    i = context.rig.names.index(place)
    count = int(np.asarray(context.rig.wheels.rollers)[i])
    return [
        _one_column(
            law, place, context,
            lambda c, j=j: {"roller": float(j), "severity": float(c[0])}, f"roller {j}",
            roller=j, severity=1.0,
        )
        for j in range(count)
    ]  # fmt: skip


_AXES = np.array([[1, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 1], [0, 1, 1]]) / np.array(
    [[1.0], [1.0], [2**0.5], [2**0.5], [2**0.5]]
)


def _out_of_round(law: Law, place: str, context: Context) -> list[Candidate]:
    columns = tuple(build(law, place, context, amplitude=1.0, axis=e) for e in _AXES)

    def decode(c):
        tensor = sum(k * (np.outer(e, e) - np.eye(3) / 3) for k, e in zip(c, _AXES, strict=True))
        values, vectors = np.linalg.eigh(tensor)
        at = int(np.argmax(np.abs(values)))
        return {"amplitude": 1.5 * float(values[at]), "axis": vectors[:, at]}

    return [Candidate(law.id, place, columns, decode)]


def _backlash(law: Law, place: str, context: Context) -> list[Candidate]:
    """Gaps to try; the force -k clip(D, -b, b) of a small one is -k b sign D, in proportion."""
    names = context.rig.names
    rms = context.mount_rms[names.index(place)] if place in names else context.mount_rms.mean()

    def decode(c, k):
        share = float(np.clip(k * c[0], LEAST_PLAY, PLAYS[0])) if k in SMALL_PLAYS else k
        return {"gap": rms * share}

    return [
        _one_column(law, place, context, lambda c, k=k: decode(c, k), f"gap {k * rms:.2g} m",
                    gap=k * rms)
        for k in (*SMALL_PLAYS, *PLAYS)
    ]  # fmt: skip


def _relaxation(law: Law, place: str, context: Context) -> list[Candidate]:
    return [
        _one_column(law, place, context, lambda c, tau=tau: {"K1": float(c[0]), "tau": tau},
                    f"tau {tau:g} s", K1=1.0, tau=tau)
        for tau in SETTINGS.candidates.relaxation
    ]  # fmt: skip


def _fixed_strength(law: Law, place: str, context: Context) -> list[Candidate]:
    return [_one_column(law, place, context, lambda c: {})]


def _limited(law: Law, place: str, context: Context) -> list[Candidate]:
    """A drive at its limit: nothing follows from small limits, so some are tried."""
    names = context.rig.names
    top = float(context.torques[names.index(place)] if place in names else context.torques.max())
    return [
        _one_column(law, place, context, lambda c, k=k: {"limit": k * top},
                    f"limit {k * top:.2g} N m", limit=k * top)
        for k in TORQUE_LIMITS if top > 0
    ]  # fmt: skip


def _clipped(law: Law, place: str, context: Context) -> list[Candidate]:
    """A sensor at its limit shows it: it hardly reads more."""
    top = context.tops.get(place, 0.0)
    if place.startswith("theta") or top <= 0:
        return []
    return [
        _one_column(law, place, context, lambda c: {"limit": top}, f"limit {top:.2g}", limit=top)
    ]


def _one_sided(law: Law, place: str, context: Context) -> list[Candidate]:
    return [] if place.startswith("theta") else _fixed_strength(law, place, context)


def _late(law: Law, place: str, context: Context) -> list[Candidate]:
    """A law of one time, tried at finite times: what it changes is in proportion to small ones."""
    (key,) = law.parameters
    return [
        _one_column(law, place, context,
                    lambda c, d=d: {key: max(LEAST_TIME, min(LONGEST_DELAY, abs(d * float(c[0]))))},
                    f"{1e3 * d:g} ms", **{key: d})
        for d in DELAYS
    ]  # fmt: skip


def _stribeck(law: Law, place: str, context: Context) -> list[Candidate]:
    """Where friction falls with speed, over some decades below the speed of the runs."""
    speeds = [share * context.speed for share in SETTINGS.candidates.stribeck]
    return [
        _one_column(law, place, context, lambda c, v=v: {"torque": float(c[0]), "speed": v},
                    f"speed {v:.3g} rad/s", torque=1.0, speed=v)
        for v in speeds
    ]  # fmt: skip


def _floor(law: Law, place: str, context: Context) -> list[Candidate]:
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


RECIPES: dict[str, Callable[[Law, str, Context], list[Candidate]]] = {
    "wheel-runout": _runout, "motor-ripple": _ripple, "damaged-roller": _roller,
    "sphere-out-of-round": _out_of_round, "mount-backlash": _backlash,
    "contact-relaxation": _relaxation, "contact-hertz": _fixed_strength,
    "lift-off": _fixed_strength, "sensor-delay": _late, "sensor-lag": _late,
    "actuator-delay": _late, "actuator-lag": _late, "stribeck": _stribeck,
    "encoder-eccentricity": _runout, "floor-vibration": _floor, "current-ripple": _ripple,
    "actuator-saturation": _limited, "sensor-saturation": _clipped,
    "sensor-rectified": _one_sided,
}  # fmt: skip
