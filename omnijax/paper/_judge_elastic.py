"""The claims on the elastic cases."""

import numpy as np

from ..vibration import norm
from ._case import DAMPING, RANGES, ROUNDNESS, SENSITIVITY_DAMPING, STIFFNESS, gap_depths
from ._claim import Claim, Reading, at_least, at_most
from ._cycle import FACTORS
from ._study import PaperStudy

OWN = ROUNDNESS.index(0.4485)
K, C, MOUNT, MOUNT_DAMPING, CLOSURE, ETA = range(len(FACTORS))
SCANNED = {  # metrics of the scans, in the words of the claims
    "peak": "peak |ΔR|",
    "rms": "RMS |ΔR|",
    "elastic_peak": "peak elastic part",
    "elastic_rms": "RMS elastic part",
    "sphere_acceleration_rms": "RMS acceleration of the sphere",
}


def over(study: PaperStudy) -> str:
    """The range of the parameters that the paper does not give, in words."""
    ranges = ", ".join(f"{r.symbol} {r.low:.3g} … {r.high:.3g} {r.unit}" for r in RANGES)
    count = len(next(iter(study.samples.values())))
    return f"{ranges}; {count} points (the rig's own and a Sobol sequence, seed {study.seed})"


def elastic_claims(study: PaperStudy) -> list[Claim]:
    """Every claim that the scans decide."""
    makers = (
        _grows, _frequency, _smaller, _orders, _slightly, _ripple, _dominant, _little, _mount,
    )  # fmt: skip
    return [make(study, over(study)) for make in makers]


def _both(study: PaperStudy, name: str, damping) -> np.ndarray:
    """One metric of both variants over roundness: (model, C, eta, s)."""
    scans = [getattr(study.roundness[model], name) for model in ("paper", "coupled")]
    return np.stack(scans)[:, damping]


def _steps(values: np.ndarray) -> np.ndarray:
    """Relative growth from one roundness to the next."""
    return np.diff(values, axis=-2) / values[..., :-1, :]


def _grows(study: PaperStudy, ranges: str) -> Claim:
    damped, free = slice(1, None), slice(0, 1)
    depth = gap_depths(study.rig)
    growth = "growth of the peak a step of η"
    return Claim(
        "peak-grows",
        "The peak of ΔR grows with the roundness ratio η.",
        "fig12",
        [
            at_least("rigid part", growth, np.diff(depth) / depth[:-1], 0.0),
            at_least("ΔR, C = 8500 and 20000", growth, _steps(_both(study, "peak", damped)), 0.0),
            at_least("ΔR, C = 0", growth, _steps(_both(study, "peak", free)), 0.0),
            at_least(
                "elastic part, C = 8500 and 20000",
                growth,
                _steps(_both(study, "elastic_peak", damped)),
                0.0,
            ),
            at_least(
                "elastic part, C = 0", growth, _steps(_both(study, "elastic_peak", free)), 0.0
            ),
        ],
        f"η from {ROUNDNESS[0]} to {ROUNDNESS[-1]}; {ranges}",
    )


def _frequency(study: PaperStudy, ranges: str) -> Claim:
    def spread(name, damping):
        values = _both(study, name, damping)
        return values.max(axis=-2) / values.min(axis=-2)

    damped = slice(1, None)
    rigid = spread("strongest_rigid", damped)
    strongest = study.roundness["paper"].strongest[1, :, 0]
    return Claim(
        "peak-frequency",
        "The peak frequency does not change with η.",
        "fig13",
        [
            at_most(
                "the frequency at which gaps pass, n ω: the lowest line of the spectrum",
                "largest over smallest frequency",
                spread("lowest", damped),
                1.0 + 1e-9,
            ),
            at_most(
                "the strongest line of ΔR, C = 8500 and 20000",
                "largest over smallest frequency",
                spread("strongest", damped),
                1.0 + 1e-9,
            ),
            at_most(
                "the strongest line of the rigid part",
                "largest over smallest frequency",
                rigid,
                1.0 + 1e-9,
            ),
        ],
        f"η from {ROUNDNESS[0]} to {ROUNDNESS[-1]}; {ranges}",
        {
            "strongest line / rad/s by η, C = 8500": {
                str(eta): float(rate) for eta, rate in zip(ROUNDNESS, strongest, strict=True)
            }
        },
    )


def _ratios(study: PaperStudy) -> dict[str, np.ndarray]:
    """Peaks over the peak of the rigid part, for every damping and point."""
    rigid = np.max(norm(study.elastic[0.0].cycle.rigid))
    printed = [
        np.max(norm(part)) / rigid
        for run in study.elastic.values()
        for part in (run.printed, run.printed_closure)
    ]
    every = slice(None)
    return {
        "printed": np.asarray(printed),
        "elastic": _both(study, "elastic_peak", every)[:, :, OWN] / rigid,
        "total": _both(study, "peak", every)[:, :, OWN] / rigid,
    }


RATIO = "peak over the peak of the rigid part"


def _smaller(study: PaperStudy, ranges: str) -> Claim:
    ratios = _ratios(study)
    return Claim(
        "elastic-smaller",
        "The elastic part is far smaller than the rigid ΔR.",
        "fig11",
        [
            at_most("elastic part, impulses dropped as printed", RATIO, ratios["printed"], 0.1),
            at_most("elastic part, impulses kept", RATIO, ratios["elastic"], 0.1),
            at_most("the total ΔR of eqs. 33-34", RATIO, ratios["total"], 0.1),
        ],
        f"C = 0, 8500, 20000 N s/m; {ranges}",
        {
            f"elastic peak / m, C = {c:g} N s/m": {
                "impulses kept": float(np.max(norm(study.elastic[c].cycle.elastic))),
                "as printed": float(np.max(norm(study.elastic[c].printed))),
                "as printed, closure repels": float(np.max(norm(study.elastic[c].printed_closure))),
            }
            for c in DAMPING
        },
    )


