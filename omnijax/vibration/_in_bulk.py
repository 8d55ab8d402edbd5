"""Metrics of many runs and steady states that the modal core gives, with exact derivatives."""

from collections.abc import Callable, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._programs import kept
from ..rig import Rig
from ..simulation import (
    FilterPoles,
    ModalFigures,
    Operating,
    SteadyFigures,
    channels_of,
    modal_runs,
    modal_steady,
)
from ._comfort import upright_filters
from ._metrics import METRICS, STEADY_METRICS, evaluate

BULK_STEADY_METRICS = tuple(name for name in STEADY_METRICS if name != "smooth_peak")
MARGINS = ("lift_off_margin", "slip_margin")  # N, which say how a run ends


def run_metrics(
    make: Callable[[Array], Operating],
    rows: Float[Array | np.ndarray, "B d"],
    names: Sequence[str],
    *,
    duration: float,
    step: float,
    model: str = "coupled",
    gradient: bool = False,
    total: int = 0,
) -> ModalFigures:
    """Any metrics of the designs `make(row)`, as `evaluate` reads them from runs.

    As `simulation.modal_figures`, which is faster for what it gives; the margins are exact.
    """
    values, slopes, holds = [], [], []
    for runs in modal_runs(make, rows, duration=duration, step=step, model=model, total=total):
        told, parts = {"effort": runs.effort}, {name: ([], []) for name in names}
        for group in runs:
            given = group.outputs, group.rigs, runs.step, runs.samples
            figures = _values(*given, (*names, *MARGINS), **told)
            values.append(np.asarray(figures)[: group.wanted])
            for name, (bars, rigs) in parts.items() if gradient else ():
                weights, by_rigs = _weights(*given, name, **told)
                bars.append(runs.bars(group, weights))
                rigs.append(by_rigs)
        holds.append(runs.held())
        if gradient:
            slopes.append(np.stack([runs.slopes(*parts[name]) for name in names], axis=1))
    *figures, normal, slip = np.concatenate(values).T
    return ModalFigures(
        np.stack(figures, axis=1),
        np.concatenate(slopes) if gradient else None,
        normal,
        slip,
        np.concatenate(holds),
    )


class SteadyTable(eqx.Module):
    """Some of `BULK_STEADY_METRICS`, as the modal core asks for them."""

    names: tuple[str, ...] = eqx.field(static=True)
    filters: FilterPoles | None

    def metric(self, name: str, run: SteadyFigures) -> Float[Array, ""]:
        """One of them."""
        of_steady = METRICS[name].of_steady
        assert of_steady is not None
        return of_steady(run)


def long_run_metrics(
    make: Callable[[Array], Operating],
    rows: Float[Array | np.ndarray, "B d"],
    names: Sequence[str],
    *,
    model: str = "coupled",
    gradient: bool = False,
    total: int = 0,
) -> ModalFigures:
    """Any of `BULK_STEADY_METRICS` of the designs `make(row)`, as `steady_metrics` gives them.

    As `simulation.modal_steady`.  Raises `ValueError` for other metrics.
    """
    if others := [name for name in names if name not in BULK_STEADY_METRICS]:
        raise ValueError(f"the modal core does not give {', '.join(others)} of the long run.")
    filters = upright_filters() if "sphere_weighted_acceleration" in names else None
    table = SteadyTable(tuple(names), filters)
    return modal_steady(make, rows, table, model=model, gradient=gradient, total=total)


def _read(outputs, rig: Rig, step, samples: int, names: tuple[str, ...]) -> Float[Array, " m"]:
    """Metrics of one run from its outputs, (o, length)."""
    run = channels_of(outputs[:, :samples], rig, step)
    by_name = evaluate(run, rig, names)
    return jnp.stack([by_name[name] for name in names])


@kept
def _values(outputs, rigs: Rig, step, samples: int, names: tuple[str, ...]):
    return jax.vmap(lambda x, rig: _read(x, rig, step, samples, names))(outputs, rigs)


@kept
def _weights(outputs, rigs: Rig, step, samples: int, name: str):
    """Derivatives of a metric by the outputs, (B, o, length), and by the rigs."""

    def one(x, rig):
        moving, still = eqx.partition(rig, eqx.is_inexact_array)

        def figure(x, moving):
            return _read(x, eqx.combine(moving, still), step, samples, (name,))[0]

        return jax.grad(figure, argnums=(0, 1))(x, moving)

    return jax.vmap(one)(outputs, rigs)
