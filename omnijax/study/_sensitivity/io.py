"""Sensitivities as labelled arrays with units, to a file and back."""

from pathlib import Path
from typing import Any

import numpy as np

from .._netcdf import read_result, write_result
from .check import Check
from .sensitivity import Sensitivity


def dataset(result: Sensitivity) -> Any:
    """`figure`, `raw`, `relative` (and `difference`) over metric and parameter."""
    import xarray as xr

    both = ("metric", "parameter")
    data = {
        "value": ("parameter", result.values),
        "figure": ("metric", result.figures),
        "raw": (both, result.raw, {"units": "unit of the metric / unit of the parameter"}),
        "relative": (both, result.relative, {"units": "% per %"}),
    }
    if result.check is not None:
        data["difference"] = (both, result.check.differences, dict(data["raw"][2]))
        data["difference_error"] = (both, result.check.error, {"units": "1"})
    coords = {
        "metric": list(result.metrics),
        "parameter": list(result.parameters),
        "metric_unit": ("metric", list(result.metric_units)),
        "parameter_unit": ("parameter", list(result.units)),
    }
    return xr.Dataset(data, coords, {"method": result.method, "kind": "omnijax sensitivity"})


def save(result: Sensitivity, path: str | Path) -> None:
    """Write netCDF."""
    write_result(dataset(result), path)


def load(path: str | Path) -> Sensitivity:
    """Read what `save` wrote."""
    data = read_result(path, "omnijax sensitivity", "sensitivities")

    def texts(name):
        return tuple(str(x) for x in data[name].values)

    check = None
    if "difference" in data:
        check = Check(data["difference"].values, data["difference_error"].values)
    return Sensitivity(
        texts("parameter"), texts("parameter_unit"), data["value"].values, texts("metric"),
        texts("metric_unit"), np.atleast_1d(data["figure"].values), data["raw"].values,
        str(data.attrs["method"]), check,
    )  # fmt: skip
