"""How often is a hidden effect found, and what is named where nothing, or nothing known, is hidden?

    python benchmarks/hidden_effects.py [--seeds N] [--noise 1,5,10] [--only NAME,...] [--out FILE]

Data: plant.py, which shares neither integrator nor step nor friction widths with the diagnosis.
Sizes are those of an effect that is visible at noise x 1; they are the same at all noises.  Prints
rates with exact binomial intervals; every case's answer goes to FILE as one line of JSON, and
lines that are there are not run again.
"""

import argparse
import dataclasses
import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import plant
from scipy.stats import binomtest

from omnijax.diagnosis import diagnose

SECONDS, RUNS = 5.0, 3  # s a run; the last run is held out
ONE, ALL = np.array([0.0, 1.0, 0.0]), np.ones(3)  # wheel w2; every wheel
UNKNOWN = None


def gained(group: slice, g: float):
    """A sensor that reads (1 + g) y."""

    def sensor(t, out):
        out[:, group] *= 1 + g
        return out

    return sensor


def drifting(column: int, rate: float):
    """A channel that drifts at `rate` per second."""

    def sensor(t, out):
        out[:, column] += rate * t
        return out

    return sensor


def late(group: slice, delay: float):
    """A group that arrives `delay` s late: whole samples, since nothing is known in between."""

    def sensor(t, out):
        k = round(delay * plant.RATE)
        out[:, group] = np.concatenate([out[:1, group].repeat(k, axis=0), out[:-k, group]])
        return out

    return sensor


def crossed(to: int, source: int, share: float):
    """A channel that picks up a share of another."""

    def sensor(t, out):
        out[:, to] += share * out[:, source]
        return out

    return sensor


def clipped(column: int, share: float):
    """A channel that saturates softly at a share of its largest value, as no law does."""

    def sensor(t, out):
        limit = share * np.abs(out[:, column]).max()
        out[:, column] = limit * np.tanh(out[:, column] / limit)
        return out

    return sensor


@dataclasses.dataclass(frozen=True)
class Hidden:
    """What is planted, and what should be said: {(id, place)}, empty for none, or UNKNOWN.

    `rig` changes the machine, `record` how it is recorded; `sizes` are true sizes of sensors.
    """

    effects: dict[str, Any]
    expected: set[tuple[str, str]] | None
    sensor: Callable | None = None
    rig: dict[str, Any] = dataclasses.field(default_factory=dict)
    record: dict[str, Any] = dataclasses.field(default_factory=dict)
    sizes: dict[tuple[str, str], float] = dataclasses.field(default_factory=dict)


def _one(id: str, place: str, sensor=None, sizes=None, **effects) -> Hidden:
    return Hidden(effects, {(id, place)}, sensor, sizes=sizes or {})


