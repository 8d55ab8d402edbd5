"""Settings that must stand before jax is imported: CPU, one thread a worker, a cache here."""

import contextlib
import gc
import os
import shutil
import threading
import time
from importlib.metadata import version
from pathlib import Path

import pytest
from hypothesis import settings

os.environ.setdefault("OMP_NUM_THREADS", "1")
FLAGS = "--xla_cpu_multi_thread_eigen=false"
if version("jaxlib").startswith("0.10."):  # XLA aborts at a flag that it does not know
    # the older of XLA's two code generators for the same operations, and machine code optimised
    # less: half the time to compile, which is most of the suite's; bulk kernels run longer in it.
    FLAGS += " --xla_cpu_use_fusion_emitters=false --xla_backend_optimization_level=1"
    FLAGS += " --xla_llvm_disable_expensive_passes=true"
    FLAGS += " --xla_backend_extra_options=xla_cpu_disable_loop_unrolling,"
    FLAGS += "xla_cpu_disable_slp_vectorizer,xla_cpu_optimize_for_size"
    # a worker has one core: parting a program's code for several threads only copies it
    FLAGS += " --xla_cpu_parallel_codegen_split_count=1"
os.environ.setdefault("XLA_FLAGS", FLAGS)
os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("JAX_PLATFORMS", "cpu")
os.environ.setdefault("OMNIJAX_KEEP_PROGRAMS", "0")  # hundreds of programs, of which few come again
# compiled programs of the tests, one folder for every clone of this user: XLA's own cache, whose
# keys are the program, the compiler, its flags and the processor
COMPILED = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "omnijax" / "tests"
KEPT = 14 * 86_400  # s
os.environ.setdefault("OMNIJAX_CACHE_DIR", str(COMPILED))

settings.register_profile("omnijax", derandomize=True, deadline=None, database=None)
settings.load_profile("omnijax")


# a trace makes millions of objects and drops few: by default a fifth of its time is looking
gc.set_threshold(100_000, 20, 50)
MAPS = Path("/proc/self/maps")
GARBAGE = 2**30  # bytes by which a process may grow before garbage is looked for
_swept = {"size": 0}


def pytest_sessionstart(session):
    """Programs of other versions go once they are old; of a worker, its controller has done it."""
    if hasattr(session.config, "workerinput") or not COMPILED.is_dir():
        return
    for file in COMPILED.rglob("*"):
        with contextlib.suppress(FileNotFoundError):  # the suite of another clone was quicker
            if file.is_file() and time.time() - file.stat().st_mtime > KEPT:
                file.unlink()


def pytest_collection_modifyitems(items):
    """Files of long tests begin first: the last of them would keep one worker waiting."""
    items.sort(key=lambda item: item.get_closest_marker("long") is None)


def resident() -> int:
    """Bytes of this process in memory; 0 where the system does not say."""
    sizes = Path("/proc/self/statm")
    return int(sizes.read_text().split()[1]) * 4096 if sizes.exists() else 0


PROGRAMS = 64  # lowered in one context, which holds what all of them are made of


@pytest.fixture(autouse=True, scope="session")
def _programs_share_contexts():
    """jax makes an MLIR context a program, a quarter of the time that a small one takes.

    What is compiled while another program is lowered has a context of its own.
    """
    if not version("jax").startswith("0.10."):  # jax has no public door to it
        yield
        return
    from jax._src.interpreters import mlir
    from jaxlib.mlir import ir

    made, own = mlir.make_ir_context, threading.local()

    def shared():
        if ir.Context.current is not None:  # of a program that is being lowered now
            return made()
        own.programs = getattr(own, "programs", 0)
        if own.programs % PROGRAMS == 0:
            own.context = made()
        own.programs += 1
        return own.context

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mlir, "make_ir_context", shared)
        yield


@pytest.fixture(autouse=True, scope="module")
def _programs_end_before_there_are_too_many():
    """Every compiled program maps memory; a process may hold 65 530 maps, then XLA aborts.

    Garbage is looked for where it may be much: a look takes 2 s of CPU once a few files have run.
    """
    yield
    import equinox as eqx
    import jax

    many = not MAPS.exists() or MAPS.read_bytes().count(b"\n") > 15_000
    if many:
        eqx.clear_caches()
        jax.clear_caches()
    if many or resident() > _swept["size"] + GARBAGE:
        gc.collect()
        _swept["size"] = resident()


@pytest.fixture(autouse=True, scope="module")
def _what_runs_briefly_is_not_optimised(request):
    """In files marked `brief`: half the time to compile, two to four times the time to run."""
    import jax

    before = jax.config.read("jax_disable_most_optimizations")
    brief = request.node.get_closest_marker("brief") is not None
    jax.config.update("jax_disable_most_optimizations", before or brief)
    yield
    jax.config.update("jax_disable_most_optimizations", before)


@pytest.fixture(autouse=True)
def _nobody_waits(monkeypatch):
    """Whether a line tells of a long compilation hangs on the machine, and on what ran before."""
    monkeypatch.setattr("omnijax._waiting.PATIENCE", 1e6)


CHROMIUM = [  # no sandbox in a container, no calls of its own, WebGL without a graphics card
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]

PATIENCE = 180_000  # ms: a busy machine may take long to start a browser


@pytest.fixture(scope="module")
def browser():
    """A headless chromium; the test skips where there is none."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        pytest.skip("no chromium on this machine")
    with playwright.sync_playwright() as p:
        found = p.chromium.launch(executable_path=chromium, args=CHROMIUM, timeout=PATIENCE)
        yield found
        found.close()


@pytest.fixture
def open_page(browser):
    """`open_page(url, width)`: a tab, the errors it shows and the requests it makes."""
    tabs = []

    def opened(url, width):
        tab = browser.new_page(viewport={"width": width, "height": 800})
        tab.set_default_timeout(PATIENCE)
        tabs.append(tab)
        seen = {"errors": [], "requests": []}
        tab.on("pageerror", lambda error: seen["errors"].append(str(error)))
        tab.on("console", lambda m: seen["errors"].append(m.text) if m.type == "error" else None)
        tab.on("request", lambda request: seen["requests"].append(request.url))
        tab.goto(url)
        return tab, seen

    yield opened
    for tab in tabs:
        tab.close()
