"""Programs kept across processes: the same results, and nothing but them from what lies there."""

import os
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiers import more

from omnijax import _programs, _waiting
from omnijax._compiling import Effort, quick_jit
from omnijax._programs import kept
from omnijax.dynamics._attitude import quaternion_of
from omnijax.vibration._amplitude import peak_to_peak

RIGHT = jnp.array([3.0, -1.0, 0.5])
MATRIX = jnp.array([[4.0, 1.0, 0.0], [1.0, 3.0, -1.0], [0.5, -1.0, 2.0]])


class Counted:
    """A kept function that says how often it was traced; each new one has forgotten the last."""

    def __init__(self, scale: float = 1.0):
        self.traced = 0

        def solution(matrix, right):
            self.traced += 1
            return scale * jnp.linalg.solve(matrix, jnp.sin(right))

        self.call = kept(solution)

    def __call__(self, *args):
        return self.call(*args)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Where the programs of a test lie."""
    if len(jax.devices()) > 1 or not sys.platform.startswith("linux"):
        pytest.skip("programs are kept for one CPU device under Linux")
    monkeypatch.setenv("OMNIJAX_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("OMNIJAX_KEEP_PROGRAMS", "1")
    return tmp_path / "programs"


def _first(folder):
    first = Counted()
    values = np.asarray(first(MATRIX, RIGHT))
    assert first.traced == 1
    assert len(list(folder.iterdir())) == 1
    return values


def test_a_kept_program_is_not_traced_again(folder):
    values = _first(folder)
    again = Counted()
    assert np.array_equal(again(MATRIX, RIGHT), values)
    assert np.array_equal(again(2 * MATRIX, RIGHT), np.asarray(Counted()(2 * MATRIX, RIGHT)))
    assert again.traced == 0
    again(MATRIX[:2, :2], RIGHT[:2])  # another shape is another program
    assert again.traced == 1


def test_words_and_numbers_of_a_result_are_kept_beside_its_arrays(folder):
    def described(right, count):
        return {"twice": 2 * right, "kind": ("wave", count), "last": right[-1]}

    for given in (RIGHT, 3 * np.asarray(RIGHT)):  # the second by what the first has stored
        found = kept(described)(given, 4)
        assert found["kind"] == ("wave", 4)
        assert np.array_equal(found["twice"], 2 * given)
        assert found["last"] == given[-1]
    assert len(list(folder.iterdir())) == 1


def test_quick_code_and_fast_code_are_kept_apart(folder):
    """A sweep of a million designs is not given what was compiled in a hurry for a few."""

    def solution(right):
        return jnp.sin(right)

    for effort in (*Effort, *Effort):
        assert np.array_equal(kept(solution)(RIGHT, effort=effort), np.asarray(jnp.sin(RIGHT)))
    assert len(list(folder.iterdir())) == 3


@pytest.mark.parametrize("harm", ["cut", "bit", "empty", "text"])
def test_a_damaged_file_is_made_again(folder, harm):
    values = _first(folder)
    (file,) = folder.iterdir()
    body = bytearray(file.read_bytes())
    body[len(body) // 2] ^= 1
    harmed = {"cut": body[: len(body) // 3], "bit": body, "empty": b"", "text": b"no program"}
    file.write_bytes(harmed[harm])
    again = Counted()
    assert np.array_equal(again(MATRIX, RIGHT), values)
    assert again.traced == 1
    third = Counted()
    assert np.array_equal(third(MATRIX, RIGHT), values)
    assert third.traced == 0  # the file is whole again


def test_a_program_of_other_origin_is_not_taken(folder, monkeypatch):
    _first(folder)
    origin = _programs._origin()
    monkeypatch.setattr(_programs, "_origin", lambda: origin + "x")  # another version, processor …
    again = Counted()
    again(MATRIX, RIGHT)
    assert again.traced == 1
    assert len(list(folder.iterdir())) == 2


def test_a_program_under_a_wrong_name_is_not_taken(folder):
    _first(folder)
    (first,) = folder.iterdir()
    other = Counted(scale=2.0)
    expected = other(MATRIX[:2, :2], RIGHT[:2])
    (second,) = set(folder.iterdir()) - {first}
    second.write_bytes(first.read_bytes())
    again = Counted(scale=2.0)
    assert np.array_equal(again(MATRIX[:2, :2], RIGHT[:2]), expected)
    assert again.traced == 1


def test_settings_and_flags_are_part_of_the_key(folder):
    _first(folder)
    again = Counted()
    with jax.default_matmul_precision("float32"):
        again(MATRIX, RIGHT)
    assert again.traced == 1
    assert "XLA_FLAGS=" + os.environ.get("XLA_FLAGS", "") in _programs._origin() or (
        "XLA_FLAGS" not in os.environ
    )


def test_the_switch_turns_it_off(folder, monkeypatch):
    monkeypatch.setenv("OMNIJAX_KEEP_PROGRAMS", "0")
    off = Counted()
    off(MATRIX, RIGHT)
    assert off.traced == 1
    assert not folder.exists()


def test_the_least_used_files_make_room(folder, monkeypatch):
    for size in (1, 2, 3):
        Counted()(MATRIX[:size, :size], RIGHT[:size])
        largest = max(file.stat().st_size for file in folder.iterdir())
        monkeypatch.setattr(_programs, "ROOM", 2.5 * largest)
    assert len(list(folder.iterdir())) == 2


def test_threads_that_ask_at_once_trace_one_program(folder):
    counted, together = Counted(), threading.Barrier(4)

    def ask(_):
        together.wait()
        return np.asarray(counted(MATRIX, RIGHT))

    with ThreadPoolExecutor(4) as pool:
        values = list(pool.map(ask, range(4)))
    assert counted.traced == 1
    assert all(np.array_equal(x, values[0]) for x in values)


def half(x):
    """A function that is no part of the package."""
    return x / 2


def test_functions_of_the_package_are_told_apart_and_others_take_the_ordinary_path(folder):
    applied = kept(lambda function, x: function(x))
    for function in (peak_to_peak, quaternion_of, peak_to_peak, quaternion_of):
        np.testing.assert_allclose(applied(function, RIGHT), function(RIGHT), rtol=1e-14)
    assert len(list(folder.iterdir())) == 2
    assert np.array_equal(applied(half, RIGHT), RIGHT / 2)
    assert len(list(folder.iterdir())) == 2


def test_no_room_to_write_is_no_failure(folder):
    folder.write_text("a file where the folder should be")
    found = Counted()
    assert np.isfinite(found(MATRIX, RIGHT)).all()
    assert found.traced == 1


def test_transformations_take_the_ordinary_path(folder):
    def total(matrix):
        return jnp.sum(Counted()(matrix, RIGHT))

    def plain(matrix):
        return jnp.sum(jnp.linalg.solve(matrix, jnp.sin(RIGHT)))

    assert np.allclose(jax.grad(total)(MATRIX), jax.grad(plain)(MATRIX), rtol=1e-12)
    both = jnp.stack([MATRIX, 2 * MATRIX])
    assert np.allclose(jax.vmap(total)(both), jax.vmap(plain)(both), rtol=1e-12)
    assert np.allclose(jax.jit(total)(MATRIX), plain(MATRIX), rtol=1e-12)
    with jax.disable_jit():
        assert np.allclose(total(MATRIX), plain(MATRIX), rtol=1e-12)
    assert not folder.exists()


class Outside(NamedTuple):
    """A class that the package's digest knows nothing of."""

    value: jax.Array


