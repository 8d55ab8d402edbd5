"""Natural frequencies and damping of the elastic model."""

import dataclasses
from pathlib import Path
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._arrays import on_device
from .._plot import COLOURS, new_axes, styled
from .._programs import kept
from .._result import AbstractResult
from .._text import listed, split_names
from ..dynamics import ELASTIC_PORTS, TRANSLATIONS, check_model, free_system
from ..rig import Rig, as_rig


@dataclasses.dataclass(frozen=True, repr=False, eq=False)
class Modes(AbstractResult):
    """Modes of the elastic model in order of frequency; an overdamped pole is a mode of its own.

    `frequency` (m,) in Hz, `damping_ratio` (m,), `shape` (m, d) of unit length.  They are those of
    the springs and dampers of contacts, mounts and closures; laws that stand there beside them are
    left out and named in `without`.
    """

    frequency: Float[Array, " m"]  # Hz, undamped natural frequency |lambda| / 2 pi
    damping_ratio: Float[Array, " m"]  # -Re(lambda) / |lambda|; 1 for a real pole
    shape: Float[Array, "m d"]  # dR part (coupled) of each mode, unit length, real part
    without: tuple[str, ...] = ()  # ids of laws at contacts and mounts

    file_kind: ClassVar[str] = "omnijax modes"
    what: ClassVar[str] = "modes"

    def sentences(self) -> list[str]:
        """Every mode's frequency and damping."""
        each = zip(np.asarray(self.frequency), np.asarray(self.damping_ratio), strict=True)
        modes = ", ".join(f"{f:.4g} Hz ({100 * ratio:.3g} %)" for f, ratio in each)
        told = [f"Modes(frequency (damping ratio): {modes})"]
        if self.without:
            told.append(f"These are of the machine without {listed(self.without)}.")
        return told

    def table(self):
        """A mode a row."""
        rows = zip(
            np.asarray(self.frequency).tolist(),
            np.asarray(self.damping_ratio).tolist(),
            (", ".join(f"{x:.2f}" for x in row) for row in np.asarray(self.shape)),
            strict=True,
        )
        return "Modes", list(rows), ("frequency (Hz)", "damping ratio", "shape of ΔR")

    def to_xarray(self) -> Any:
        """Frequencies, damping ratios and shapes as an `xarray.Dataset`."""
        import xarray

        return xarray.Dataset(
            {
                "frequency": ("mode", np.asarray(self.frequency), {"units": "Hz"}),
                "damping_ratio": ("mode", np.asarray(self.damping_ratio), {"units": "1"}),
                "shape": (("mode", "axis"), np.asarray(self.shape), {"units": "1"}),
            },
            coords={"axis": ["x", "y", "z"]},
            attrs={"without": ", ".join(self.without)},
        )

    @classmethod
    def from_xarray(cls, data):
        """The modes of which `to_xarray` made `data`."""
        without = str(data.attrs.get("without", ""))
        return cls(
            on_device(data["frequency"].values),
            on_device(data["damping_ratio"].values),
            on_device(data["shape"].values),
            tuple(split_names(without)) if without else (),
        )

    @styled
    def plot(self, *, ax: Any = None) -> Any:
        """Damping ratio over frequency in Hz; returns the axes."""
        ax = new_axes(ax, 3.0)
        ax.semilogx(self.frequency, self.damping_ratio, "o", color=COLOURS[0])
        ax.set_xlabel("natural frequency (Hz)")
        ax.set_ylabel("damping ratio")
        return ax


def modes(rig: Rig | str | Path, model: str = "coupled") -> Modes:
    """Natural frequencies (Hz), damping ratios and shapes of the linear elastic model.

    `rig` may be a rig file or the name of a bundled rig.

    Laws at contacts and mounts are left out: `without` names them.
    Outside of transformations (numpy); for a differentiable figure use `natural_frequencies`.

    Raises `InputError` for another `model` than `coupled` and `paper`.

    Source: eigenvalues of the paper's eqs. 32-42 without shape (`docs/theory.md`, translation).
    """
    check_model(model)
    rig = as_rig(rig)
    A, rows = (np.asarray(x) for x in _matrices(rig, model))
    values, vectors = np.linalg.eig(A)
    keep = np.imag(values) >= -1e-9 * np.abs(values)
    values, vectors = values[keep], vectors[:, keep]
    order = np.argsort(np.abs(values))
    values, vectors = values[order], vectors[:, order]
    shape = rows @ vectors
    shape = shape * np.exp(-1j * np.angle(shape[np.abs(shape).argmax(0), np.arange(len(values))]))
    length = np.linalg.norm(np.real(shape), axis=0)
    shape = np.where(length > 0, np.real(shape) / np.where(length > 0, length, 1.0), 0.0)
    size = np.abs(values)
    ratio = -np.real(values) / np.where(size > 0, size, 1.0)
    hertz = size / (2 * np.pi)
    return Modes(on_device(hertz), on_device(ratio), on_device(shape.T), _elastic_laws(rig))


def _elastic_laws(rig: Rig) -> tuple[str, ...]:
    """Ids of the laws at contacts and mounts, which no natural frequency here knows."""
    return tuple(dict.fromkeys(p.law.id for port in ELASTIC_PORTS for p in rig.at(port)))


@kept
def _matrices(rig: Rig, model: str):
    """A of the linear model and the row that reads dR: one program, which is kept."""
    return free_system(TRANSLATIONS[model](rig))


def natural_frequencies(rig: Rig | str | Path, model: str = "coupled") -> Float[Array, " m"]:
    """Undamped natural frequencies in Hz, ascending, differentiable.

    `rig` may be a rig file or the name of a bundled rig.

    Those of the conservative part, without laws at contacts and mounts: the symmetric problem
    stiffness v = (2 pi f)^2 mass v, whose eigenvalues differentiate cleanly (repeated ones: the
    average over the repeated group's directions is what is defined).

    The array (modes,).  Raises `InputError` for another `model` than `coupled` and `paper`.

    Source: as `modes`, without damping.
    """
    check_model(model)
    rig = as_rig(rig)
    A, _ = free_system(TRANSLATIONS[model](_undamped(rig)))
    state = TRANSLATIONS[model](rig).rest()
    half = state.approach.size + state.mount.size
    to_velocity, to_force = A[:half, half:], A[half:, :half]
    # velocity = M^-1 p and p' = -S x, both symmetric: eigenvalues of M^-1/2 S M^-1/2
    flexibility = (to_velocity + to_velocity.T) / 2
    lower = jnp.linalg.cholesky(flexibility)
    values = jnp.linalg.eigvalsh(-lower.T @ to_force @ lower)
    return jnp.sqrt(jnp.maximum(values, 0.0)) / (2 * jnp.pi)


def _undamped(rig: Rig) -> Rig:
    return eqx.tree_at(
        lambda r: (r.wheels.contact.damping, r.wheels.mount.damping),
        rig,
        replace_fn=jnp.zeros_like,
    )
