"""Process-wide JAX settings of the compute layer: float64 and the persistent compilation cache."""

import os
from pathlib import Path

import jax


def cache_folder() -> Path:
    """Folder of the compiled programs: `$OMNIJAX_CACHE_DIR`, else the user's cache folder."""
    chosen = os.environ.get("OMNIJAX_CACHE_DIR")
    if chosen:
        return Path(chosen)
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "omnijax" / "jax"


def configure() -> None:
    """Switch on float64 and, unless the user set one, the compilation cache.

    Also gives XLA a pool of at least 16 threads: jaxlib's batched LAPACK calls wait inside the
    pool for their own parts, and on two cores two such calls at a time wait for each other forever.
    """
    os.environ.setdefault("PJRT_NPROC", str(max(16, os.cpu_count() or 1)))
    jax.config.update("jax_enable_x64", True)
    if getattr(jax.config, "jax_compilation_cache_dir", None) is None:
        jax.config.update("jax_compilation_cache_dir", str(cache_folder()))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.2)


configure()
