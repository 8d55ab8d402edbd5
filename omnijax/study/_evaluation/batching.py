"""How many designs are evaluated at a time."""

from ..._memory import available
from ...simulation import LANES
from .methods import BULK

# designs at a time where memory allows
BATCH = {
    "steady": 64,
    "bulk": 2048,
    "steady-bulk": 2048,
    "propagation": 32,
    "fixed": LANES,
    "full": 32,
}
CHANNELS = 75  # numbers kept a sample of a run
SHARE_OF_MEMORY = 0.25


def batch_size(method: str, samples: int, columns: int, devices: int = 1) -> int:
    """Designs at a time: a power of two from the free memory, never above `BATCH`.

    Side by side a design needs about 8 bytes x samples x channels, once more for each gradient's
    direction; in bulk only those of 64 runs are kept.  Closed forms go one after the other.
    """
    most = BATCH[method]
    if method not in ("steady", "propagation"):
        need = 1e5 if method in BULK else 8.0 * max(samples, 1000) * CHANNELS * 2
        most = min(most, int(SHARE_OF_MEMORY * available() / (need * (1 + columns))))
    return max(1 << max(most, 1).bit_length() - 1, devices)
