"""Where the laws of each port may stand: words of a law's `places`, and places of a rig."""

from collections.abc import Sequence

from ._schema import GROUPS, channels

ONE_WHEEL = ("wheel", "all")
SENSORS = ("group", "channel", "encoder")
WORDS: dict[str, tuple[str, ...]] = {  # by port; others act at wheels
    "surface": ("sphere",),
    "sphere": ("sphere",),
    "rolling": ("wheel", "all", "sphere"),
    "platform": ("platform",),
    "sensor": (*SENSORS, *GROUPS),
}


def port_words(port: str, wheels: int) -> tuple[str, ...]:
    """What a law at a port may have in its `places`, on a rig of so many wheels."""
    known = WORDS.get(port, ONE_WHEEL)
    return (*known, *channels(wheels)) if port == "sensor" else known


def places_of(words: Sequence[str], names: Sequence[str]) -> list[str]:
    """The places of a rig with wheels `names` that words of `places` stand for."""
    kinds = {
        "wheel": list(dict.fromkeys(names)),
        "group": list(GROUPS),
        "channel": list(channels(len(names))),
        "encoder": [f"theta_{i + 1}" for i in range(len(names))],
    }
    return [place for word in words for place in kinds.get(word, [word])]


def port_places(port: str, names: Sequence[str]) -> list[str]:
    """The places of a rig with wheels `names` at which a law of a port may stand."""
    return list(dict.fromkeys(places_of(WORDS.get(port, ONE_WHEEL), names)))
