"""Sweeps on disk: kill and resume, refusals that leave the store readable, exports, pictures."""

import errno
import json
import os
import signal
import subprocess
import sys
import time

import jax.numpy as jnp
import numpy as np
import pytest

import omnijax
from omnijax import InputError, load_rig, load_sweep, sweep
from omnijax.cli._frame import run
from omnijax.laws import MountSignal
from omnijax.report import sweep_page
from omnijax.rig import law_texts, rig_identity
from omnijax.study import quantity_text
from omnijax.study._sweep.evaluator import machine_in, quantities
from omnijax.study._sweep.plan import Numerics, Sampling, plan
from omnijax.study._sweep.spec import SweepSpec, differences_of
from omnijax.study._sweep.store import Store, chunk_files, create_store

VARY = {"wheel.roundness": "0.2:0.6:4", "contact.stiffness": "log:5e4:1e6:5"}
SPEEDS = (0.1, 1.2, 0.3)
DURATION = "20ms"  # a store is one of any method: this one is compiled soon
TEXTS = [f"--vary={path}={text}" for path, text in VARY.items()]
SLOW = """
import time
from omnijax.cli import main
from omnijax.study._sweep.store import Store
write = Store.write
written = []
# after the third chunk it waits for the test to kill it
Store.write = lambda *args: (len(written) == 3 and time.sleep(600), write(*args), written.append(1))
main()
"""
COMMAND = ["sweep", "atlas", *TEXTS, "--speed", "0.1,1.2,0.3", "--duration", DURATION]
COMMAND += ["--chunk", "2"]


