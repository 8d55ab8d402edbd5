"""What the names of metrics in an answer mean."""

import re

from ..vibration import METRICS


def meanings(*texts: str) -> dict[str, str]:
    """What the metrics named in some texts are."""
    words = set(re.findall(r"\w+", " ".join(texts)))
    terms = {name: metric.meaning for name, metric in METRICS.items() if name in words}
    if any("ΔR" in meaning for meaning in terms.values()):
        terms["ΔR"] = "the sphere's centre relative to the platform"
    return terms
