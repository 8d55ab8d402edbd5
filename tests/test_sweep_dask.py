"""Sweeps over Dask: a killed worker costs its chunk only; what is missing or absent is said."""

import os
import signal
import sys
from pathlib import Path

import numpy as np
import pytest
from tiers import tiered

from omnijax import InputError, load_sweep, sweep
from omnijax._errors import RunError
from omnijax.cli._frame import run

VARY = {"wheel.roundness": "0.2:0.6:4", "contact.stiffness": "log:5e4:1e6:5"}
SPEEDS = (0.1, 1.2, 0.3)
COMMAND = ["sweep", "atlas", "--speed", "0.1,1.2,0.3", "--vary", "wheel.roundness=0.2,0.3"]


@pytest.mark.full  # in the gate: a cluster that goes, and a killed process (test_sweep_store)
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_killed_worker_costs_only_its_chunk(tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setenv("OMNIJAX_KEEP_PROGRAMS", "1")  # workers load what is compiled here
    out, killed = tmp_path / "dask.zarr", []
    alone = sweep("atlas", VARY, speeds=SPEEDS, chunk=2)
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs=50
    )
    with cluster:

        def kill(store, chunk, status):
            if not killed:
                killed.append(cluster.workers[0].pid)
                os.kill(killed[0], signal.SIGKILL)

        address = cluster.scheduler_address
        result = sweep(
            "atlas", VARY, speeds=SPEEDS, chunk=2, out=out, scheduler=address, report=kill
        )
    assert len(killed) == 1 and result.counts() == {"ok": 20}
    for name in ("peak", "rms", "wheel.roundness", "contact.stiffness"):
        assert np.array_equal(load_sweep(out)[name], alone[name])


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.parametrize("gone", tiered(["workers", "scheduler"], "workers".__eq__))
def test_a_cluster_that_has_gone_is_said_and_what_is_done_is_kept(tmp_path, monkeypatch, gone):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr("omnijax.study._sweep.dask.PATIENCE", 1.0)
    out, chunks = tmp_path / "gone.zarr", []
    # threads of this process load no programs anew
    cluster = distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0", silence_logs=50
    )

    def leave(store, chunk, status):
        chunks.append(chunk)
        if len(chunks) == 1:
            cluster.scale(0) if gone == "workers" else cluster.close()

    with cluster, pytest.raises(RunError, match=f"{gone[:-1]}.* gone. What is done is kept"):
        sweep(
            "atlas", VARY, speeds=SPEEDS, duration="20ms", chunk=1, out=out, report=leave,
            scheduler=cluster.scheduler_address,
        )  # fmt: skip
    kept = load_sweep(out).store.done()
    assert len(chunks) <= kept.sum() < 20
    again = sweep(
        "atlas", VARY, speeds=SPEEDS, duration="20ms", chunk=1, out=out, resume=True
    )  # fmt: skip
    assert again.counts() == {"ok": 20}


@pytest.mark.full
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_killed_worker_of_a_local_cluster_costs_only_its_chunk(tmp_path):
    pytest.importorskip("distributed")
    out, killed = tmp_path / "local.zarr", []

    def kill(store, chunk, status):
        if not killed:
            killed.extend(_children("spawn_main")[:1])
            os.kill(killed[0], signal.SIGKILL)

    result = sweep("atlas", VARY, speeds=SPEEDS, chunk=2, out=out, workers=2, report=kill)
    assert len(killed) == 1 and result.counts() == {"ok": 20}
    alone = sweep("atlas", VARY, speeds=SPEEDS, chunk=2)
    assert np.array_equal(load_sweep(out)["peak"], alone["peak"])
    assert killed[0] not in _children("spawn_main") and not _children("spawn_main")


def _children(word: str) -> list[int]:
    """This process's running children with `word` in their command, by number."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            parent = (entry / "stat").read_text().rpartition(")")[2].split()[1]
            command = (entry / "cmdline").read_text()
        except OSError:
            continue
        if int(parent) == os.getpid() and word in command:
            found.append(int(entry.name))
    return sorted(found)


def test_scheduler_that_is_not_there_is_one_sentence(tmp_path, capsys, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("omnijax.study._sweep.dask.REACH", 1)
    out = tmp_path / "x.zarr"
    words = [*COMMAND, "--out", str(out), "--scheduler", "tcp://127.0.0.1:9"]
    assert run(words) == 2
    error = capsys.readouterr().err
    assert "scheduler tcp://127.0.0.1:9 cannot be reached" in error and "Traceback" not in error
    assert not out.exists()  # no store of nothing
    assert run([*COMMAND, "--out", str(out), "--resume", "--scheduler", "nonsense:"]) == 2
    assert "scheduler nonsense: cannot be reached" in capsys.readouterr().err


def test_missing_package_is_named_with_its_command(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'omnijax\[distributed\]'"):
        sweep("atlas", VARY, speeds=SPEEDS, out=tmp_path / "x.zarr", workers=2)


def test_contradictions_are_refused(tmp_path):
    with pytest.raises(InputError, match="not both"):
        sweep("atlas", VARY, speeds=SPEEDS, out=tmp_path / "x.zarr", workers=1, scheduler="a")
    with pytest.raises(InputError, match="need a store"):
        sweep("atlas", VARY, speeds=SPEEDS, workers=2)