RUNOUT = {"runout": 4e-5 * ONE, "runout_phase": 0.7 * ONE}
OVER = {"over": (1, 4)}  # w2 begins over its gap 4: a roller that is not passed cannot be seen
SINGLES = {
    "runout": Hidden(RUNOUT, {("wheel-runout", "w2")}),
    "roller": dataclasses.replace(
        _one("damaged-roller", "w2", roller=4 * ONE - (1 - ONE), severity=0.9 * ONE), record=OVER
    ),
    "round": _one(
        "sphere-out-of-round", "sphere", round=3e-5, round_axis=np.array([0.6, 0, 0.8])
    ),
    "contact-cubic": _one("contact-cubic", "all", K3=1e12 * ALL),
    "hertz": _one("contact-hertz", "all", hertz=ALL),
    "relaxation": _one("contact-relaxation", "w2", K1=3e4 * ONE, tau=0.02 * ALL),
    "lift-off": Hidden({"lift": ALL}, {("lift-off", "all")}, rig={"N0": 12.0}),
    "mount-cubic": _one("mount-cubic", "w2", k3=6e13 * ONE),
    "backlash": _one("mount-backlash", "w2", backlash=5e-6 * ONE),
    "mount-friction": _one("mount-friction", "w2", dry=1.5 * ONE),
    "coulomb": _one("bearing-coulomb", "all", coulomb=0.03 * ALL),
    "coulomb-one": _one("bearing-coulomb", "w2", coulomb=0.03 * ONE),
    "viscous": _one("bearing-viscous", "all", viscous=3e-4 * ALL),
    "ripple": _one("motor-ripple", "w2", ripple=0.012 * ONE, ripple_order=7 * ONE),
    "motor-gain": _one("motor-gain", "w2", gain=0.02 * ONE),
    "rolling": _one("rolling-resistance", "all", arm=3e-4),
    "spin": _one("spin-resistance", "all", lever=3e-4),
    "drag": _one("air-drag", "sphere", drag=0.05),
    "unbalance": _one("unbalance", "sphere", offset=np.array([2e-4, -1e-4, 1e-4])),
    "floor": _one("floor-vibration", "platform", floor=0.1, floor_f=11.3,
                  floor_d=np.array([0.36, 0.48, 0.8])),
    "creep": _one("creep", "w2", creep=1e-3 * ONE),
    "sensor-gain": _one("sensor-gain", "dR", gained(slice(0, 3), 0.05),
                        {("sensor-gain", "g"): 0.05}),
    "sensor-drift": _one("sensor-drift", "dR_z", drifting(2, 2e-6), {("sensor-drift", "b"): 2e-6}),
    "sensor-delay": _one("sensor-delay", "a", late(slice(9, 12), 0.004),
                         {("sensor-delay", "delay"): 0.004}),
    "crosstalk": _one("sensor-crosstalk", "dR", crossed(0, 2, 0.08),
                      {("sensor-crosstalk", "X_xz"): 0.08}),
}  # fmt: skip
SEVERAL = {
    "runout + viscous": Hidden(
        {**RUNOUT, "viscous": 3e-4 * ALL}, {("wheel-runout", "w2"), ("bearing-viscous", "all")}
    ),
    "coulomb + mount-cubic": Hidden(
        {"coulomb": 0.03 * ALL, "k3": 6e13 * ONE},
        {("bearing-coulomb", "all"), ("mount-cubic", "w2")},
    ),
    "ripple + sensor-gain": Hidden(
        {"ripple": 0.012 * ONE, "ripple_order": 7 * ONE},
        {("motor-ripple", "w2"), ("sensor-gain", "dR")},
        gained(slice(0, 3), 0.05),
    ),
    "roller + rolling": Hidden(
        {"roller": 4 * ONE - (1 - ONE), "severity": 0.9 * ONE, "arm": 3e-4},
        {("damaged-roller", "w2"), ("rolling-resistance", "all")},
        record=OVER,
    ),
    "runout + coulomb + floor": Hidden(
        {**RUNOUT, "coulomb": 0.03 * ALL, "floor": 0.1, "floor_f": 11.3},
        {("wheel-runout", "w2"), ("bearing-coulomb", "all"), ("floor-vibration", "platform")},
    ),
}
FOUR = {"wheels": 4}
UNUSUAL = {
    "rolling start: ripple": dataclasses.replace(SINGLES["ripple"], record={"cut": 1.5}),
    "rolling start: mount-cubic": dataclasses.replace(SINGLES["mount-cubic"], record={"cut": 1.5}),
    "no dR: runout": dataclasses.replace(SINGLES["runout"], record={"drop": ("dR",)}),
    "no a: backlash": dataclasses.replace(SINGLES["backlash"], record={"drop": ("a",)}),
    "no theta: coulomb": dataclasses.replace(SINGLES["coulomb"], record={"drop": ("theta",)}),
    "no Omega: viscous": dataclasses.replace(SINGLES["viscous"], record={"drop": ("Omega",)}),
    "four wheels: runout": Hidden(
        {k: np.append(v, 0.0) for k, v in RUNOUT.items()}, {("wheel-runout", "w2")}, rig=FOUR
    ),
    "four wheels: coulomb": Hidden(
        {"coulomb": 0.03 * np.ones(4)}, {("bearing-coulomb", "all")}, rig=FOUR
    ),
    "small sphere: hertz": Hidden(
        {"hertz": ALL}, {("contact-hertz", "all")}, rig={"R": 0.4, "r": 0.05, "N0": 80.0}
    ),
}
NONE = {
    "none": Hidden({}, set()),
    "none: rolling start": Hidden({}, set(), record={"cut": 1.5}),
    "none: no a": Hidden({}, set(), record={"drop": ("a",)}),
    "none: four wheels": Hidden({}, set(), rig=FOUR),
}
OUTSIDE = {
    "cross (unknown)": Hidden({"cross": 2e4}, UNKNOWN),
    "quadratic (unknown)": Hidden({"K2": 3e7 * ONE}, UNKNOWN),
    "fading (unknown)": Hidden({"fade": -0.01 * ALL}, UNKNOWN),
    "saturating dR_z (unknown)": Hidden({}, UNKNOWN, clipped(2, 0.8)),
}
HIDDEN = {**SINGLES, **SEVERAL, **UNUSUAL, **NONE, **OUTSIDE}
KINDS = {"right name, singles": SINGLES, "right names, several": SEVERAL,
         "right name, unusual rig or recording": UNUSUAL, "no false alarm": NONE,
         "unknown kept unknown": OUTSIDE}  # fmt: skip


def write(folder: Path, name: str, seed: int, noise: float) -> None:
    """The case of a name and a seed as files; the noise multiplies one and the same draw."""
    hidden = HIDDEN[name]
    rng = np.random.default_rng([seed, *name.encode()])
    stated = plant.machine(rng, **hidden.rig)
    true = plant.perturbed(rng, stated)
    cut = hidden.record.get("cut", 0.0)
    peak = 0.55 * 1.22 / stated["R"]
    motions = [plant.wander(rng, SECONDS + cut, peak) for _ in range(RUNS)]
    drives = [plant.torques(true, turning) for turning in motions]
    tables = plant.record(
        stated, true, hidden.effects, np.stack(drives), rng,
        noise=noise, sensor=hidden.sensor, **hidden.record,
    )  # fmt: skip
    plant.write_case(folder, stated, tables, noise)


