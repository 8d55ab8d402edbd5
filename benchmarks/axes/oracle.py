"""Whether the logs of an axis can tell its hidden time from another one: what nobody can name."""

import dataclasses

import numpy as np

from .._lines import TELLS
from .cases import Case
from .plants import Plant, moved, shown

TIMES = {"delay": "actuator-delay", "lag": "actuator-lag", "late": "sensor-delay",
         "slow": "sensor-lag"}  # fmt: skip
STEP, ROUNDS = 1e-4, 8
ENOUGH = 0.05  # of the chi2, that a further round must gain
FREE = ("J", "d", "gravity", "gain", "k", "c", "J2")


def untold(case: Case, names: set[str]) -> dict[str, float]:
    """By name of a time that is not hidden, and that the logs do not tell from the hidden one.

    Values are the chi2 by which it misses the logs at its best.
    """
    if case.hidden not in TIMES:
        return {}
    rivals = {TIMES[k]: k for k in TIMES if k != case.hidden and TIMES[k] in names}
    chi2 = {name: apart(case, key) for name, key in rivals.items()}
    return {name: x for name, x in chi2.items() if x < TELLS}


def apart(case: Case, rival: str) -> float:
    """chi2 by which a `rival` time at its best misses what the hidden one makes of all logs.

    The plant's own numbers, the time and the state in which every log starts are free, that of a
    second inertia too: nobody but the plant knows that both start together.  The noise, white or of
    steps, is not drawn: of what is drawn the chi2 has this mean beside that of the noise.
    """
    if case.plant.kind == "servo" and {case.hidden, rival} == {"late", "delay"}:
        return 0.0  # a controller moves as late as its goal comes: a position that is shown late
    numbers = [k for k in FREE if getattr(case.plant, k)]
    states = 4 if case.plant.J2 else 2
    true = _positions(case, case.plant, case.effect, np.zeros((len(case.inputs), states)))
    x = np.zeros(len(numbers) + 1 + states * len(case.inputs))
    size = np.tile([np.std(true), np.std(np.diff(true)) * case.rate], states // 2)

    def missed(x):
        plant, (time,) = _scaled(case.plant, numbers, x), case.effect.values()
        effect = {rival: time * np.exp(x[len(numbers)])}
        starts = size * x[len(numbers) + 1 :].reshape(-1, states)
        return (true - _positions(case, plant, effect, starts)) / case.sigma

    left = missed(x)
    least = float(left @ left)
    for _ in range(ROUNDS):
        slopes = np.stack([(missed(x + STEP * way) - left) / STEP for way in np.eye(len(x))], 1)
        step = np.linalg.lstsq(slopes, -left, rcond=1e-12)[0]
        x = x + np.clip(step, -0.5, 0.5)
        left, before = missed(x), least
        least = min(least, float(left @ left))
        if not least < (1 - ENOUGH) * before:
            break
    return least


def _scaled(plant: Plant, numbers: list[str], x: np.ndarray) -> Plant:
    factors = np.exp(x[: len(numbers)])
    return dataclasses.replace(
        plant, **{k: getattr(plant, k) * f for k, f in zip(numbers, factors, strict=True)}
    )


def _positions(case: Case, plant: Plant, effect, starts: np.ndarray) -> np.ndarray:
    """Shown positions (all samples of all logs,) without noise."""
    h = 1 / case.rate
    return np.concatenate([
        shown(effect, moved(plant, effect, u, h, case.held, tuple(start))[0], h)
        for u, start in zip(case.inputs, starts, strict=True)
    ])  # fmt: skip
