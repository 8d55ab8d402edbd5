"""Programs kept across processes: traced, lowered and compiled once, loaded ever after.

jax's compilation cache saves the compiler's time alone; tracing and lowering a long formula take
seconds in every process.  A kept program is stored whole beside that cache, under a key of all
that it was made from, and is loaded where every part of the key is the same.  Whatever else is
found there is ignored and written anew.  `OMNIJAX_KEEP_PROGRAMS=0` switches this off.

A compiled program is code, so a file is opened only where this user wrote it: the folder must be
the user's alone, and each file is sealed (HMAC-SHA256) with a secret of the user's that lies
elsewhere.  Seal and key are compared before anything is unpickled.
"""

import contextlib
import functools
import hashlib
import hmac
import logging
import os
import pickle
import platform
import re
import stat
import sys
import tempfile
import threading
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FunctionType
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.experimental.compilation_cache import compilation_cache
from jax.experimental.serialize_executable import deserialize_and_load, serialize

from ._compiling import Effort, compiler_options, on_cpu
from ._config import cache_folder
from ._private import config_folder, private_folder
from ._waiting import told

ROOM = 400e6  # bytes of the files that are kept, the last used: mostly 30 kB each, up to 6 MB
HELD = 512  # the most in memory: a diagnosis asks for up to 200
_held: dict[Any, Callable] = {}
_order = threading.Lock()  # of `_held`
_making = threading.RLock()  # one at a time: jax's settings are others meanwhile
_NUMPY = (np.ndarray, np.generic)
_ARRAY = (*_NUMPY, jax.Array)
_STATIC = (str, int, float, bool)  # leaves beside arrays
_log = logging.getLogger("omnijax")


def kept(function: Callable) -> Callable:
    """`function` as a compiled program that is kept across processes.

    Like `equinox.filter_jit`, which takes every call that has no such program: under a
    transformation, with laws from outside this package, or not on one ordinary CPU.  Arguments may
    be functions of this package too.  Results must be pytrees of arrays, words and Python's numbers
    whose classes belong to this package.
    A call may say how much `effort` its compilation is worth.  A program is kept for each effort,
    and a call without a kept program is compiled with that effort too.
    """
    jitted = _by_effort(function)

    @functools.wraps(function)
    def run(*args, effort: Effort = Effort.QUICK):
        leaves, tree = jax.tree.flatten(args)
        if not _suits(leaves):
            return jitted(effort, leaves)(*args)
        shapes = tuple(_shape(x) for x in leaves)
        settings = _settings()
        known = (function, effort, tree, shapes, settings)
        program = _in_memory(known)
        if program is None:
            if not _package_only(args):
                return jitted(effort, leaves)(*args)
            key = "\n".join(map(str, (_name(function), effort, tree, shapes, settings, _origin())))
            with _making:  # another thread may just have done so
                program = _in_memory(known) or _load(key)
                program = program or _make(function, leaves, tree, key, effort)
                _hold(known, program)
        return program([x for x in leaves if isinstance(x, _ARRAY)])

    return run


def _in_memory(known: Any) -> Callable | None:
    """The program held under a key."""
    with _order:
        program = _held.pop(known, None)
        if program is not None:
            _held[known] = program  # the last used are the last
    return program


def _hold(known: Any, program: Callable) -> None:
    with _order:
        _held[known] = program
        while len(_held) > HELD:
            del _held[next(iter(_held))]


def _by_effort(function: Callable) -> Callable[[Effort, list[Any]], Callable]:
    """`function` by `equinox.filter_jit`: given effort and leaves, compiled as they ask for.

    Options stand only at a program of its own on a CPU; inside another one jax refuses them.
    """

    @functools.cache
    def compiled(effort: Effort | None) -> Callable:
        options = {} if effort is None else compiler_options(effort, 0)
        return eqx.filter_jit(function, compiler_options=options or None)  # pyright: ignore

    def chosen(effort: Effort, leaves: list[Any]) -> Callable:
        # what a traced function works out is traced, be it of numbers known to it
        traced = any(isinstance(x, Tracer) for x in (*leaves, jnp.zeros(()) + 1.0))
        own = not traced and on_cpu()
        return compiled(effort if own else None)

    return chosen


