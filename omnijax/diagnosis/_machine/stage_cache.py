"""What was computed for the last few rigs asked for, by stage."""

import contextlib
import threading
from collections.abc import Callable, Collection, Iterator
from typing import Any

MOST = 12  # of a stage
ASIDE = 6  # of a stage, of what is made aside: for each run the motion and its wheels, of one rig


class StageCache:
    """A small store a stage; threads may ask at once, and get the same object of one key."""

    def __init__(self):
        self._lock = threading.Lock()
        self._stages: dict[str, dict[bytes, Any]] = {}
        self._lasting: dict[str, dict[bytes, Any]] | None = None  # what was kept before an `aside`

    def get(self, stage: str, key: bytes, make: Callable[[], Any], most: int = MOST) -> Any:
        """What is kept of a stage under `key`, made where there is none.

        Where more than `most` are kept the oldest one goes.
        """
        with self._lock:
            kept = self._stages.setdefault(stage, {})
            if key in kept:
                return kept[key]
        made = make()
        with self._lock:
            lasting = {} if self._lasting is None else self._lasting.get(stage, {})
            passing = [known for known in kept if known not in lasting]
            if len(passing) > (most if self._lasting is None else min(most, ASIDE)):
                kept.pop(passing[0])
            return kept.setdefault(key, made)

    def peek(self, stage: str, key: bytes) -> Any:
        """What is kept of a stage under `key`, or None."""
        with self._lock:
            return self._stages.get(stage, {}).get(key)

    @contextlib.contextmanager
    def aside(self) -> Iterator[None]:
        """What is made meanwhile is kept for a short time only; what was kept before stays."""
        with self._lock:
            before, outside = self._stages, self._lasting
            self._stages = meanwhile = {stage: dict(kept) for stage, kept in before.items()}
            self._lasting = before
        try:
            yield
        finally:
            with self._lock:
                self._lasting = outside
                if self._stages is meanwhile:  # else it was told to forget
                    self._stages = before

    def forget(self, *stages: str, but: Collection[str] = ()) -> None:
        """Keep nothing of `stages` (none given: of any `but` some), nor of what is being made."""
        with self._lock:
            self._stages = {
                stage: dict(kept) for stage, kept in self._stages.items()
                if stage in but or (stages and stage not in stages)
            }  # fmt: skip
