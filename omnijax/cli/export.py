"""`omnijax export`: a stored sweep as NetCDF, CSV or Parquet."""

from pathlib import Path

from .._files import claim
from .._reading import existing
from ._inputs import Force, Json, emit


def export(store: Path, file: Path, /, *, force: Force = False, json: Json = False) -> int:
    """Write a stored sweep to a file; its ending chooses NetCDF (.nc), CSV or Parquet.

    Example: omnijax export sweep.zarr sweep.csv

    Parameters
    ----------
    store
        The folder that `omnijax sweep --out` writes.
    file
        The file to write: .nc, .csv or .parquet.
    """

    existing(store, "folder")
    from .._errors import tell
    from ..study import load_sweep

    claim([file, *([file.with_suffix(".json")] if file.suffix == ".csv" else [])], force=force)
    result = load_sweep(store)
    done, size = result.store.count_done(), result.size
    written = result.export(file)
    if done < size:
        tell([
            f"{store}: {done} of {size} designs are done; the figures of the others are nan in "
            f"{written.name}. The same `omnijax sweep` with --resume computes them."
        ])  # fmt: skip
    text = f"{size} designs" if done == size else f"{done} of {size} designs are done"
    emit(
        json,
        {"file": str(written), "designs": size, "done": done},
        lambda: print(f"{written}: {text}"),
    )
    return 1 if result.store.damaged else 0
