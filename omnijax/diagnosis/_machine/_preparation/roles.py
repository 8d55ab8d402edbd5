"""Which runs teach and which confirm; one run alone plays both roles by parts.

So do fitted runs beside held-out ones, where these cannot tell what the fitted ones show.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from ...._errors import InputError
from ...._text import listed
from ....recording import channels
from ..._settings import SETTINGS
from ..runs import Run
from .start_angles import without_encoder

BLOCK = SETTINGS.roles.block
SHORTEST_BLOCK = SETTINGS.roles.shortest_block
TEACHING_BLOCKS = SETTINGS.roles.teaching_blocks
FEWEST_BLOCKS = SETTINGS.roles.fewest_blocks


def that_tell_their_motion(
    runs: Sequence[Run], constant: Mapping[str, Sequence[str]] = MappingProxyType({})
) -> tuple[list[Run], list[str]]:
    """(the runs whose motion was measured, what is to be said of the others).

    `constant` are the columns by run's name that never change: they were measured, by sensors that
    stand still, and are not used.
    """
    said = [
        f"{run.name}: {_without_motion(silent, constant.get(run.name, ()))}, so its motion is not "
        "known; the run is not used."
        for run in runs if (silent := _silent(run))
    ]  # fmt: skip
    return [run for run in runs if not _silent(run)], said


def _without_motion(silent: Sequence[str], constant: Sequence[str]) -> str:
    """Why columns of angles, and Omega, do not tell the motion of a run."""
    still = [c for c in constant if c in silent or c.partition("_")[0] == "Omega"]
    if not still:
        return f"neither Omega nor {', '.join(silent)} was measured"
    never = f"{listed(still)} never {'changes' if len(still) == 1 else 'change'}"
    missing = [c for c in silent if c not in still]
    if not any(c.startswith("Omega") for c in still):
        missing = ["Omega", *missing]
    return f"{never}, as of sensors that stand still" + (
        f", and {listed(missing)} {'was' if len(missing) == 1 else 'were'} not measured"
        if missing else ""
    )  # fmt: skip


def _silent(run: Run) -> list[str]:
    """Columns of the wheels whose motion nothing tells: neither their angle nor Omega."""
    names = channels("theta", run.torque.shape[1])
    return [] if "Omega" in run.outputs else [names[k] for k in without_encoder(run, len(names))]


def with_roles(runs: list[Run], unusable: Sequence[str] = ()) -> tuple[list[Run], str, list[str]]:
    """(the runs, each of one role; on what an effect is confirmed; what is to be said of it).

    Raises `InputError` where there is none, or every one is held out, for a held-out run is never
    fitted; it says as well which runs are `unusable`, and why.
    """
    if not runs:
        raise InputError(["No run is left that can be used.", *unusable])
    held = [r for r in runs if r.role == "held-out"]
    if len(held) == len(runs):
        which = "every run that can be used" if unusable else "every run"
        told = (
            f"{', '.join(r.name for r in runs)}: {which} has the role `held-out`, which is never "
            'fitted; give one run at least `role = "train"`.'
        )
        raise InputError([told, *unusable])
    if held:
        return runs, "held-out", []
    if len(runs) > 1:
        last = runs[-1]
        said = f"{last.name}: no run has the role held-out, so the last one is kept out of the fit."
        return [*runs[:-1], dataclasses.replace(last, role="held-out")], "held-out", [said]
    (only,) = runs
    seconds, parts = _seconds(only), _parted(only)
    if not parts:
        said = (
            f"{only.name}: the only run is shorter than {FEWEST_BLOCKS * SHORTEST_BLOCK:g} s, so "
            "nothing is kept out of the fit, and no run confirms what is named."
        )
        return runs, "nothing", [said]
    said = (
        f"{only.name}: the only run; every third part of {seconds:.2g} s of it is kept out of the "
        "fit and confirms what is named."
    )
    return parts, "blocks", [said]


def by_parts(runs: list[Run]) -> tuple[list[Run], list[str]]:
    """(fitted runs by parts, before the held-out runs as they are; what is to be said of it).

    Those too short to be parted are fitted whole.  Where all are, nothing is said.
    """
    out, said = [], []
    for run in (r for r in runs if r.role != "held-out"):
        parts = _parted(run)
        out += parts or [run]
        if parts:
            said.append(
                f"{run.name}: every third part of {_seconds(run):.2g} s of it is kept out of the "
                "fit too, and confirms what is named."
            )
    return [*out, *(r for r in runs if r.role == "held-out")], said


def _seconds(run: Run) -> float:
    """How long a block is: a second, of a short run a sixth of it."""
    return min(BLOCK, run.samples * run.step / FEWEST_BLOCKS)


def _parted(run: Run) -> list[Run]:
    """A run twice: in one copy two blocks of three count, in the other the third.

    Empty for a run that is too short.
    """
    seconds = _seconds(run)
    if seconds < SHORTEST_BLOCK:
        return []
    block = np.arange(run.samples) // max(1, round(seconds / run.step))
    teaches = block % (TEACHING_BLOCKS + 1) < TEACHING_BLOCKS
    parts = (("train", teaches), ("held-out", ~teaches))
    return [dataclasses.replace(run, role=r, counts=c) for r, c in parts]


def split_runs(runs: list[Run]) -> dict[str, list[int]]:
    """Indices of train and held-out runs; of one run alone both are that run (see `with_roles`)."""
    held = [i for i, r in enumerate(runs) if r.role == "held-out"]
    train = [i for i, r in enumerate(runs) if r.role != "held-out"]
    if not held and len(train) > 1:
        train, held = train[:-1], train[-1:]
    return {"train": train or held, "held-out": held or train}
