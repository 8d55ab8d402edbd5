"""`omnijax export`: a stored sweep as NetCDF, CSV or Parquet."""

from pathlib import Path

from .._files import claim
from .._reading import existing
from ._options import Force, Json, emit


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
    from ..study import load_sweep

    claim([file, *([file.with_suffix(".json")] if file.suffix == ".csv" else [])], force=force)
    result = load_sweep(store)
    written = result.export(file)
    emit(
        json,
        {"file": str(written), "designs": result.size},
        lambda: print(f"{written}: {result.size} designs"),
    )
    return 1 if result.store.damaged else 0
