"""A case of a seed: what is drawn, how large it is made, and the files that are diagnosed."""

import dataclasses
import functools
from pathlib import Path
from typing import Any

import jax
import numpy as np
from scipy.spatial.transform import Rotation

from .. import plant
from .effects import DRIFT_ANYWHERE, FRICTION, KNOWN, OUTSIDE, RADIUS, Hidden
from .machines import FINE, Machine, arrays, drawn_force, drawn_machine, drawn_motions
from .sensors import (
    GROUPS,
    columns_of,
    drawn_noise,
    noisy,
    of_all_groups,
    shifted,
    started_anew,
)

SECONDS = 3.0  # s a run
LANES = 6  # runs side by side: those that find a size, or three with what is hidden and without
COARSE = 2000.0  # steps a second there
KINDS = {"none": 0.3, "one": 0.4, "several": 0.1, "ambiguous": 0.08, "unknown": 0.12}
SIZES = (0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 16.0)  # times the visible size: 1 sigma RMS
LIKELY = (0.05, 0.05, 0.2, 0.3, 0.15, 0.1, 0.15)
CERTAIN = {"creep": "wheel.radius", "sensor-gain": "wheel.roundness", "motor-gain": "wheel.inertia",
           "wheel-radius": "wheel.radius"}  # fmt: skip


@dataclasses.dataclass
class Drawn:
    """A case before its size is known."""

    seed: int
    kind: str
    hidden: list[Hidden]
    machine: Machine
    factors: list[float]  # of the visible size, by effect
    rate: float
    noise: dict[str, Any]
    torque: np.ndarray  # (runs, samples at FINE, wheels)
    force: np.ndarray
    start: np.ndarray
    widths: dict[str, float]
    cut: float = 0.0
    drop: str = ""
    forced: bool = False
    lies: np.ndarray | None = None  # (runs, 3, 3) body -> inertial where the plant begins; None: I


def drawn(seed: int, kind: str | None = None) -> Drawn:
    """All that a seed draws; `kind` overrides what is hidden."""
    rng = np.random.default_rng([17, seed])
    chosen = str(rng.choice(list(KINDS), p=list(KINDS.values()))) if kind is None else kind
    count = int(rng.choice([2, 3], p=[0.7, 0.3])) if chosen == "several" else 1
    draws = {
        "none": [], "ambiguous": [_ambiguous(rng)],
        "one": list(rng.choice(list(KNOWN), 1)),
        "several": list(rng.choice(list(KNOWN), count, replace=False)),
        "unknown": list(rng.choice(list(OUTSIDE), 1)),
    }[chosen]  # fmt: skip
    certain = tuple(CERTAIN[k] for k in draws if k in CERTAIN)
    if "motor-gain" in draws:
        certain += ("sphere.inertia",)
    machine = drawn_machine(rng, certain)
    make = {**KNOWN, **OUTSIDE, "wheel-radius": RADIUS}
    if of_all_groups(seed):
        make["sensor-drift"] = DRIFT_ANYWHERE
    hidden = [make[k](rng, machine) for k in draws]
    factors = [float(rng.choice(SIZES, p=LIKELY)) for _ in hidden]
    if chosen in ("unknown", "ambiguous"):
        factors = [float(rng.choice([4.0, 8.0])) for _ in hidden]
    steady = chosen == "ambiguous" and draws[0] != "wheel-radius"
    runs = int(rng.choice([1, 2, 3], p=[0.1, 0.6, 0.3]))
    cut = 1.5 if steady else 1.0 if rng.random() < 0.12 else 0.0
    motions = drawn_motions(rng, machine.stated, SECONDS + 1.5, runs, steady)
    torque = np.stack([plant.torques(machine.stated, w, 0.0, FINE) for w in motions])
    forced = bool(rng.random() < 0.3)
    force = np.stack([drawn_force(rng, machine.stated, torque.shape[1]) for _ in range(runs)])
    start = rng.uniform(0, 2 * np.pi, (runs, machine.wheels))
    for h in hidden:
        if h.start is not None:
            wheel, gap = h.start
            start[:, wheel] = (
                (gap + start[:, wheel] / (2 * np.pi)) * 2 * np.pi / machine.stated["n"]
            )
    widths = {k: w * float(np.exp(rng.uniform(np.log(0.3), np.log(3.0))))
              for k, w in (("w0", plant.W0), ("v0", plant.V0), ("eps", plant.EPS))}  # fmt: skip
    drop = str(rng.choice(GROUPS)) if rng.random() < 0.1 and chosen in ("none", "one") else ""
    if any(h.place.split("_")[0] == drop for h in hidden):
        drop = ""
    rate = float(rng.choice([250.0, 500.0, 1000.0], p=[0.4, 0.4, 0.2]))
    torque, force = (linear_between(x, cut, rate) for x in (torque, force * forced))
    anew = runs if started_anew(seed) else 0
    noise = drawn_noise(rng, machine.wheels, of_all_groups(seed), anew)
    case = Drawn(seed, chosen, hidden, machine, factors, rate, noise,
                 torque, force, start, widths, cut, drop, forced)  # fmt: skip
    return dataclasses.replace(case, lies=turned_back(case))


