"""Every number behind the page: the ideal runs, the cycles, the scans and the sensitivities."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..rig import Rig
from ._case import DAMPING, ROUNDNESS, SENSITIVITY_DAMPING, STIFFNESS, baseline, changed, samples
from ._cycle import (
    HARMONICS,
    TRACE_POINTS,
    CycleTrace,
    Metrics,
    from_rest,
    metrics_over,
    pointwise_elastic,
    sensitivities_over,
)
from ._ideal import Ideal, ideal_runs


class Elastic(NamedTuple):
    """One damping: the long-run cycle, the first period from rest, and the printed form."""

    cycle: CycleTrace
    rest: CycleTrace
    printed: np.ndarray  # (t, 3) m, elastic part, r_w'' at points, the closure as it should be
    printed_closure: np.ndarray  # (t, 3) m, and the closure's sign as printed


class PaperStudy(NamedTuple):
    """Axes of the scans: damping, scanned value, sample of the parameters that are not given."""

    rig: Rig
    samples: dict[str, Float[Array, " s"]]
    seed: int
    ideal: Ideal
    elastic: dict[float, Elastic]
    roundness: dict[str, Metrics]  # by model, (C, eta, s)
    stiffness: dict[str, Metrics]  # by model, (C, K, s)
    sensitivity: Metrics  # (C, s, factor)


def make_study(
    count: int = 4,
    seed: int = 0,
    harmonics: int = HARMONICS,
    say: Callable[[str], None] = lambda _: None,
) -> PaperStudy:
    """Compute everything; `count` samples beside the rig's own, `say` hears each step's name."""
    rig = baseline()
    drawn = samples(rig, count, seed)
    say("ideal case")
    ideal = ideal_runs(rig)
    say("elastic case")
    elastic = {damping: _elastic(rig, damping, harmonics) for damping in DAMPING}
    scans = {}
    for model in ("paper", "coupled"):
        say(f"scans over roundness and stiffness ({model} equations)")
        scans[model] = _scans(rig, drawn, model, harmonics)
    say("exact derivatives")
    rows = _rows(drawn, "wheel.contact.damping", SENSITIVITY_DAMPING)
    slopes = sensitivities_over(rig, rows, "paper", harmonics)
    shape = (len(SENSITIVITY_DAMPING), count + 1, -1)
    return PaperStudy(
        rig,
        drawn,
        seed,
        ideal,
        elastic,
        {model: scan[0] for model, scan in scans.items()},
        {model: scan[1] for model, scan in scans.items()},
        jax.tree.map(lambda x: np.asarray(x).reshape(shape), slopes),
    )


def _elastic(rig: Rig, damping: float, harmonics: int) -> Elastic:
    machine = changed(rig, {"wheel.contact.damping": damping})
    points = TRACE_POINTS * min(harmonics, HARMONICS) // HARMONICS
    points -= points % 48  # a whole number of points for every wheel's own period
    run = from_rest(machine, points)
    signs = (pointwise_elastic(machine, sign, harmonics, points) for sign in (1, -1))
    return Elastic(*run, *(np.asarray(part) for part in signs))


def _rows(drawn, path: str, scanned) -> dict[str, Array]:
    """`scanned` outside, the samples inside."""
    count = len(next(iter(drawn.values())))
    rows = {key: jnp.tile(value, len(scanned)) for key, value in drawn.items()}
    return rows | {path: jnp.repeat(jnp.asarray(scanned), count)}


def _scans(rig: Rig, drawn, model: str, harmonics: int) -> tuple[Metrics, Metrics]:
    """Metrics over roundness and over stiffness, in one compiled program."""
    by_eta = _damped(_rows(drawn, "wheel.roundness", ROUNDNESS))
    by_stiffness = _damped(_rows(drawn, "wheel.contact.stiffness", STIFFNESS))
    own = {
        "wheel.roundness": rig.wheels.roundness[0],
        "wheel.contact.stiffness": rig.wheels.contact.stiffness[0],
    }
    rows = {
        path: jnp.concatenate(
            [
                part[path] if path in part else jnp.full(_length(part), own[path])
                for part in (by_eta, by_stiffness)
            ]
        )
        for path in by_eta | by_stiffness
    }
    figures = jax.tree.map(np.asarray, metrics_over(rig, rows, model, harmonics))
    split, count = _length(by_eta), len(next(iter(drawn.values())))

    def part(index, scanned):
        shape = (len(DAMPING), len(scanned), count)
        return jax.tree.map(lambda x: x[index].reshape(shape), figures)

    return part(slice(0, split), ROUNDNESS), part(slice(split, None), STIFFNESS)


def _length(rows) -> int:
    return len(next(iter(rows.values())))


def _damped(rows) -> dict[str, Array]:
    """`rows` once for every damping of the paper."""
    size = _length(rows)
    tiled = {path: jnp.tile(value, len(DAMPING)) for path, value in rows.items()}
    return tiled | {"wheel.contact.damping": jnp.repeat(jnp.asarray(DAMPING), size)}
