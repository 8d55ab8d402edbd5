"""Process-wide JAX settings of the compute layer: float64 and the persistent compilation cache."""

import logging
import os
from pathlib import Path

import jax

from ._private import private_folder
from ._sealed_cache import seal_entries
from ._waiting import Patience, listeners


def cache_folder() -> Path:
    """Folder of the compiled programs: `$OMNIJAX_CACHE_DIR`, else the user's cache folder."""
    chosen = os.environ.get("OMNIJAX_CACHE_DIR")
    if chosen:
        return Path(chosen)
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "omnijax" / "jax"


def configure() -> None:
    """Switch on float64 and, unless the user set one, the compilation cache.

    Also gives XLA one thread a device.  With more, the many small steps of these programs go
    through a thread pool at twice the time they take, and jaxlib's batched LAPACK calls, which
    wait inside the pool for their own parts, can wait for each other forever.  More cores are
    used by `devices` and `workers`.
    """
    os.environ.setdefault("PJRT_NPROC", "1")
    jax.config.update("jax_enable_x64", True)
    if getattr(jax.config, "jax_compilation_cache_dir", None) is None:
        reason = private_folder(cache_folder())
        if reason is not None:  # what lies there is code, and others could have put it there
            logging.getLogger("omnijax").warning("compiled programs are not kept: %s", reason)
            return
        seal_entries(cache_folder())
        jax.config.update("jax_compilation_cache_dir", str(cache_folder()))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)


def tell_of_compilations() -> None:
    """Have the listeners hear of every compilation of jax's that takes long."""
    patience = Patience()

    def begun(event: str, **_) -> None:
        if event.endswith("/compile_requests_use_cache"):
            patience.start()

    def ended(event: str, *_, **__) -> None:
        if event.endswith("/backend_compile_duration"):
            patience.stop()

    jax.monitoring.register_event_listener(begun)
    jax.monitoring.register_event_duration_secs_listener(ended)


configure()
if listeners:
    tell_of_compilations()
