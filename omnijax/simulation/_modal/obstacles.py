"""What the modal core does not take, in words."""

from collections.abc import Sequence

from ...dynamics import hold_obstacle
from ...laws import DamagedRoller
from ...rig import Rig
from .._exact import exact_obstacle
from .signals import wheels_with_tables

BULK_METRICS = ("rms", "peak")  # gathered on the way; others are read from samples


def modal_obstacle(rig: Rig, model: str = "coupled") -> str | None:
    """Why the modal core does not give runs of the rig, in words; None where it does."""
    return exact_obstacle(rig, model) or hold_obstacle(rig, model)


def figures_obstacle(
    rig: Rig, model: str = "coupled", metrics: Sequence[str] = BULK_METRICS
) -> str | None:
    """Why the modal core does not gather these figures on the way through runs of the rig."""
    if others := [name for name in metrics if name not in BULK_METRICS]:
        return f"the modal core does not give {', '.join(others)}"
    return modal_obstacle(rig, model) or _table_obstacle(rig)


def _table_obstacle(rig: Rig) -> str | None:
    if not (tables := wheels_with_tables(rig)):
        return None
    return (
        f"wheel {rig.names[tables[0]]}'s profile is a table, whose runs are read sample by sample"
    )


def modal_steady_obstacle(rig: Rig, model: str = "coupled") -> str | None:
    """Why the modal core does not give steady states of the rig, in words."""
    reason = modal_obstacle(rig, model)
    if reason is not None:
        return reason
    laws = [(placed.law, placed.wheels) for placed in rig.at("shape")]
    for i, name in enumerate(rig.names):
        if sum(i in wheels for law, wheels in laws if isinstance(law, DamagedRoller)) > 1:
            return f"wheel {name} has more than one damaged roller"
    return None