def run_one(name: str, seed: int, noise: float) -> dict:
    """Plant, diagnose, and compare."""
    expected = HIDDEN[name].expected
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder), name, seed, noise)
        started = time.process_time()
        found = diagnose(folder)
    got = {(e.id, e.place) for e in found.effects}
    wanted = "unknown" if expected is UNKNOWN else "named" if expected else "none"
    return {"name": name, "seed": seed, "noise": noise, "verdict": found.verdict,
            "right": found.verdict == wanted and (expected is UNKNOWN or got == expected),
            "got": sorted(map(list, got)), "seconds": round(time.process_time() - started, 1),
            "over noise": {g: round(x.before / x.noise_floor, 2) for g, x in found.gap.items()},
            "z": pulls(found, HIDDEN[name]), "why": found.notes[0]}  # fmt: skip


SIZES = {  # (id, parameter) -> the plant's name of it
    ("wheel-runout", "amplitude"): "runout", ("damaged-roller", "severity"): "severity",
    ("sphere-out-of-round", "amplitude"): "round", ("bearing-coulomb", "torque"): "coulomb",
    ("bearing-viscous", "b"): "viscous", ("motor-gain", "g"): "gain",
    ("creep", "creepage"): "creep", ("contact-cubic", "K3"): "K3",
    ("contact-relaxation", "K1"): "K1", ("contact-relaxation", "tau"): "tau",
    ("mount-cubic", "k3"): "k3", ("mount-backlash", "gap"): "backlash",
    ("mount-friction", "force"): "dry", ("rolling-resistance", "arm"): "arm",
    ("spin-resistance", "lever"): "lever", ("air-drag", "D"): "drag",
    ("motor-ripple", "amplitude"): "ripple", ("floor-vibration", "amplitude"): "floor",
    ("floor-vibration", "frequency"): "floor_f",
}  # fmt: skip


def pulls(found, hidden: Hidden) -> dict[str, float]:
    """(value - truth)/sigma of the named sizes."""
    out = {}
    for e in found.effects:
        for key, p in e.parameters.items():
            planted = hidden.effects.get(SIZES.get((e.id, key), ""))
            true = hidden.sizes.get((e.id, key), planted)
            if true is not None and p["sigma"]:
                true = float(np.max(np.abs(true)))
                out[f"{e.id} {key}"] = (abs(p["value"]) - true) / p["sigma"]
    return out


def rate(kind: str, k: int, n: int, noise: float) -> str:
    """One line of the result table, with the exact (Clopper and Pearson) 95 % interval."""
    low, high = binomtest(k, n).proportion_ci(0.95, "exact")
    return f"| {noise:g} | {kind} | {k}/{n} | {100 * low:.0f} to {100 * high:.0f} % |"


def report(lines: list[dict]) -> None:
    """Rates at each noise with their intervals, and where it breaks down."""
    print("| noise x | figure | cases | 95 % interval |\n| --- | --- | --- | --- |")
    for noise in sorted({x["noise"] for x in lines}):
        here = [x for x in lines if x["noise"] == noise]
        for kind, cases in KINDS.items():
            some = [x["right"] for x in here if x["name"] in cases]
            if some:
                print(rate(kind, sum(some), len(some), noise))
        outside = [x for x in here if x["name"] in OUTSIDE]
        if outside:
            wrong = sum(x["verdict"] in ("named", "ambiguous") for x in outside)
            print(rate("unknown named as something known", wrong, len(outside), noise))
        z = [abs(v) for x in here if x["right"] for v in x["z"].values()]
        if z:
            print(rate("sizes within 3 sigma", sum(v < 3 for v in z), len(z), noise))
    for x in lines:
        far = {k: round(v, 1) for k, v in x["z"].items() if abs(v) >= 3}
        if not x["right"] or far:
            print(f"x {x['noise']:g}  {x['name']} (seed {x['seed']}): {x['verdict']} {x['got']} "
                  f"{far or ''} {x['why']}")  # fmt: skip


def main() -> None:
    """Run what is missing, then report everything in the file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--noise", default="1")
    parser.add_argument("--only", default="")
    parser.add_argument("--out", type=Path, default=Path("hidden_effects.jsonl"))
    options = parser.parse_args()
    names = options.only.split(",") if options.only else list(HIDDEN)
    done = (
        [json.loads(x) for x in options.out.read_text().splitlines()]
        if options.out.exists()
        else []
    )
    have = {(x["name"], x["seed"], x["noise"]) for x in done}
    for noise in map(float, options.noise.split(",")):
        for seed in range(options.seeds):
            for name in names:
                if (name, seed, noise) in have:
                    continue
                line = run_one(name, seed, noise)
                print(json.dumps(line), flush=True)
                with options.out.open("a") as file:
                    file.write(json.dumps(line) + "\n")
                done.append(line)
    report(done)


if __name__ == "__main__":
    main()
