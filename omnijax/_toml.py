"""Values as TOML writes them."""

import json
from typing import Any


def toml_value(value: Any) -> str:
    """Text, a truth value, a number that reads back to the last bit, or a list of them.

    Of anything else its text.
    """
    plain = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(plain, bool):
        return str(plain).lower()
    if isinstance(plain, int | float):
        return repr(plain)
    if isinstance(plain, list | tuple):
        return f"[{', '.join(map(toml_value, plain))}]"
    return json.dumps(str(plain), ensure_ascii=False)