def steady(out=None, **options):
    return sweep("atlas", VARY, speeds=SPEEDS, duration=DURATION, chunk=2, out=out, **options)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A sweep that ran through."""
    return steady(tmp_path_factory.mktemp("sweep") / "whole.zarr")


def same(a, b) -> bool:
    return all(np.array_equal(a.store.read(n), b.store.read(n)) for n in b.store.names)


def test_a_store_may_be_an_empty_folder(tmp_path):
    """It was refused: "continue it with --resume", and with that "is not the store of a sweep"."""
    (tmp_path / "new").mkdir()
    words = ["--vary", "wheel.roundness=0.1,0.2", "--speed", "1,1,1", "--duration", "20ms"]
    assert run(["sweep", "atlas", *words, "--out", str(tmp_path / "new")]) == 0
    assert load_sweep(tmp_path / "new").store.done().all()


def test_killed_sweep_loses_at_most_a_chunk_and_resumes_bit_identically(whole, tmp_path, capsys):
    out = tmp_path / "killed.zarr"
    process = subprocess.Popen(
        [sys.executable, "-c", SLOW, *COMMAND, "--out", str(out)], stderr=subprocess.DEVNULL
    )
    while len(chunk_files(out)) < 2:
        assert process.poll() is None, "the sweep ended before it could be killed"
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGSTOP)  # however busy the machine is, the rest stays undone
    assert run(["sweep-status", str(out)]) == 0
    assert "running" in capsys.readouterr().out
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    partial = load_sweep(out)
    done = partial.store.done()
    assert 2 <= done.sum() < len(done)
    finished = np.flatnonzero(done)[-1] * 2 + 2
    assert np.array_equal(partial.store.read("peak")[:finished], whole["peak"].ravel()[:finished])
    assert (partial.store.read("status")[finished:] == -1).all()
    before = chunk_files(out)
    assert run(["sweep-status", str(out)]) == 0
    text = capsys.readouterr().out
    assert "stopped" in text and "--resume" in text
    assert run([*COMMAND, "--out", str(out), "--resume"]) == 0
    assert same(load_sweep(out), whole)
    assert {k: chunk_files(out)[k] for k in before} == before  # finished chunks stay untouched


def test_interruption_keeps_what_is_done_and_says_how_to_go_on(
    whole, tmp_path, monkeypatch, capsys
):
    out = tmp_path / "stopped.zarr"

    def stop(store, chunk, columns, write=Store.write):
        if chunk == 3:
            raise KeyboardInterrupt
        write(store, chunk, columns)

    monkeypatch.setattr(Store, "write", stop)
    assert run([*COMMAND, "--out", str(out)]) == 130
    assert "6 of 20 designs are done and kept" in capsys.readouterr().err
    assert run(["export", str(out), str(tmp_path / "part.csv")]) == 0  # it said 20 designs
    captured = capsys.readouterr()
    assert captured.out.endswith("part.csv: 6 of 20 designs are done\n")
    assert "6 of 20 designs are done; the figures of the others are nan in part.csv" in captured.err
    monkeypatch.undo()
    assert run([*COMMAND, "--out", str(out), "--resume"]) == 0
    assert same(load_sweep(out), whole)


def test_changed_rig_or_question_is_refused_with_the_keys(whole, capsys):
    out = whole.store.folder
    other = omnijax.set_parameter(load_rig("atlas"), "wheel.w2.radius", 0.08)
    asked = {"duration": DURATION, "out": out, "resume": True}
    with pytest.raises(InputError, match=r"rig\.wheel\.w2\.radius: 0\.0758 -> 0\.08") as error:
        sweep(other, VARY, speeds=SPEEDS, **asked)
    assert "wheel.w1" not in str(error.value)
    with pytest.raises(InputError, match=r"vary\.wheel\.roundness: '0\.2:0\.6:4' -> '0\.2:0\.6:8'"):
        sweep("atlas", VARY | {"wheel.roundness": "0.2:0.6:8"}, speeds=SPEEDS, **asked)
    with pytest.raises(InputError, match=r"drive\.speed\.values"):
        sweep("atlas", VARY, speeds=(0.1, 1.2, 0.4), **asked)
    with pytest.raises(InputError, match="exists already"):
        steady(out)
    assert run([*COMMAND, "--metric", "rms", "--out", str(out), "--resume"]) == 2
    assert "metrics: 'peak, rms' -> 'rms'" in capsys.readouterr().err
    assert load_sweep(out).counts() == {"ok": 20}


def test_folder_that_is_no_store_and_store_in_use_are_refused(whole, tmp_path):
    with pytest.raises(InputError, match="not the store of a sweep"):
        load_sweep(tmp_path)
    with pytest.raises(InputError, match="no such folder"):
        load_sweep(tmp_path / "absent")
    from omnijax.study._sweep.store import lock

    held = lock(whole.store.folder)
    with pytest.raises(InputError, match="another process is writing"):
        steady(whole.store.folder, resume=True)
    held.release()


def test_full_disk_is_one_sentence_and_the_store_stays_readable(tmp_path, monkeypatch, capsys):
    out = tmp_path / "full.zarr"

    def full(store, chunk, columns, write=Store.write):
        if chunk == 2:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write(store, chunk, columns)

    monkeypatch.setattr(Store, "write", full)
    assert run([*COMMAND, "--out", str(out)]) == 2
    text = capsys.readouterr().err
    assert "No space left on device" in text and "--resume" in text and "Traceback" not in text
    assert load_sweep(out).counts() == {"not done": 16, "ok": 4}


def test_store_appears_whole_or_not_at_all(whole, tmp_path, monkeypatch):
    import zarr

    def broken(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(zarr.Group, "create_array", broken)
    with pytest.raises(OSError, match="No space"):
        create_store(tmp_path / "x.zarr", whole.spec, quantities(whole.spec), {})
    assert list(tmp_path.iterdir()) == []


def test_rerun_and_status_as_json(whole, capsys):
    folder = str(whole.store.folder)
    assert run(["sweep-status", folder, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["done"] == found["designs"] == 20 and found["running"] is False
    assert found["status"] == {"ok": 20} and found["method"] == "bulk"
    assert run(["sweep-status", folder, "--rerun", "13", "--json"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert again["peak"] == whole.store.read("peak")[13]
    assert again["status"] == "ok"
    assert run(["sweep-status", folder, "--rerun", "20"]) == 2
    assert "`design` must lie in [0, 19], but is 20." in capsys.readouterr().err


def test_exports_hold_the_same_numbers_with_units(whole, tmp_path, capsys):
    xr, pd = pytest.importorskip("xarray"), pytest.importorskip("pandas")
    pq = pytest.importorskip("pyarrow.parquet")
    for end in ("nc", "csv", "parquet"):
        assert run(["export", str(whole.store.folder), str(tmp_path / f"s.{end}")]) == 0
    with xr.open_dataset(tmp_path / "s.nc") as data:
        assert data["peak"].dims == ("wheel.roundness", "contact.stiffness")
        np.testing.assert_array_equal(data["peak"], whole["peak"])
        assert data["peak"].attrs["units"] == "m"
        assert data["contact.stiffness"].attrs["units"] == "N/m"
        assert "[sphere]" in data.attrs["rig"] and "jax" in data.attrs["versions"]
    table = pd.read_csv(tmp_path / "s.csv")
    np.testing.assert_array_equal(table["peak [m]"], whole["peak"].ravel())
    assert (table["status"] == "ok").all()
    parquet = pq.read_table(tmp_path / "s.parquet")
    np.testing.assert_array_equal(parquet["rms"], whole["rms"].ravel())
    assert parquet.schema.field("rms").metadata[b"units"] == b"m"
    assert run(["export", str(whole.store.folder), str(tmp_path / "s.xls")]) == 2
    assert "must end in .nc, .csv, .parquet" in capsys.readouterr().err


def test_store_opens_in_xarray_alone(whole):
    xr = pytest.importorskip("xarray")
    with xr.open_zarr(whole.store.folder, consolidated=False, chunks=None) as data:
        np.testing.assert_array_equal(data["peak"], whole["peak"].ravel())
        assert data["contact.stiffness"].attrs["units"] == "N/m"
        assert json.loads(data.attrs["spec"])["seed"] == 0


def test_save_and_load_are_equal(whole, tmp_path):
    copy = whole.save(tmp_path / "copy.zarr")
    assert same(copy, whole) and load_sweep(tmp_path / "copy.zarr").spec == whole.spec


def test_page_answers_first_and_holds_what_makes_it_again(whole, tmp_path):
    page = sweep_page(whole).write(tmp_path)
    text = page.read_text(encoding="utf-8")
    best = whole.design(whole.best("peak"))
    assert f"The best peak is {quantity_text(best['peak'], 'm')}" in text
    assert "[sphere]" in text and 'src="http' not in text and 'href="http' not in text
    assert {f.name for f in tmp_path.iterdir()} >= {"sweep-peak.png", "best-rms.csv", "index.html"}


def test_pictures_show_the_numbers(whole, tmp_path):
    factor, unit = whole.readable("peak")
    assert unit in {"mm", "µm"} and 0.1 <= factor * np.nanmax(whole["peak"]) < 1000
    ax = whole.plot_heatmap("peak")
    np.testing.assert_array_equal(ax.collections[0].get_array(), factor * whole["peak"].T)
    assert ax.get_ylabel() == "contact stiffness (kN/m)" and ax.get_yscale() == "log"
    assert ax.get_xlabel() == "wheel roundness"
    ax = whole.plot_lines("rms", x="contact.stiffness")
    factor, unit = whole.readable("rms")
    np.testing.assert_array_equal(ax.lines[0].get_ydata(), factor * whole["rms"][0])
    assert len(ax.lines) == 4 and ax.get_ylabel() == f"rms ({unit})"
    with pytest.raises(InputError, match="not varied"):
        whole.plot_heatmap("peak", x="sphere.mass")


def damaged_copy(whole, tmp_path, name, work):
    """A copy of the store with one file changed by `work`."""
    import shutil

    copy = tmp_path / "damaged.zarr"
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(whole.store.folder, copy)
    work(copy / name)
    return copy


def flip(file):
    raw = bytearray(file.read_bytes())
    raw[len(raw) // 2] ^= 4
    file.write_bytes(raw)


DAMAGE = {
    "flipped": (flip, "is damaged"),
    "missing": (lambda file: file.unlink(), "is missing"),
    "empty": (lambda file: file.write_bytes(b""), "is cut off"),
    "cut": (lambda file: file.write_bytes(file.read_bytes()[:-5]), "is damaged"),
}


@pytest.mark.parametrize("kind", DAMAGE)
def test_a_damaged_chunk_is_named_and_computed_again(whole, tmp_path, capsys, kind):
    work, said = DAMAGE[kind]
    copy = damaged_copy(whole, tmp_path, "rms/c/3", work)
    with pytest.warns(UserWarning, match=rf"rms/c/3 {said}: its designs count as not done"):
        found = load_sweep(copy)
    assert found.counts() == {"not done": 2, "ok": 18}
    good = np.delete(np.arange(20), [6, 7])
    assert np.array_equal(found["rms"].ravel()[good], whole["rms"].ravel()[good])
    assert np.isnan(found["rms"].ravel()[[6, 7]]).all()
    assert run(["sweep-status", str(copy)]) == 1
    assert f"rms/c/3 {said}" in capsys.readouterr().err
    assert run(["export", str(copy), str(tmp_path / "x.csv")]) == 1
    assert (tmp_path / "x.csv").read_text().count("not done") == 2
    assert run([*COMMAND, "--out", str(copy), "--resume"]) == 0
    assert same(load_sweep(copy), whole)


def test_no_flipped_bit_goes_unnoticed(whole, tmp_path):
    generator = np.random.default_rng(0)
    copy = damaged_copy(whole, tmp_path, "zarr.json", lambda file: None)
    files = sorted(x for x in copy.rglob("*") if x.is_file())
    for _ in range(60):
        file = files[generator.integers(len(files))]
        raw = file.read_bytes()
        bit = int(generator.integers(8 * len(raw)))
        changed = bytearray(raw)
        changed[bit // 8] ^= 1 << bit % 8
        file.write_bytes(changed)
        with pytest.raises((InputError, UserWarning)):  # warnings are errors here
            load_sweep(copy)
        file.write_bytes(raw)
    assert same(load_sweep(copy), whole)


LAW = '''
from omnijax.laws import AbstractMount, Parameter


class Damper(AbstractMount):
    """Mount tension += d |rate| rate."""

    d: object
    id = "quadratic-damper"
    places = ("wheel", "all")
    formula = "mount tension += d |rate| rate"
    parameters = {"d": Parameter("N s^2/m^2", low=0, linear=True)}

    def __call__(self, signal, state=None):
        return self.d * abs(signal.rate) * signal.rate
'''


def test_a_sweep_carries_the_texts_of_its_users_laws(tmp_path, monkeypatch):
    """A law file had been looked for in the working folder, and only its name been compared."""
    monkeypatch.setenv("OMNIJAX_TRUSTED_LAWS", "")
    specs, machines = [], []
    for folder, text in (("one", LAW), ("other", LAW.replace("abs(signal.rate)", "0.5"))):
        file = tmp_path / folder / "damper.py"
        file.parent.mkdir()
        file.write_text(text, encoding="utf-8")
        law = omnijax.load_laws(file)["quadratic-damper"]
        rig = load_rig("atlas").add(law(np.asarray(4e5)), "w1")
        sampling, numerics = Sampling("grid", None, 0, False, None, 1), Numerics(
            "coupled", "auto", 0.1, 500.0, 1e-6, None
        )  # fmt: skip
        drive = omnijax.speeds(SPEEDS)
        specs.append(plan(rig, {"wheel.radius": "0.07,0.08"}, "rms", drive, sampling, numerics)[0])
        machines.append(rig)
        file.unlink()
    for spec, rig in zip(specs, machines, strict=True):
        again, _ = machine_in(SweepSpec.from_json(spec.to_json()))
        assert type(again.effects[0].law) is type(rig.effects[0].law)
    (difference,) = differences_of(*specs)
    assert difference.startswith("laws.damper.py: ")
    assert rig_identity(machines[0]) != rig_identity(machines[1])
    allowed = os.environ["OMNIJAX_TRUSTED_LAWS"]
    monkeypatch.setattr("omnijax.rig._user_laws._LOADED", {})  # as in another process
    monkeypatch.setenv("OMNIJAX_TRUSTED_LAWS", "")  # a store from elsewhere runs nothing unasked
    with pytest.raises(InputError, match="is run only after you have allowed it"):
        machine_in(specs[0])
    monkeypatch.setenv("OMNIJAX_TRUSTED_LAWS", allowed)  # what a worker inherits
    (placed,) = machine_in(specs[0])[0].effects
    assert float(placed.law(MountSignal(0.0, jnp.asarray(-2.0), 0.0, 0.0))) == -1.6e6
    with pytest.raises(InputError, match=r"two law files are called damper\.py"):
        law_texts(machines[0].add(machines[1].effects[0].law, "w2"))
