"""Single bits that flip in what is stored: each is named, or changes no number."""

import random
import shutil
from collections.abc import Callable
from pathlib import Path

from .commands import SPEED, SWEEP, here

COPY = Path("copy")


def flips(number: int, seed: int = 0) -> tuple[int, list[str]]:
    """(flips, those that went unnoticed): in a store, in a study's folder and in a run."""
    rng = random.Random(seed)
    kinds = {"run": _run, "folder": _folder, "store": _store}
    counts = {"run": number // 4, "folder": number // 8}
    counts["store"] = number - sum(counts.values())
    wrong = [x for k, make in kinds.items() for x in _unnoticed(k, make, counts[k], rng)]
    return number, wrong


def flips_of_a_store(number: int, seed: int) -> tuple[int, list[str]]:
    """The same of a store alone."""
    return number, _unnoticed("store", lambda: (Path("store.zarr"), _export), number,
                              random.Random(seed))  # fmt: skip


def _unnoticed(kind: str, make: Callable, number: int, rng: random.Random) -> list[str]:
    original, read = make()
    right, wrong = read(original), []
    for k in range(number):
        shutil.rmtree(COPY, ignore_errors=True)
        said = _flipped(original, rng, read, right)
        if said:
            wrong.append(f"{kind} {k}: {said}")
    return wrong


def _flipped(original: Path, rng: random.Random, read, right) -> str | None:
    copy = COPY / original.name
    if original.is_dir():
        shutil.copytree(original, copy)
        file = rng.choice([p for p in sorted(copy.rglob("*")) if p.is_file() and p.stat().st_size])
    else:
        COPY.mkdir()
        file = Path(shutil.copy(original, copy))
    content = bytearray(file.read_bytes())
    at, bit = rng.randrange(len(content)), rng.randrange(8)
    content[at] ^= 1 << bit
    file.write_bytes(content)
    try:
        found = read(copy)
    except Exception as error:
        return f"{file}, byte {at}, bit {bit}: {type(error).__name__}: {str(error)[:150]}"
    noticed = found[0] != 0 or bool(found[1].strip())
    if "Traceback" in found[1]:
        return f"{file}, byte {at}, bit {bit}: traceback"
    if not noticed and found[2] != right[2]:
        return f"{file}, byte {at}, bit {bit}: other numbers, and not a word"
    return None


def _store():
    answer = here([*SWEEP.split(), "--chunk", "4", "--out", "flip.zarr"])
    assert answer.code == 0, answer.err
    return Path("flip.zarr"), _export


def _export(path: Path) -> tuple[int, str, bytes]:
    table = Path("table.csv")
    answer = here(["export", str(path), str(table), "--force"])
    content = table.read_bytes() if answer.code == 0 else b""
    return answer.code or 0, answer.err, content


def _folder():
    words = ["tolerances", "study.toml", "--draws", "128", "--json"]
    answer = here([*words, "--store", "flip"])
    assert answer.code in (0, 1), answer.err

    def read(path: Path) -> tuple[int, str, bytes]:
        again = here([*words, "--store", str(path), "--resume"])
        return int(again.code == 2), again.err, again.out.encode()

    return Path("flip"), read


def _run():
    answer = here(["simulate", "rig.toml", *SPEED, "--duration", "0.4s", "--out", "flip.nc"])
    assert answer.code == 0, answer.err

    def read(path: Path) -> tuple[int, str, bytes]:
        from omnijax import InputError, load_run

        try:
            run = load_run(path)
        except InputError as error:
            return 2, str(error), b""
        return 0, "", b"".join(bytes(run[name]) for name in run.UNITS)

    return Path("flip.nc"), read
