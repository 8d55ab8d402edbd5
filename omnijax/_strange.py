"""Units that are no units: texts that pint would work on for hours."""

import re

LONGEST = 60  # characters
_POWER = re.compile(r"(?:\*\*|\^)\s*(\S*)")
_SMALL = re.compile(r"\(?[+-]?\d(?:\.\d{1,3})?\)?(?![\d.*^])")


def strange_unit(text: str) -> bool:
    """Whether `text` is too long, or has a power that is not one small number."""
    if len(text) > LONGEST or "\0" in text:
        return True
    return any(not _SMALL.match(power) for power in _POWER.findall(text))
