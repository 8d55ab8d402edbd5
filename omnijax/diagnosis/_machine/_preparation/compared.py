"""How much of what was measured is compared: said where it is less, refused where it is nothing."""

from collections.abc import Iterable

import numpy as np

from ...._errors import InputError
from ....recording import channels
from ..._settings import SETTINGS
from ..machine import Machine

TOLD_SHARE = SETTINGS.compared.told_share
LEAST_SHARE = SETTINGS.compared.least_share
GROUPS = ("dR", "a", "Omega", "theta")  # in the order of the rows' tables


def compared(machine: Machine, which: Iterable[int]) -> dict[str, float]:
    """By channel that some of the runs `which` measured, the share of their samples in use.

    A run that is split into a fitted and a held-out part counts as far as it plays either role.
    """
    used: dict[str, float] = {}
    samples: dict[str, float] = {}
    for i in which:
        run, rows = machine.runs[i], machine.rows[i]
        counts = np.ones(run.samples, bool) if run.counts is None else run.counts
        weights = np.concatenate([rows.elastic, rows.rotation], axis=1)[counts]
        names = [c for group in GROUPS for c in channels(group, machine.rig.size)]
        measured = {
            name for group, values in run.outputs.items()
            for name, x in zip(channels(group, machine.rig.size), values.T, strict=True)
            if np.isfinite(x).any()
        }  # fmt: skip
        for name, weight in zip(names, weights.T, strict=True):
            if name in measured:
                used[name] = used.get(name, 0) + np.count_nonzero(weight)
                samples[name] = samples.get(name, 0) + len(weight)
    return {name: used[name] / max(samples[name], 1) for name in used}


def check_compared(machine: Machine, splits: dict[str, list[int]]) -> None:
    """`InputError` where next to nothing of the fitted or of the held-out runs can be compared."""
    for split, words in (("train", "fitted"), ("held-out", "held-out")):
        most = max(compared(machine, splits[split]).values(), default=0.0)
        if most < LEAST_SHARE:
            names = dict.fromkeys(machine.runs[i].name for i in splits[split])
            raise InputError(
                f"{', '.join(names)}: of no channel of the {words} runs can more than "
                f"{100 * most:.2g} % of the samples be compared, as inputs or outputs are missing "
                "there or shortly before."
            )


def said_of_compared(machine: Machine) -> list[str]:
    """A sentence for every run of which some channel is compared at clearly less than all times."""
    by_run: dict[str, list[int]] = {}
    for i, run in enumerate(machine.runs):
        by_run.setdefault(run.name, []).append(i)
    out = []
    for name, which in by_run.items():
        little: dict[str, list[str]] = {}
        for channel, share in compared(machine, which).items():
            if share < TOLD_SHARE:
                said = f"{100 * share:.0f} % of the samples" if share else "nothing"
                little.setdefault(said, []).append(channel)
        if little:
            parts = [f"{said} of {', '.join(some)}" for said, some in little.items()]
            out.append(f"{name}: compared is {'; '.join(parts)}.")
    return out