def turned_back(case: Drawn) -> np.ndarray | None:
    """How the sphere lies where the plant begins, for the recording to begin at identity.

    As the format says of a run's first sample, also where the sphere turns already.  From the
    motion without what is hidden, which turns it by no part of what its numbers are known to.
    """
    if not case.cut or all(h.place != "sphere" for h in case.hidden):
        return None
    end = round(case.cut * FINE) + 1
    begun = dataclasses.replace(case, torque=case.torque[:, :end], force=case.force[:, :end])
    bare, where = silent(begun), columns_of("Omega", case.machine.wheels)
    made = outputs([(bare, k, [h.nominal for h in case.hidden]) for k in range(len(case.torque))])
    return np.stack([turned(out[:, where]).T for out in made])


def turned(Omega: np.ndarray) -> np.ndarray:
    """Rotation (3, 3), body -> inertial, from Omega (samples at FINE, 3)."""
    steps = Rotation.from_rotvec((Omega[1:] + Omega[:-1]) / 2 / FINE).as_matrix()
    return functools.reduce(lambda Q, step: step @ Q, steps, np.eye(3))


def linear_between(values: np.ndarray, cut: float, rate: float) -> np.ndarray:
    """Inputs (runs, samples at FINE, c) that are linear between a recording's samples.

    It begins `cut` s after them and has `rate` Hz.  So the format says that inputs are.
    """
    every, fine = round(FINE / rate), np.arange(values.shape[1])
    at = fine[round(cut * FINE) % every :: every]
    return np.stack([
        np.stack([np.interp(fine, at, x[at]) for x in run.T], axis=1) for run in values
    ])  # fmt: skip


def _ambiguous(rng) -> str:
    return str(rng.choice([*FRICTION, "wheel-radius"]))


def planted(case: Drawn, sizes: list[float]) -> tuple[dict, dict, np.ndarray]:
    """(machine, effects, torque) with every hidden effect at its size."""
    rig, e = arrays(case.machine.true), plant.nothing(case.machine.wheels)
    e = {k: np.array(v, float) for k, v in (e | case.widths).items()}
    torque = case.torque
    for h, x in zip(case.hidden, sizes, strict=True):
        for name, where, value in h.physics(x):
            e[name][where] = value
        for name, factor in h.machine(x).items() if h.machine else ():
            rig[name] = rig[name] * factor
        if h.command is not None:
            torque = np.stack([h.command(u, x) for u in torque])
    return rig, e, torque


Lane = tuple[Drawn, int, list[float]]  # a case, one of its runs, the sizes of what is hidden


