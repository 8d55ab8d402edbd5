"""How often is a hidden effect found, and what is named where nothing, or nothing known, is hidden?

    python benchmarks/hidden_effects.py [--seeds N] [--noise 1,5,10] [--only NAME,...] [--out FILE]

Data: plant.py, which shares neither integrator nor step nor friction widths with the diagnosis.
Sizes are those of a visible effect at noise x 1.  Prints rates with exact binomial intervals;
every case's answer goes to FILE as one line of JSON, and lines that are there are not run again.
"""

import argparse
import json
import tempfile
import time
from pathlib import Path

import numpy as np
import plant
from scipy.stats import beta

from omnijax.diagnosis import diagnose

ONE, ALL = np.array([0.0, 1.0, 0.0]), np.ones(3)  # wheel w2; every wheel


def gained(group: slice, g: float):
    """A sensor that reads (1 + g) y."""

    def sensor(t, out):
        out[:, group] *= 1 + g
        return out

    return (sensor,)


def drifting(column: int, rate: float):
    """A channel that drifts at `rate` per second."""

    def sensor(t, out):
        out[:, column] += rate * t
        return out

    return (sensor,)


def late(group: slice, delay: float):
    """A group that arrives `delay` s late."""

    def sensor(t, out):
        for c in range(group.start, group.stop):
            out[:, c] = np.interp(t - delay, t, out[:, c])
        return out

    return (sensor,)


# name -> (effects, expected {(id, place)}, sensor)
HIDDEN = {
    "runout": ({"runout": 4e-5 * ONE, "runout_phase": 0.7 * ONE}, {("wheel-runout", "w2")}, None),
    "roller": ({"roller": 4 * ONE - (1 - ONE), "severity": 0.9 * ONE},
               {("damaged-roller", "w2")}, None),
    "round": ({"round": 3e-5, "round_axis": np.array([0.6, 0, 0.8])},
              {("sphere-out-of-round", "sphere")}, None),
    "contact-cubic": ({"K3": 1e12 * ALL}, {("contact-cubic", "all")}, None),
    "hertz": ({"hertz": ALL}, {("contact-hertz", "all")}, None),
    "relaxation": ({"K1": 3e4 * ONE, "tau": 0.02 * ALL}, {("contact-relaxation", "w2")}, None),
    "mount-cubic": ({"k3": 6e13 * ONE}, {("mount-cubic", "w2")}, None),
    "backlash": ({"backlash": 5e-6 * ONE}, {("mount-backlash", "w2")}, None),
    "mount-friction": ({"dry": 1.5 * ONE}, {("mount-friction", "w2")}, None),
    "coulomb": ({"coulomb": 0.03 * ALL}, {("bearing-coulomb", "all")}, None),
    "coulomb-one": ({"coulomb": 0.03 * ONE}, {("bearing-coulomb", "w2")}, None),
    "viscous": ({"viscous": 3e-4 * ALL}, {("bearing-viscous", "all")}, None),
    "ripple": ({"ripple": 0.012 * ONE, "ripple_order": 7 * ONE}, {("motor-ripple", "w2")}, None),
    "motor-gain": ({"gain": 0.02 * ONE}, {("motor-gain", "w2")}, None),
    "rolling": ({"arm": 3e-4}, {("rolling-resistance", "all")}, None),
    "spin": ({"lever": 3e-4}, {("spin-resistance", "all")}, None),
    "drag": ({"drag": 0.05}, {("air-drag", "sphere")}, None),
    "unbalance": ({"offset": np.array([2e-4, -1e-4, 1e-4])}, {("unbalance", "sphere")}, None),
    "floor": ({"floor": 0.1, "floor_f": 11.3, "floor_d": np.array([0.36, 0.48, 0.8])},
              {("floor-vibration", "platform")}, None),
    "creep": ({"creep": 1e-3 * ONE}, {("creep", "w2")}, None),
    "sensor-gain": ({}, {("sensor-gain", "dR")}, gained(slice(0, 3), 0.05)),
    "sensor-drift": ({}, {("sensor-drift", "dR_z")}, drifting(2, 2e-6)),
    "sensor-delay": ({}, {("sensor-delay", "a")}, late(slice(9, 12), 0.003)),
    "pair": ({"runout": 4e-5 * ONE, "viscous": 3e-4 * ALL},
             {("wheel-runout", "w2"), ("bearing-viscous", "all")}, None),
    "triple": ({"runout": 4e-5 * ONE, "coulomb": 0.03 * ALL, "floor": 0.1, "floor_f": 11.3},
               {("wheel-runout", "w2"), ("bearing-coulomb", "all"),
                ("floor-vibration", "platform")}, None),
    "none": ({}, set(), None),
    "cross (unknown)": ({"cross": 2e4}, None, None),
    "quadratic (unknown)": ({"K2": 5e8 * ONE}, None, None),
    "fading (unknown)": ({"fade": -0.01 * ALL}, None, None),
}  # fmt: skip


