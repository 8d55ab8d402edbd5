"""Options and output that commands share."""

import json
from collections.abc import Callable
from typing import Annotated, Any

from cyclopts import Parameter

Json = Annotated[bool, Parameter(name="--json", negative="", help="Print JSON for machines.")]


def emit(as_json: bool, data: Any, text: Callable[[], None]) -> None:
    """Print `data` as JSON, or the text for people."""
    if as_json:
        print(json.dumps(data, indent=1, ensure_ascii=False))
    else:
        text()
