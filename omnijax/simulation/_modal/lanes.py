"""A group of designs as the kernels take it, batch last."""

from typing import NamedTuple

from jaxtyping import Array, Float

from ._poles import PolePairs
from .signals import Signals

ROWS = 3  # outputs that the figures are made of: dR
LANES = 64  # designs that pass through the loop together


class Lanes(NamedTuple):
    """A group of designs, batch last."""

    modes: PolePairs
    signals: Signals
    direct: Float[Array, "l o c"]
    slope: Float[Array, "l o c"]
    preload: Float[Array, "n c"]
    friction: Float[Array, "n c"]
