"""Tables of the answers: rates with exact intervals, detection curve, calibration."""

from collections import defaultdict
from itertools import groupby, pairwise

import numpy as np
from scipy.stats import kstest

from .._lines import rate
from .answers import rank
from .cases import SIZES

SINCE = 227  # seed from which plants and answers are drawn and judged as they are now
BINS = (0.0, 0.18, 0.35, 0.7, 1.4, 2.8, np.inf)  # of what shows, in sigma, about the sizes drawn


def report(lines: list[dict]) -> str:
    """Everything as Markdown; rates of the lines that are judged as now beside those of all."""
    new = [x for x in lines if x["seed"] >= SINCE]
    rates = _rates(lines)
    if 0 < len(new) < len(lines):
        head, *rows = (a + b.split("|", 2)[2] for a, b in zip(rates, _rates(new), strict=True))
        rates = [head.replace("cases", "all", 1).replace("cases", f"from seed {SINCE} on"), *rows]
    parts = rates, _curve(lines), _calibration(lines), _runs(lines), _misses(lines)
    return "\n\n".join("\n".join(part) for part in parts)


def _sizes(line: dict) -> list[float]:
    """Visible sizes by effect: less than was drawn where a size was cut off at what is sensible, or
    where the first run does not show it."""
    factors = line["factors"]
    return [
        f if shown >= 0.7 * f else max((s for s in SIZES if s <= 1.3 * shown), default=0.0)
        for f, shown in zip(factors, line.get("taught", factors), strict=True)
    ]


def _rates(lines: list[dict]) -> list[str]:
    def of(*kinds, test=lambda x: True):
        return [x for x in lines if x["kind"] in kinds and test(x)]

    def least(x):
        return min([*_sizes(x), 1.05 * x["shows"]])

    def alone(x):
        return x["right"] and x["verdict"] == "named"

    named = ("one", "several")
    quiet = [x for x in lines if x["kind"] == "none" and x["noise"] == ["right", "none"]]
    wrong = [x["verdict"] in ("named", "ambiguous") for x in of("unknown")]
    values = [v for x in of(*named) for v in x["compared"].values() if v["z"] is not None]
    signs = [v["value"] * v["true"] > 0 for x in of(*named)
             for k, v in x["compared"].items() if v["true"] and "phase" not in k]  # fmt: skip
    false = [x["verdict"] in ("named", "ambiguous") for x in of("none")]
    return [
        "| figure | cases | 95 % interval |", "| --- | --- | --- |",
        rate("`none` kept", (x["right"] for x in of("none"))),
        rate("`none` kept, right noise, no sensor fault", (x["right"] for x in quiet)),
        rate("false alarms (something named)", false),
        rate("named right, every size", map(alone, of(*named))),
        rate("named right, visible size and above",
             map(alone, of(*named, test=lambda x: least(x) >= 1))),
        rate("... or ambiguous, where the data cannot tell",
             (x["right"] for x in of(*named, test=lambda x: least(x) >= 1))),
        rate("named right, half the visible size",
             map(alone, of(*named, test=lambda x: least(x) == 0.5))),
        rate("named right, one effect at the visible size and above",
             map(alone, of("one", test=lambda x: least(x) >= 1))),
        rate("a wrong name among the answers, whatever was hidden",
             ([e for e in x["got"] if e not in _pairs(x)] != [] for x in of(*named, "none"))),
        rate("`unknown` kept", (x["right"] for x in of("unknown"))),
        rate("outside the library, yet named", wrong),
        rate("`ambiguous` recognised", (x["right"] for x in of("ambiguous"))),
        rate("... but for a radius that is named `creep`, with the radius beside it",
             (x["right"] and not _by_twin(x) for x in of("ambiguous"))),
        rate("numbers within 3 sigma", (abs(v["z"]) < 3 for v in values)),
        rate("sign right", signs),
    ]  # fmt: skip


def _by_twin(x: dict) -> bool:
    """Whether another law is named, and the hidden one listed as what it is not told from."""
    return x["verdict"] == "named" and not all(pair in x["got"] for pair in _pairs(x))


def _pairs(x: dict) -> list[list[str]]:
    return [[h["id"], h["place"]] for h in x["hidden"]]