def _orders(study: PaperStudy, ranges: str) -> Claim:
    ratios = _ratios(study)
    return Claim(
        "orders-of-magnitude",
        "With elastic contacts ΔR is several orders of magnitude lower than in the rigid case.",
        "fig11, fig12",
        [
            at_most("the total ΔR of eqs. 33-34", RATIO, ratios["total"], 0.01),
            at_most("its elastic part, impulses kept", RATIO, ratios["elastic"], 0.01),
            at_most(
                "its elastic part, impulses dropped as printed", RATIO, ratios["printed"], 0.01
            ),
        ],
        f"C = 0, 8500, 20000 N s/m; {ranges}",
    )


def _slightly(study: PaperStudy, ranges: str) -> Claim:
    def change(name):
        values = _both(study, name, slice(None))[:, :, OWN]
        return values.max(axis=1) / values.min(axis=1) - 1

    return Claim(
        "damping-magnitude",
        "Damping changes the magnitude only slightly.",
        "fig11, fig12",
        [
            at_most("own rig: peak |ΔR|", "relative change", change("peak")[:, 0], 0.1),
            at_most("whole range: peak |ΔR|", "relative change", change("peak"), 0.1),
            at_most("own rig: elastic part", "relative change", change("elastic_peak")[:, 0], 0.1),
        ],
        f"C from 0 to 20000 N s/m; {ranges}",
    )


def _ripple(study: PaperStudy, ranges: str) -> Claim:
    ripple = _both(study, "ripple", slice(None))[:, :, OWN]
    left = "RMS above 100 rad/s, over that at C = 0"
    return Claim(
        "damping-ripple",
        "Damping removes the high-frequency ripple.",
        "fig11",
        [
            at_most("C = 8500, own rig", left, (ripple[:, 1] / ripple[:, 0])[:, 0], 0.25),
            at_most("C = 20000, own rig", left, (ripple[:, 2] / ripple[:, 0])[:, 0], 0.25),
            at_most("C = 8500, whole range", left, ripple[:, 1] / ripple[:, 0], 0.25),
            at_most("C = 20000, whole range", left, ripple[:, 2] / ripple[:, 0], 0.25),
        ],
        ranges,
        {"ripple at C = 0, 8500, 20000 / m": [float(x) for x in ripple[0, :, 0]]},
    )


def _slopes(study: PaperStudy, name: str) -> np.ndarray:
    """|d log metric / d log factor|, (C, s, factor)."""
    return np.abs(getattr(study.sensitivity, name))


def _damping_words() -> str:
    return ", ".join(f"{c:g}" for c in SENSITIVITY_DAMPING)


def _dominant(study: PaperStudy, ranges: str) -> Claim:
    readings: list[Reading] = []
    for name, words in SCANNED.items():
        slopes = _slopes(study, name)
        alone = slopes[..., K] / np.max(slopes[..., [C, MOUNT, MOUNT_DAMPING]], axis=-1)
        every = slopes[..., K] / np.max(slopes[..., [C, MOUNT, MOUNT_DAMPING, CLOSURE]], axis=-1)
        text = f"{words}: |d log/d log K| over the largest of"
        readings.append(at_least(f"{text} C, k, c; own rig, C = 120", "ratio", alone[0, 0], 1.0))
        readings.append(at_least(f"{text} C, k, c, K'; whole range", "ratio", every, 1.0))
    return Claim(
        "stiffness-dominant",
        "The contact stiffness K is dominant.",
        "fig14",
        readings,
        f"C = {_damping_words()} N s/m; {ranges}",
        {"d log/d log K, own rig": _table(study, K)},
    )


def _little(study: PaperStudy, ranges: str) -> Claim:
    readings = []
    for name, words in SCANNED.items():
        slopes = _slopes(study, name)[..., K]
        text = f"{words}: C = 8500 and 20000"
        readings.append(at_most(f"{text}, whole range", "|d log/d log K|", slopes[1:], 0.1))
        readings.append(
            at_most(f"{words}: C = 120, whole range", "|d log/d log K|", slopes[0], 0.1)
        )
    peak = study.stiffness["paper"].peak[:, :, 0]
    return Claim(
        "stiffness-little",
        "The results varied little with the contact stiffness K.",
        "fig14",
        readings,
        f"C = {_damping_words()} N s/m; {ranges}",
        {
            f"peak |ΔR|, largest/smallest, K {STIFFNESS[0]:.3g} … {STIFFNESS[-1]:.3g} N/m": {
                f"C = {c:g}": float(peak[i].max() / peak[i].min()) for i, c in enumerate(DAMPING)
            }
        },
    )


def _mount(study: PaperStudy, ranges: str) -> Claim:
    return Claim(
        "mount-minor",
        "The stiffness k of the mounts is of minor influence.",
        "fig14",
        [
            at_most(words, "|d log/d log k|", _slopes(study, name)[..., MOUNT], 0.1)
            for name, words in SCANNED.items()
        ],
        f"C = {_damping_words()} N s/m; {ranges}",
        {"d log/d log k, own rig": _table(study, MOUNT)},
    )


def _table(study: PaperStudy, factor: int) -> dict[str, dict[str, float]]:
    return {
        words: {
            f"C = {c:g}": float(getattr(study.sensitivity, name)[i, 0, factor])
            for i, c in enumerate(SENSITIVITY_DAMPING)
        }
        for name, words in SCANNED.items()
    }
