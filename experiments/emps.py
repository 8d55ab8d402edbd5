"""What friction does the baseline of a measured motor-and-screw axis lack?

EMPS: A. Janot, M. Gautier, M. Brunot, "Data Set and Reference Models of EMPS", Nonlinear System
Identification Benchmarks workshop, 2019.  Baseline: M q'' + Fv q' + offset = force.

Candidates are all laws of the library that act on a shaft.  (Laws of sensors are none: the output
is derived from the encoder, and a gain of the acceleration is a change of the mass.)  The first
two thirds of the estimation file train, its last third accepts; then everything is refitted on the
whole file, and the file with pulses is predicted.  Nothing is chosen by it here; while this script
was written its error was seen for two earlier versions too.  Filter and decimation are those
published with the data.
"""

import sys
from pathlib import Path

import numpy as np
from measured import describe, floor, laws_at, rms, search
from scipy.io import loadmat
from scipy.signal import butter, decimate, filtfilt

from omnijax.diagnosis import Prior, SmallModel, along
from omnijax.laws import ShaftSignal

DATA = Path(__file__).parents[1] / ".." / "shared" / "realdata" / "emps"
GAIN = 35.1507  # N/V
EDGE = 100  # samples that the filter spoils


def load(path: Path) -> dict[str, np.ndarray]:
    """Position (zero-phase 100 Hz low pass), its derivatives, and the force."""
    data = loadmat(path)
    t, q, force = (np.ravel(data[k]).astype(float) for k in ("t", "qm", "vir"))
    step = t[1] - t[0]
    b, a = butter(4, 100 * 2 * step)
    q = filtfilt(b, a, q)
    v = np.gradient(q, step)
    return {"t": t, "q": q, "v": v, "a": np.gradient(v, step), "force": GAIN * force}


def splits(data: dict[str, np.ndarray]) -> dict[str, dict[str, np.ndarray]]:
    """The training file whole, and in two parts."""
    cut = len(data["t"]) * 2 // 3
    parts = {"whole": slice(None), "train": slice(None, cut), "held-out": slice(cut, None)}
    return {name: {k: x[part] for k, x in data.items()} for name, part in parts.items()}


def thin(x: np.ndarray) -> np.ndarray:
    """Every tenth sample, low-passed first: both sides of the balance alike."""
    return decimate(x, 10, zero_phase=True)[EDGE // 10 : -EDGE // 10]


def axis(sets: dict, noise: float) -> SmallModel:
    """The axis as a model; its laws are those of a wheel's shaft.

    Measured position and speed, and the force, give the acceleration: it is what is predicted.
    """

    def residual(p, laws, split):
        d = sets[split]
        shaft = ShaftSignal(d["q"], d["v"], d["force"])
        force = d["force"] + sum(along(x, shaft) for x in laws)
        return thin(d["a"] - (force - p["Fv"] * d["v"] - p["offset"]) / p["M"]) / noise

    priors = [Prior("M", 100.0, 1.0, unit="kg"), Prior("Fv", 300.0, 1.0, unit="N s/m"),
              Prior("offset", 0.0, 20.0, relative=False, unit="N")]  # fmt: skip
    d = sets["train"]
    speed, travel = np.std(d["v"]), np.ptp(d["q"])
    constants = {
        ("bearing-coulomb", "width"): speed * np.array([0.003, 0.01, 0.03, 0.1, 0.3]),
        ("motor-ripple", "order"): 2 * np.pi / travel * np.arange(1, 41),
    }
    return SmallModel(residual, priors, laws_at("shaft"), "axis", constants)


def main(folder: Path = DATA, tell=print) -> dict:
    """Search, print, and return relative force errors in per cent."""
    sets = splits(load(folder / "DATA_EMPS.mat"))
    noise = floor(thin(sets["train"]["a"]))
    built = axis(sets, noise)
    baseline, point, order = search(built, tell)
    describe(built, point, tell)
    sets["test"] = load(folder / "DATA_EMPS_PULSES.mat")

    def error(at, split):
        mass = built.priors[0].at(float(at.u[0]))
        force = thin(sets[split]["force"])
        return 100 * mass * noise * rms(built, at, split) / float(np.sqrt(np.mean(force**2)))

    result = {"baseline train": error(baseline, "whole"), "train": error(point, "whole"),
              "baseline cross-test": error(baseline, "test"),
              "cross-test": error(point, "test")}  # fmt: skip
    for key, value in result.items():
        tell(f"{key}: {value:.3f} %")
    return result | {"order": order}


if __name__ == "__main__":
    if not DATA.is_dir():
        sys.exit(f"{DATA} is absent: this experiment needs the measured data.")
    answer = main()
    assert answer["order"][0] == "bearing-coulomb", answer
    assert "friction-asymmetry" in answer["order"], answer
    assert answer["train"] <= 3.2, answer
    assert answer["cross-test"] <= 5.5, answer
