"""A rig's vector field as a term of diffrax, for solvers, events and adjoints of one's own."""

import diffrax as dfx
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from ...dynamics import Model, State
from ...rig import Rig
from .._drives import AbstractDrive, Values, drive_for
from .state_vector import build_model, initial_state, pack, scaled_field, state_scale, unpack


def term(
    rig: Rig, drive: AbstractDrive | Values, *, start: float = 0.0, model: str = "coupled"
) -> dfx.ODETerm:
    """`diffrax.ODETerm` of a rig under a drive: the one that `simulate` integrates.

    Its state is a vector (m,) in natural units (the gap's depth for what vibrates), so that one
    tolerance serves all of it: `start_vector` begins it, `state_of` reads it.  `start` is the time
    in s at which the run begins.  Raises `InputError` for a drive that does not fit.
    """
    drive = drive_for(rig, drive)
    built = build_model(rig, model)
    args = built, drive, start, _scale(built)
    return dfx.ODETerm(lambda time, vector, _: scaled_field(time, vector, args))


def start_vector(
    rig: Rig, drive: AbstractDrive | Values, *, start: float = 0.0, model: str = "coupled"
) -> Float[Array, " m"]:
    """The term's vector at the `start` (s) of a run: static equilibrium, attitude (1, 0, 0, 0).

    Raises `InputError` for a drive that does not fit.
    """
    drive = drive_for(rig, drive)
    built = build_model(rig, model)
    return pack(built, initial_state(built, drive, start), _scale(built))


def state_of(rig: Rig, vector: Float[Array, " m"], *, model: str = "coupled") -> State:
    """The `State` (`omnijax.dynamics.State`, SI) that a term's vector stands for."""
    built = build_model(rig, model)
    return unpack(built, vector, _scale(built))


def _scale(built: Model) -> Float[Array, " m"]:
    return ravel_pytree(state_scale(built))[0]
