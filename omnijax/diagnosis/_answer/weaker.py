"""Runs that are proposed: weaker by halves where a rival runs away in them."""

from collections.abc import Iterator

from .._settings import SETTINGS

HALVINGS = SETTINGS.experiment.halvings


def weaker(words: str, how: str) -> Iterator[tuple[str, float]]:
    """What a run is called, and the share of it that is made: the whole, a half, a quarter, ...

    `how` it is made so many times: `slower`, `smaller`.
    """
    yield words, 1.0
    for k in range(1, HALVINGS + 1):
        yield f"{words}, all {2**k} times {how}", 0.5**k