def test_classes_from_outside_take_the_ordinary_path(folder):
    calls = kept(lambda x: 2 * x.value)
    assert np.array_equal(calls(Outside(RIGHT)), 2 * RIGHT)
    assert not folder.exists()


RUN = """
run = omnijax.simulate(rig, omnijax.speeds([0.1, 1.2, 0.3]), np.linspace(0, 0.2, 50))
values = [np.asarray(getattr(run, name)).tobytes() for name in run.UNITS]
"""
BULK = """
found = omnijax.sweep(rig, {"wheel.roundness": np.linspace(0.1, 0.4, 40)}, duration=2.0,
    drive=omnijax.speeds([0.1, 1.2, 0.3]), metrics=["rms", "peak"])
values = [found[name].tobytes() for name in ("rms", "peak")]
"""


# in the gate without the third process, which keeps no program
@pytest.mark.parametrize(
    "work, third",
    [(RUN, False), *more((RUN, True), (BULK, True))],
    ids=["run", "run thrice", "sweep thrice"],
)
def test_a_second_process_gives_the_same_bits_without_tracing(folder, work, third):
    text = f"""
import hashlib, jax, numpy as np, omnijax
rig = omnijax.load_rig("atlas")
{work}
from omnijax import _programs, _waiting
print(hashlib.sha256(b"".join(values)).hexdigest())
"""
    refuse = "import omnijax._programs\nomnijax._programs._make = None\n"
    refuse += "from omnijax.simulation._modal import bulk\nbulk.samples_of = None\n"

    def process(text, **more):
        environment = {**os.environ, **more}
        done = subprocess.run(
            [sys.executable, "-c", text],
            capture_output=True,
            check=False,
            text=True,
            env=environment,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    first = process(text)
    assert process(refuse + text) == first
    if third:
        assert process(text, OMNIJAX_KEEP_PROGRAMS="0") == first


def test_every_source_of_the_package_counts(monkeypatch, tmp_path):
    monkeypatch.setattr(_programs, "__file__", str(tmp_path / "_programs.py"))
    deep = tmp_path / "simulation" / "_exact" / "expm.py"
    deep.parent.mkdir(parents=True)
    found = set()
    for text in ("x = 1", "x = 2", "x = 1"):
        deep.write_text(text)
        found.add(_programs._origin.__wrapped__())
    assert len(found) == 2


@pytest.mark.parametrize(("length", "told"), [(0.0, 0), (0.5, 1)])
def test_a_long_compilation_is_told_once(monkeypatch, length, told):
    said = []
    monkeypatch.setattr(_waiting, "PATIENCE", 0.1)
    monkeypatch.setattr(_waiting, "listeners", [lambda: said.append("compiling")])
    for _ in range(2):
        with _waiting.told():
            time.sleep(length)
    assert len(said) == told


def test_tracing_is_not_told_of(monkeypatch):
    """It is done anew in every process: the next one waited for it, though it was said not to."""
    said = []
    monkeypatch.setattr(_waiting, "PATIENCE", 0.2)
    monkeypatch.setattr(_waiting, "listeners", [lambda: said.append("compiling")])

    def traced(x):
        time.sleep(1.0)
        return x + 1

    assert quick_jit(traced)(1.0) == 2.0
    assert not said


def test_the_end_of_one_threads_compilation_silences_no_other(monkeypatch):
    said = threading.Event()
    monkeypatch.setattr(_waiting, "PATIENCE", 0.2)
    monkeypatch.setattr(_waiting, "listeners", [said.set])
    patience = _waiting.Patience()
    patience.start()
    other = threading.Thread(target=lambda: (patience.start(), patience.stop()))
    other.start()
    other.join()
    assert said.wait(10)
    patience.stop()


def test_a_traced_function_takes_in_what_it_calls_with_known_numbers(monkeypatch):
    """jax refuses a compiler's options inside another program: none of the arguments is traced."""
    monkeypatch.setenv("OMNIJAX_KEEP_PROGRAMS", "0")
    counted = Counted()
    wanted = counted(MATRIX, RIGHT)
    inside = jax.jit(lambda x: x * counted(MATRIX, RIGHT))
    np.testing.assert_allclose(inside(2.0), 2 * wanted, rtol=1e-14)
