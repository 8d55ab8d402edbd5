"""What jax traces and compiles, counted."""

import jax


def counted(kind: str = "backend_compile") -> list[str]:
    """Events of that kind from now on, one entry each as they come."""
    events: list[str] = []

    def heard(event: str, *_, **__) -> None:
        if kind in event:
            events.append(event)

    jax.monitoring.register_event_duration_secs_listener(heard)
    return events
