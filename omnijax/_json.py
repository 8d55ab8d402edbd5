"""Values as JSON has them: there is no NaN and no infinity in it."""

import math
from typing import Any


def plain(value: Any) -> Any:
    """JSON values: arrays become lists, numbers that are not finite become null."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
