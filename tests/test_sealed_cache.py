"""Entries of jax's cache that a full disk, a killed process or a flipped bit has damaged."""

import os
import subprocess
import sys

DAMAGED = """
import random, warnings
from pathlib import Path
import jax, jax.numpy as jnp
from jax.experimental.compilation_cache import compilation_cache
import omnijax._arrays
warnings.simplefilter("error")

def value():
    jax.clear_caches()
    compilation_cache.reset_cache()
    return float(jax.jit(lambda x: jnp.sin(x) * 2)(jnp.float64(0.5)))

folder, rng, events = Path(jax.config.jax_compilation_cache_dir), random.Random(int(SEED)), []
jax.monitoring.register_event_listener(lambda event, **_: events.append(event))
hits = lambda: events.count("/jax/compilation_cache/cache_hits")
right = value()
entries = [path for path in folder.iterdir() if path.name.endswith("-cache")]
whole = {path: path.read_bytes() for path in entries}
before = hits()
assert value() == right and hits() == before + len(entries), "whole entries are taken"
for kind in ("empty", "cut", "flipped") * 5:
    for path, body in whole.items():
        at = rng.randrange(1, len(body))
        flipped = body[:at] + bytes([body[at] ^ 1 << rng.randrange(8)]) + body[at + 1 :]
        path.write_bytes({"empty": b"", "cut": body[:at], "flipped": flipped}[kind])
    before = hits()
    assert value() == right and hits() == before, f"{kind} at {at} was taken"
    assert value() == right and hits() == before + len(entries), f"{kind} was not mended"
print(len(entries), "entries")
"""


def test_a_damaged_entry_is_compiled_anew_without_a_word(tmp_path):
    seed = 20
    environment = os.environ | {"OMNIJAX_CACHE_DIR": str(tmp_path / "cache")}
    environment.pop("JAX_COMPILATION_CACHE_DIR", None)
    words = [sys.executable, "-c", DAMAGED.replace("SEED", str(seed))]
    ran = subprocess.run(words, check=False, env=environment, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    assert int(ran.stdout.split()[0]) >= 1
