"""C programs compiled on the spot."""

import ctypes
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

_FOLDER = Path(__file__).parent / "programs"
FLAGS = ["-O3", "-march=native", "-ffast-math", "-fPIC"]


def compiled(name: str):
    """The shared library of `programs/NAME.c`, or None without a C compiler.

    Linked by itself: a link with -ffast-math adds code that rounds the whole process's subnormal
    numbers to zero from the moment the library is loaded.
    """
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        return None
    folder = Path(tempfile.mkdtemp(prefix="omnijax-bench-"))
    part, library = str(folder / f"{name}.o"), str(folder / f"{name}.so")
    source = str(_FOLDER / f"{name}.c")
    subprocess.run([compiler, *FLAGS, "-c", "-o", part, source], check=True)
    subprocess.run([compiler, "-shared", "-o", library, part, "-lm"], check=True)
    return ctypes.CDLL(library)


def pointer(array: np.ndarray):
    """A C pointer to a contiguous float64 array."""
    assert array.flags["C_CONTIGUOUS"] and array.dtype == float
    return array.ctypes.data_as(ctypes.c_void_p)


number = ctypes.c_double


def elastic(library, name: str, rows: np.ndarray, samples: int, step: float, *substeps: int):
    """RMS and peak of `rows` by one of the functions of `elastic.c`."""
    out = np.zeros((len(rows), 2))
    arguments = [samples, number(step), *substeps]
    getattr(library, name)(len(rows), pointer(rows), *arguments, pointer(out))
    return out


def steady(library, rows: np.ndarray, points: int):
    """Long-run RMS and supremum."""
    out = np.zeros((len(rows), 2))
    library.steady(len(rows), pointer(rows), points, pointer(out))
    return out


def dynamics(library, rows: np.ndarray, torque, samples: int, step: float, substeps: int):
    """RMS and peak of torque-driven runs."""
    out = np.zeros((len(rows), 2))
    torque = np.ascontiguousarray(torque, float)
    where = pointer(torque)
    library.dynamics(len(rows), pointer(rows), where, samples, number(step), substeps, pointer(out))
    return out