def interval(k: int, n: int) -> tuple[float, float]:
    """Exact (Clopper and Pearson) 95 % interval of a rate k/n."""
    low = float(beta.ppf(0.025, k, n - k + 1)) if k else 0.0
    high = float(beta.ppf(0.975, k + 1, n - k)) if k < n else 1.0
    return low, high


def run_one(name: str, seed: int, noise: float) -> dict:
    """Plant, diagnose, and compare."""
    effects, expected, sensor = HIDDEN[name]
    rng = np.random.default_rng([seed, sorted(HIDDEN).index(name), 7])
    stated = plant.tripod(rng)
    truth = plant.Truth(stated, plant.perturbed(rng, stated), effects, (), name, sensor)
    with tempfile.TemporaryDirectory() as folder:
        plant.write_case(Path(folder), truth, rng, (8.0, 8.0, 8.0), noise)
        started = time.process_time()
        found = diagnose(folder)
    got = {(e.id, e.place) for e in found.effects}
    right = found.verdict == "unknown" if expected is None else (
        got == expected and found.verdict == ("named" if expected else "none")
    )  # fmt: skip
    return {"name": name, "seed": seed, "noise": noise, "verdict": found.verdict,
            "right": bool(right),
            "got": sorted(map(list, got)), "seconds": time.process_time() - started,
            "z": pulls(found, effects)}  # fmt: skip


SIZES = {"wheel-runout": ("amplitude", "runout"), "bearing-coulomb": ("torque", "coulomb"),
         "bearing-viscous": ("b", "viscous"), "motor-gain": ("g", "gain"),
         "creep": ("creepage", "creep"),
         "contact-cubic": ("K3", "K3"), "mount-cubic": ("k3", "k3"),
         "mount-backlash": ("gap", "backlash"),
         "rolling-resistance": ("arm", "arm"), "spin-resistance": ("lever", "lever"),
         "air-drag": ("D", "drag"), "motor-ripple": ("amplitude", "ripple")}  # fmt: skip


def pulls(found, effects) -> list[float]:
    """(value - truth)/sigma of the named sizes."""
    out = []
    for e in found.effects:
        key, planted = SIZES.get(e.id, ("", ""))
        if key in e.parameters and planted in effects and e.parameters[key]["sigma"]:
            true = float(np.max(np.abs(effects[planted])))
            out.append((abs(e.parameters[key]["value"]) - true) / e.parameters[key]["sigma"])
    return out


def report(lines: list[dict]) -> None:
    """Rates at each noise with their intervals, and where it breaks down."""
    for noise in sorted({x["noise"] for x in lines}):
        here = [x for x in lines if x["noise"] == noise]
        kinds = {
            "right name": [x for x in here if HIDDEN[x["name"]][1]],
            "no false alarm": [x for x in here if x["name"] == "none"],
            "unknown kept unknown": [x for x in here if HIDDEN[x["name"]][1] is None],
        }
        for kind, some in kinds.items():
            if some:
                k, n = sum(x["right"] for x in some), len(some)
                low, high = interval(k, n)
                print(f"noise x {noise:g}: {kind}: {k}/{n} (95 % interval {low:.3f} to {high:.3f})")
        z = [abs(v) for x in here if x["right"] for v in x["z"]]
        if z:
            print(f"noise x {noise:g}: sizes within 3 sigma: {sum(v < 3 for v in z)}/{len(z)}")
        for x in here:
            if not x["right"]:
                print(f"  {x['name']} (seed {x['seed']}): {x['verdict']} {x['got']}")


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