def _suits(leaves: list[Any]) -> bool:
    """Whether a call is one that a kept program can take."""
    if os.environ.get("OMNIJAX_KEEP_PROGRAMS") == "0" or not sys.platform.startswith("linux"):
        return False
    device, *others = jax.devices()
    if device.platform != "cpu" or others or jax.config.jax_disable_jit:  # pyright: ignore
        return False
    there = {device}
    return all(
        isinstance(x, _NUMPY) or (_is_concrete(x) and x.devices() == there)
        or isinstance(x, _STATIC) or _is_own(x)
        for x in leaves
    )  # fmt: skip


def _is_concrete(x: Any) -> bool:
    return isinstance(x, jax.Array) and not isinstance(x, Tracer)


def _is_own(x: Any) -> bool:
    """Whether it is a function that stands in a module of this package, so `_origin` has it."""
    if not isinstance(x, FunctionType) or x.__module__.split(".")[0] != __name__.split(".")[0]:
        return False
    return getattr(sys.modules[x.__module__], x.__qualname__, None) is x


def _name(function: Callable) -> str:
    return f"{function.__module__}.{function.__qualname__}"


def _shape(x: Any) -> tuple[Any, ...]:
    if isinstance(x, _ARRAY):
        return x.shape, jax.dtypes.canonicalize_dtype(x.dtype), getattr(x, "weak_type", False)
    return (FunctionType, _name(x)) if isinstance(x, FunctionType) else (type(x), x)


def _settings() -> tuple[Any, ...]:
    """jax's settings as they hold here; folders and logs make no difference to a program."""
    names = [n for n in jax.config.values if not ("cache" in n or "log" in n)]
    return tuple((n, str(getattr(jax.config, n, None))) for n in names)


def _package_only(args: Any) -> bool:
    """Whether all classes in the arguments are this package's or plain, so `_origin` has them."""
    classes: set[type] = set()
    jax.tree.flatten(args, is_leaf=lambda x: bool(classes.add(type(x))))
    here = __name__.split(".")[0]
    return all(c.__module__.split(".")[0] in (here, "builtins", "jaxlib", "numpy") for c in classes)


@functools.cache
def _origin() -> str:
    """What the programs of this process come from: sources, versions, processor, flags."""
    digest, root = hashlib.sha256(), Path(__file__).parent
    for file in sorted(root.rglob("*.py")):
        digest.update(str(file.relative_to(root)).encode() + file.read_bytes())
    modules = [sys.modules[name] for name in ("jax", "jaxlib", "equinox", "numpy")]
    versions = [f"{module.__name__} {module.__version__}" for module in modules]
    flags = sorted(f"{k}={v}" for k, v in os.environ.items() if k.startswith(("XLA", "PJRT")))
    return "\n".join([digest.hexdigest(), sys.version, *versions, *_processor(), *flags])


def _processor() -> list[str]:
    """The processor's model and features, by which the compiler chooses instructions."""
    features = re.findall(r"^(?:model name|flags|Features|CPU \w+)\s*:.*", _cpuinfo(), re.MULTILINE)
    return [platform.machine(), *sorted(set(features))]


def _cpuinfo() -> str:
    return Path("/proc/cpuinfo").read_text()


def _file(key: str) -> Path:
    return cache_folder() / "programs" / hashlib.sha256(key.encode()).hexdigest()


def _load(key: str) -> Callable | None:
    """The kept program of this key; None where there is none, or none that is whole."""
    file = _file(key)
    try:
        if not _safe(cache_folder()):
            return None
        seal, body = file.read_bytes().split(b"\n", 1)
        if not hmac.compare_digest(seal, _seal(key, body)):
            raise ValueError("of another program, damaged, or not written by this user")
        program = _read(body)
        os.utime(file)
        return program
    except FileNotFoundError:
        return None
    except Exception as error:  # whatever is wrong with a file, the program can be made again
        _log.info("the kept program %s is ignored: %s", file, error)
        return None


def _read(body: bytes) -> Callable:
    """The program of a file's content, whose seal was right."""
    content = pickle.loads(zlib.decompress(body))
    if content["lapack"]:
        _register_lapack()
    tree = jax.tree.structure(content["result"])
    inputs = jax.tree.structure(((0,) * content["inputs"], {}))
    program = deserialize_and_load(content["program"], inputs, tree)
    return _unflattened(program, content["static"])


@functools.cache
def _safe(folder: Path) -> bool:
    """Whether the cache's folder is this user's alone; said once where it is not."""
    reason = private_folder(folder) or private_folder(folder / "programs")
    if reason is not None:
        _log.warning("compiled programs are not kept: %s", reason)
    return reason is None and bool(_secret())