def outputs(lanes: list[Lane], steps: float = plant.STEPS) -> list[np.ndarray]:
    """Outputs (samples at FINE, columns) of every lane, after the sensors' hidden effects."""
    given = []
    for case, k, sizes in lanes:
        rig, e, torque = planted(case, sizes)
        if case.lies is not None:
            e = e | {"lies": case.lies[k]}
        given.append((case.start[k], torque[k], case.force[k], rig, e))
    stacked = jax.tree.map(lambda *x: np.stack(x), *given)
    made = np.array(plant.side_by_side(*stacked, rate=FINE, steps=steps))
    tops = {  # a sensor's range is one in all runs, and the first one reaches it
        (id(case), *sizes): np.abs(out[: _size_end(case)]).max(axis=0)
        for out, (case, k, sizes) in zip(made, lanes, strict=True) if k == 0
    }  # fmt: skip
    return [sensed(case, out, sizes, tops[id(case), *sizes], k)
            for out, (case, k, sizes) in zip(made, lanes, strict=True)]  # fmt: skip


def sensed(
    case: Drawn, out: np.ndarray, sizes: list[float], tops: np.ndarray, run: int
) -> np.ndarray:
    """The readings of a run: hidden effects of sensors, then a logger's clock.

    `tops` (columns,) are the largest outputs of what the sizes are found by.
    """
    for h, x in zip(case.hidden, sizes, strict=True):
        if h.sensor is not None:
            out = h.sensor(out, x, round(case.cut * FINE))
        if h.limit is not None:
            out = h.limit(out, x, tops)
    if case.noise["fault"] == "clock":
        columns = columns_of(case.noise["at"], case.machine.wheels)
        late = np.atleast_1d(case.noise["size"])  # of all runs, or of each
        out = shifted(out, columns, float(late[run if len(late) > 1 else 0]))
    return out


def shown(case: Drawn, out: np.ndarray, without: np.ndarray, groups=GROUPS) -> float:
    """How far two outputs are apart: RMS in sigma of the group that shows it most.

    Omega and theta: what is left beside a straight line in every second, as a drift is free; but
    all of it where what drifts is their sensor, of which the other one tells.
    """
    drifting = {h.place.split("_")[0] for h in case.hidden if h.id == "sensor-drift"}
    best, every = 0.0, round(FINE / case.rate)
    sigma = np.array(list(case.noise["sigma"].values()))
    far = ((out - without) / sigma)[round(case.cut * FINE) :: every]
    for group in groups:
        if group == case.drop:
            continue
        part = far[:, columns_of(group, case.machine.wheels)]
        if group in ("Omega", "theta") and group not in drifting:
            part = _detrended(part, round(case.rate))
        best = max(best, float(np.sqrt(np.mean(part**2))))
    return best


def _detrended(part: np.ndarray, window: int) -> np.ndarray:
    out = []
    for first in range(0, len(part), window):
        block = part[first : first + window]
        line = np.vander(np.linspace(-1, 1, len(block)), 2)
        out.append(block - line @ np.linalg.lstsq(line, block, rcond=None)[0])
    return np.concatenate(out)


def _size_end(case: Drawn) -> int:
    """Samples of the first run by which sizes are found."""
    return round((case.cut + 2.5) * FINE)


def _recorded_end(case: Drawn) -> int:
    """Samples of a run up to the end of its recording."""
    return round(case.cut * FINE) + round(SECONDS * FINE) + 1


def silent(case: Drawn) -> Drawn:
    """The case with the machine of its effects, without the effects themselves."""
    bare = [dataclasses.replace(h, physics=lambda x: [], command=None, sensor=None, limit=None)
            for h in case.hidden]  # fmt: skip
    return dataclasses.replace(case, hidden=bare)


def sized(case: Drawn) -> list[float]:
    """By effect the size at which it alone shows by its factor in sigma, within what is sensible.

    From short runs with steps that are five times as long.
    """
    found, end = [], _size_end(case)
    short = dataclasses.replace(case, torque=case.torque[:1, :end], force=case.force[:1, :end])
    for h, factor in zip(case.hidden, case.factors, strict=True):
        one, x = dataclasses.replace(short, hidden=[h], factors=[factor]), h.nominal
        for ladder in (np.geomspace(1e-3, 30, LANES - 1), np.geomspace(0.2, 5, LANES - 1)):
            x = _interpolated(one, h, np.clip(x * ladder, h.least, h.most), factor)
        found.append(float(np.clip(x, h.least, h.most)))
    return found


