"""Settings that must stand before jax is imported: CPU, one thread a worker, a cache here."""

import os
from pathlib import Path

from hypothesis import settings
from jaxtyping import install_import_hook

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")
os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("JAX_PLATFORMS", "cpu")
os.environ.setdefault(
    "OMNIJAX_CACHE_DIR", str(Path(__file__).parents[1] / ".pytest_cache" / "compiled")
)

settings.register_profile("omnijax", derandomize=True, deadline=None, database=None)
settings.load_profile("omnijax")

# annotated shapes are checked at every call of what holds the machine; it costs tracing time only
install_import_hook(["omnijax.laws", "omnijax.rig"], "shapes.checked")