@functools.cache
def _secret() -> bytes:
    """This user's secret, made at first; empty where it cannot be kept from others."""
    file = config_folder() / "seal"
    if private_folder(config_folder()) is not None:
        return b""
    try:
        with contextlib.suppress(FileExistsError), open(file, "xb", opener=_mine) as made:
            made.write(os.urandom(32))
        if stat.S_IMODE(file.stat().st_mode) & 0o077 or file.stat().st_uid != os.geteuid():
            return b""
        secret = file.read_bytes()
    except OSError:
        return b""
    return secret if len(secret) == 32 else b""


def _mine(path: str, flags: int) -> int:
    return os.open(path, flags, 0o600)


def _seal(key: str, body: bytes) -> bytes:
    digest = hashlib.sha256(key.encode()).digest() + body
    return hmac.new(_secret(), digest, hashlib.sha256).hexdigest().encode()


def _unflattened(program: Callable, static: Any) -> Callable:
    """The program with its result put together: its arrays, and the `static` words and numbers."""
    words, tree = jax.tree.flatten(static, is_leaf=lambda x: x is None)

    def run(arrays: list[jax.Array]) -> Any:
        moving = tree.flatten_up_to(program(*arrays))
        return tree.unflatten([y if x is None else x for x, y in zip(words, moving, strict=True)])

    return run


def _register_lapack() -> None:
    """Have jax hand its LAPACK kernels to XLA, as lowering an operation that needs them does."""
    jax.jit(jax.lax.linalg.cholesky).lower(jax.ShapeDtypeStruct((1, 1), float))


@told()
def _make(function: Callable, leaves: list[Any], tree: Any, key: str, effort: Effort) -> Callable:
    """Trace, lower and compile; keep the program where it can be."""
    arrays, words = [x for x in leaves if isinstance(x, _ARRAY)], []

    def flat(*arrays):
        given = iter(arrays)
        full = [next(given) if isinstance(x, _ARRAY) else x for x in leaves]
        result = function(*jax.tree.unflatten(tree, full))
        static, moving = eqx.partition(result, lambda x: isinstance(x, _STATIC))
        words.append(static)
        return moving

    flat.__name__ = function.__name__
    lowered = jax.jit(flat).lower(*arrays)
    (static,) = words
    text = lowered.as_text()
    kernels = set(re.findall(r"custom_call @(\w+)", text))
    options = compiler_options(effort, text.count("\n"))
    if not all(name.startswith("lapack_") for name in kernels):  # not XLA's own, nor registered
        return _unflattened(lowered.compile(compiler_options=options), static)
    compiled = _compile_afresh(lowered, options)
    result = jax.tree.map(lambda _: 0, lowered.out_info)
    content = {"lapack": bool(kernels), "inputs": len(arrays), "result": result, "static": static}
    try:
        body = zlib.compress(pickle.dumps(content | {"program": serialize(compiled)[0]}), 1)
        jax.block_until_ready(_read(body)(arrays))  # only what has run from there is kept
        if _safe(cache_folder()):
            _store(_file(key), _seal(key, body), body)
    except (OSError, NotImplementedError, RuntimeError) as error:
        _log.info("the program %s is not kept: %s", function.__name__, error)
    return _unflattened(compiled, static)


def _compile_afresh(lowered: Any, options: Any) -> Any:
    """Compile without jax's cache: a program loaded from there cannot be stored again."""
    before = jax.config.jax_enable_compilation_cache  # pyright: ignore
    jax.config.update("jax_enable_compilation_cache", False)
    compilation_cache.reset_cache()  # it asks for the setting once
    try:
        return lowered.compile(compiler_options=options)
    finally:
        jax.config.update("jax_enable_compilation_cache", before)
        compilation_cache.reset_cache()


def _store(file: Path, seal: bytes, body: bytes) -> None:
    """Write at once or not at all; the files unused for longest make room."""
    with tempfile.NamedTemporaryFile(dir=file.parent, suffix=".part", delete=False) as part:
        part.write(seal + b"\n" + body)
    os.replace(part.name, file)
    room = ROOM
    for path, state in sorted(_files(file.parent), key=lambda entry: -entry[1].st_mtime):
        room -= state.st_size
        if room < 0:
            path.unlink(missing_ok=True)


def _files(folder: Path) -> Iterator[tuple[Path, os.stat_result]]:
    """Files that are there now; another process may take some away meanwhile."""
    for path in folder.iterdir():
        with contextlib.suppress(FileNotFoundError):
            yield path, path.stat()
