"""What friction does the baseline of a measured motor-and-screw axis lack?

EMPS: A. Janot, M. Gautier, M. Brunot, "Data Set and Reference Models of EMPS", Nonlinear System
Identification Benchmarks workshop, 2019.  Baseline: M q'' + Fv q' + offset = force.
Answer, unaided: Coulomb friction, then its asymmetry.
"""

import sys
from pathlib import Path

import numpy as np
from scipy.io import loadmat
from scipy.signal import butter, decimate, filtfilt

from omnijax.diagnosis import Prior, Search, SmallModel, along
from omnijax.laws import EFFECTS, GENERIC, ShaftSignal

DATA = Path(__file__).parents[1] / ".." / "shared" / "realdata" / "emps"
GAIN = 35.1507  # N/V
SPLITS = {"train": "DATA_EMPS.mat", "held-out": "DATA_EMPS_PULSES.mat"}
LAWS = ("bearing-coulomb", "motor-gain", "friction-asymmetry", "shaft-drag", "shaft-spring")


def load(path: Path) -> dict[str, np.ndarray]:
    """Position (zero-phase 100 Hz low pass), its derivatives, and the force."""
    data = loadmat(path)
    t, q, force = (np.ravel(data[k]).astype(float) for k in ("t", "qm", "vir"))
    step = t[1] - t[0]
    b, a = butter(4, 100 * 2 * step)
    q = filtfilt(b, a, q)
    speed = np.gradient(q, step)
    out = {"q": q, "v": speed, "a": np.gradient(speed, step), "force": GAIN * force}
    return out


def thin(x: np.ndarray) -> np.ndarray:
    """Every tenth sample, low-passed first: both sides of the balance alike."""
    return decimate(x, 10, zero_phase=True)[10:-10]


def quiet(force: np.ndarray) -> float:
    """1-sigma of the force's noise from its quietest stretches of 20 samples."""
    level = np.diff(force, 3)[: len(force) // 20 * 20 - 20].reshape(-1, 20)
    return float(np.sqrt(np.quantile(np.mean(level**2, axis=1), 0.1) / 20))


def model(folder: Path) -> tuple[SmallModel, dict]:
    """The force balance as a model: 10 lines, its friction laws those of a wheel's shaft."""
    sets = {s: load(folder / name) for s, name in SPLITS.items()}
    noise = quiet(thin(sets["train"]["force"]))

    def residual(p, laws, split):
        d = sets[split]
        signal = ShaftSignal(d["q"], d["v"], d["force"])
        force = d["force"] + sum(along(law, signal) for law in laws)
        return thin(force - p["M"] * d["a"] - p["Fv"] * d["v"] - p["offset"]) / noise

    priors = [Prior("M", 100.0, 1.0, unit="kg"), Prior("Fv", 300.0, 1.0, unit="N s/m"),
              Prior("offset", 0.0, 20.0, relative=False, unit="N")]  # fmt: skip
    laws = {k: v for k, v in {**EFFECTS, **GENERIC}.items() if k in LAWS}
    return SmallModel(
        residual, priors, laws, "axis", {("bearing-coulomb", "width"): [1e-4, 3e-4, 1e-3, 3e-3]}
    ), sets


def main(folder: Path = DATA, tell=print) -> dict[str, float]:
    """Search, print, and return relative force errors in per cent."""
    built, sets = model(folder)
    noise = quiet(thin(sets["train"]["force"]))
    found = Search(built, tell).run()

    def error(point, split):
        (r,) = built.residuals([point], split)
        return 100 * noise * np.linalg.norm(r) / np.linalg.norm(thin(sets[split]["force"]))

    before, after = found.baseline.point, found.fit.point
    names = [t[0].effect.id for t in found.trials if t]
    result = {"baseline train": error(before, "train"), "train": error(after, "train"),
              "cross-test": error(after, "held-out")}  # fmt: skip
    tell(f"accepted in this order: {', '.join(names[: len(after.effects)])}")
    for prior, u in zip(built.priors, after.u, strict=True):
        tell(f"{prior.name} = {prior.at(float(u)):.4g} {prior.unit}")
    for effect in after.effects:
        tell(f"{effect.name}: {effect.values}")
    for key, value in result.items():
        tell(f"{key}: {value:.3f} %")
    return result | {"order": names}


if __name__ == "__main__":
    if not DATA.is_dir():
        sys.exit(f"{DATA} is absent: this experiment needs the measured data.")
    answer = main()
    assert answer["order"][0] == "bearing-coulomb", answer
    assert "friction-asymmetry" in answer["order"], answer
    assert answer["train"] <= 3.2, answer
    assert answer["cross-test"] <= 5.5, answer
