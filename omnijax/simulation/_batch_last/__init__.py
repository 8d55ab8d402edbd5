"""`jax.vmap` with the batch as the last axis of every array."""

from .transform import LANES as LANES
from .transform import WIDTH as WIDTH
from .transform import in_parts as in_parts
from .transform import side_by_side as side_by_side
from .transform import vmap_last as vmap_last