def taught(case: Drawn, sizes: list[float]) -> list[float]:
    """By effect how far it alone shows in the first run, in sigma: what cannot show there (a
    roller that never passes the contact) no fit can find."""
    first = dataclasses.replace(case, torque=case.torque[:1], force=case.force[:1])
    lanes: list[Lane] = []
    for h, x in zip(case.hidden, sizes, strict=True):
        one = dataclasses.replace(first, hidden=[h])
        lanes += [(one, 0, [x]), (silent(one), 0, [x])]
    if not lanes:
        return []
    last = _recorded_end(case)
    made = [out[:last] for out in outputs(lanes + lanes[:1] * (-len(lanes) % LANES))]
    return [shown(first, made[2 * i], made[2 * i + 1], h.seen) for i, h in enumerate(case.hidden)]


def _interpolated(case: Drawn, h: Hidden, tried: np.ndarray, factor: float) -> float:
    """The size of `tried`, between or beyond them, that shows by `factor`."""
    bare = silent(case)
    without = [(bare, 0, [x]) for x in (tried if h.machine else tried[:1])]
    made = outputs([(case, 0, [x]) for x in tried] + (without if not h.machine else []), COARSE)
    base = outputs([*without, without[0]], COARSE)[:-1] if h.machine else [made[-1]] * len(tried)
    if h.machine:
        made = [*made, made[0]]
    far = [shown(case, a, b, h.seen) for a, b in zip(made[: len(tried)], base, strict=True)]
    x, far = np.log(tried), np.log(np.maximum(np.nan_to_num(far, nan=1e9, posinf=1e9), 1e-9))
    far = np.maximum.accumulate(far) + 1e-9 * np.arange(len(far))
    if np.log(factor) < far[0]:
        return float(np.exp(x[0] + np.log(factor) - far[0]))  # small sizes act in proportion
    return float(np.exp(np.interp(np.log(factor), far, x)))


def recorded(case: Drawn, sizes: list[float]) -> tuple[list[dict[str, np.ndarray]], float]:
    """Tables of the runs at the recording's rate, with noise; how much of it is the effects'.

    That is what they add in the run that shows them most.
    """
    runs, every = len(case.torque), round(FINE / case.rate)
    bare = silent(case)
    lanes = [(one, k % runs, sizes) for one in (case, bare) for k in range(LANES // 2)]
    first, wheels = round(case.cut * FINE), case.machine.wheels
    last = _recorded_end(case)
    both = [out[:last] for out in outputs(lanes)]
    made, without = both[: LANES // 2], both[LANES // 2 :]
    if not all(np.all(np.isfinite(x)) for x in made):
        raise RuntimeError("the plant runs away: what is hidden is too strong for this machine.")
    rng, tables = np.random.default_rng([18, case.seed]), []
    rows = slice(first, last, every)
    for k, clean in enumerate(made[:runs]):
        out = noisy(rng, clean[rows], case.noise, wheels)
        table = {"t": np.arange(len(out)) / case.rate}
        table |= {f"torque_{i + 1}": case.torque[k][rows, i] for i in range(wheels)}
        if case.forced:
            table |= {f"force_{a}": case.force[k][rows, i] for i, a in enumerate("xyz")}
        names = plant.columns(wheels)
        table |= {c: out[:, j] for j, c in enumerate(names) if c.split("_")[0] != case.drop}
        tables.append(table)
    seen = tuple({g for h in case.hidden for g in h.seen}) or GROUPS
    return tables, max(shown(case, a, b, seen) for a, b in zip(made, without, strict=True))


def written(folder: Path, case: Drawn, sizes: list[float], tables) -> None:
    """Rig file, runs and sidecars."""
    stated = dict(case.machine.stated)
    for h, x in zip(case.hidden, sizes, strict=True):
        for name, factor in h.machine(x).items() if h.machine else ():
            stated[name] = stated[name] * factor
    plant.write_case(folder, stated, tables, sigmas=case.noise["declared"],
                     uncertainty=case.machine.uncertainty)  # fmt: skip