def _curve(lines: list[dict]) -> list[str]:
    out = ["| one effect, RMS it adds in the group that shows it most | right name | 95 % |",
           "| --- | --- | --- |"]  # fmt: skip
    for low, high in pairwise(BINS):
        here = [x["right"] for x in lines if x["kind"] == "one" and low <= x["shows"] < high]
        out.append(rate(f"{low:g} to {high:g} sigma", here))
    return out


def _calibration(lines: list[dict]) -> list[str]:
    held = [limit >= true for x in lines for _, limit, true in x["limits"]]
    ranks = defaultdict(list)
    for x in lines:
        for key, v in x["compared"].items():
            if v["z"] is not None:
                ranks[key.split()[0]].append(rank(v["z"]))
    null = [p for x in lines if x["kind"] == "none" for p in x["p"]]
    out = ["| calibration | cases | 95 % interval |", "| --- | --- | --- |",
           rate("true size below its 95 % limit (effects that were not named)", held)]  # fmt: skip
    whole = [r for some in ranks.values() for r in some]
    tests = {"all": whole, **{k: v for k, v in ranks.items() if len(v) >= 10}}
    p = [float(kstest(v, "uniform").pvalue) for v in tests.values() if v]
    if whole:
        holm = holms(np.array(p))
        worst = int(np.argmin(holm))
        name = list(tests)[worst]
        out.append(
            f"| ranks of {len(whole)} true numbers uniform (Kolmogorov and Smirnov, Holm) "
            f"| p = {holm[0]:.2g}; least of {len(p)}: {holm[worst]:.2g} ({name}) | |"
        )
    if null:
        out.append(f"| p-values of {len(null)} null candidates uniform "
                   f"| p = {float(kstest(null, 'uniform').pvalue):.2g} | |")  # fmt: skip
        out.append(rate("... below 0.05", (p < 0.05 for p in null)))
    seconds = [x["cpu"] for x in lines]
    out.append(f"| CPU a case | median {np.median(seconds):.0f} s, worst {max(seconds):.0f} s | |")
    return out


def holms(p: np.ndarray) -> np.ndarray:
    """Holm's p-values of several tests."""
    order = np.argsort(p)
    out = np.empty(len(p))
    out[order] = np.minimum(1, np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1)))
    return out


def _runs(lines: list[dict]) -> list[str]:
    """What was answered together: by which state, how often rightly, and which not."""
    out = ["| seeds | answered by | right | 95 % | not right | CPU a case, s |",
           "| --- | --- | --- | --- | --- | --- |"]  # fmt: skip
    for commit, group in groupby(lines, key=lambda x: x["commit"]):
        some = list(group)
        row = rate(f"{_ranges([x['seed'] for x in some])} | {commit}", (x["right"] for x in some))
        wrong = ", ".join(str(x["seed"]) for x in some if not x["right"])
        seconds = [x["cpu"] for x in some]
        out.append(f"{row} {wrong} | {np.median(seconds):.0f}, worst {max(seconds):.0f} |")
    return out


def _ranges(seeds: list[int], apart: int = 20) -> str:
    """`427 to 434, 720 to 729`: first and last of seeds that follow each other, in their order."""
    ends = [i + 1 for i, (a, b) in enumerate(pairwise(seeds)) if not 0 < b - a < apart]
    parts = pairwise([0, *ends, len(seeds)])
    return ", ".join(
        f"{seeds[i]} to {seeds[j - 1]}" if j - i > 1 else str(seeds[i]) for i, j in parts
    )


def _misses(lines: list[dict]) -> list[str]:
    out = []
    for x in lines:
        far = {k: v["z"] for k, v in x["compared"].items() if v["z"] and abs(v["z"]) >= 3}
        if x["right"] and not far:
            continue
        hidden = " + ".join(f"{h['id']}@{h['place']} ({f:g})"
                            for h, f in zip(x["hidden"], x["factors"], strict=True))  # fmt: skip
        got = " + ".join(f"{i}@{p}" for i, p in x["got"])
        out.append(
            f"- {x['seed']} {x['kind']}: {hidden or 'nothing'}, shows {x['shows']:g} sigma, "
            f"noise {'/'.join(x['noise'])}: {x['verdict']} {got} {far or ''} {x['why']}"
        )
    return out
