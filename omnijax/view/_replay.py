"""Replay: one offline file that shows a run."""

import base64
from pathlib import Path

import numpy as np

from .._batch import check_single
from .._files import write_text
from .._text import quantity_text
from ..rig import Rig
from ..simulation import Trajectory
from ._scene import embedded_json, machine_scene, page

MOST_SAMPLES = 12_000  # of a page: it stays below 2 MB for three wheels


def write_replay(run: Trajectory, rig: Rig, path: str | Path, title: str = "Replay") -> Path:
    """Write the offline replay of `run` to `path` and return it.

    Samples after a run's failure are left out; longer runs are thinned to `MOST_SAMPLES`.
    Raises `ValueError` for a run without two finite samples, and for a batch of runs.
    """
    check_single(run.status.shape)
    kept = _kept(run)
    channels = {
        "t": run.t,
        "dR": run.dR,
        "attitude": run.attitude,
        "theta": run.theta,
        "mount": run.mount_deflection,
    }
    data: dict[str, object] = {
        name: _packed(np.asarray(values)[kept]) for name, values in channels.items()
    }
    data["machine"] = machine_scene(rig)
    thinned = "" if len(kept) == len(run.t) else f" {len(kept)} of {len(run.t)} samples."
    text = page(
        "replay.html",
        title=title,
        summary=run.message() + thinned,
        run=embedded_json(data),
        peak=quantity_text(float(np.max(np.linalg.norm(np.asarray(run.dR)[kept], axis=1))), "m"),
    )
    return write_text(path, text)


def _kept(run: Trajectory) -> np.ndarray:
    """Indices of the samples that the page shows."""
    finite = np.isfinite(np.asarray(run.dR)).all(axis=1) & np.isfinite(np.asarray(run.theta)).all(1)
    good = np.flatnonzero(finite)
    if len(good) < 2:
        raise ValueError(f"the run has {len(good)} finite samples, but a replay needs two.")
    return good[:: max(1, -(-len(good) // MOST_SAMPLES))]


def _packed(values: np.ndarray) -> str:
    """Little-endian float32 in base64."""
    return base64.b64encode(values.astype("<f4").tobytes()).decode("ascii")
