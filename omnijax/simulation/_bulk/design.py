"""Designs of the bulk kernel: contacts, passages of the gaps, and how time is cut into blocks."""

from typing import NamedTuple

from jaxtyping import Array, Float

from .contact import Contact

CLIP = 500.0  # decay over a block above which a pole acts on the first sample after an edge only
EDGE = 1e-9  # gaps by which a window looks back, so that rounding loses none


class Wheel(NamedTuple):
    """Passages of the gaps (leading axis: the wheel)."""

    depth: Float[Array, "j c"]  # m, with the sign of the profile in the direction of motion
    period: Float[Array, "j c"]  # s, from gap to gap
    passage: Float[Array, "j c"]  # s, through a gap
    since: Float[Array, "j c"]  # s, since the last gap began, at the start


class Layout(NamedTuple):
    """What is static: which wheel drives which direction, and how time is cut."""

    axis: tuple[int, ...]  # direction of each pair; beyond `directions`: a sinusoid by itself
    wheel: tuple[int, ...]  # wheel of each pair
    directions: int
    sets: tuple[int, ...]  # of each direction: its row of contact parameters
    half_turn: bool  # half-sine: the gap spans pi of its sinusoid instead of 2 pi
    step: float  # s, between samples
    length: int  # samples a block
    blocks: int  # blocks a window
    windows: int
    samples: int
    edges: tuple[int, ...]  # gaps of each wheel that a window can touch
    slots: int  # 1: at most one edge a block; 2: at most one of each kind
    stiff: bool  # whether a pole may be clipped


class Design(NamedTuple):
    """Contacts, wheels and couplings of a batch of designs."""

    contact: Contact  # (directions, c)
    wheel: Wheel
    own: Float[Array, "p c"]  # 1 where the pair is a contact and its own wheel
    coupling: Float[Array, "p c"]  # drive force along the direction per drho/dt, N s/m
