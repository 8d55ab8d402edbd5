"""Recordings that unpack beyond memory are refused before they are unpacked."""

import numpy as np
import pytest
from recordings import columns

from omnijax import InputError, _memory, read_recording
from omnijax.recording._formats.mat import mat_sizes

ROWS = 60_000
FREE = 4e6  # bytes: the recording needs more, its packed file less


def parquet(path, table):
    arrow = pytest.importorskip("pyarrow")
    pytest.importorskip("pyarrow.parquet").write_table(arrow.table(table), path)


def mat(path, table):
    import scipy.io

    scipy.io.savemat(path, table, do_compression=True)


def struct(path, table):
    import scipy.io

    scipy.io.savemat(path, {"run": table}, do_compression=True)


def hdf(path, table):
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in table.items():
            file.create_dataset(name, data=values, compression="gzip")
    head = b"MATLAB 7.3 MAT-file".ljust(124) + bytes([0, 2]) + b"IM"
    with path.open("r+b") as file:
        file.write(head)


def mdf(path, table):
    asammdf = pytest.importorskip("asammdf")
    signals = [
        asammdf.Signal(x, timestamps=table["t"], name=k) for k, x in table.items() if k != "t"
    ]
    with asammdf.MDF() as file:
        file.append(signals)
        file.save(path, compression=2)


@pytest.mark.parametrize("write", [parquet, mat, struct, hdf, mdf])
def test_what_unpacks_beyond_memory_is_refused(tmp_path, monkeypatch, write):
    table = {name: np.zeros(ROWS) for name in columns(samples=1)}
    table["t"] = 2e-3 * np.arange(ROWS)
    suffix = {parquet: ".parquet", mdf: ".mf4"}.get(write, ".mat")
    path = tmp_path / f"run{suffix}"
    write(path, table)
    assert path.stat().st_size < 0.25 * FREE
    assert len(read_recording(path).time) == ROWS
    monkeypatch.setattr(_memory, "available", lambda: FREE)
    with pytest.raises(InputError, match=r"unpacks to \d\.?\d* MB, but memory has room for 1 MB"):
        read_recording(path)


def test_the_size_of_a_packed_matlab_file_is_that_of_its_elements(tmp_path):
    rng = np.random.default_rng(4)
    rows = int(rng.integers(1000, 5000))
    mat(tmp_path / "a.mat", {"x": rng.standard_normal(rows)})
    struct(tmp_path / "b.mat", {"x": np.zeros(rows)})
    (tmp_path / "c.mat").write_bytes(b"")
    for name in "ab":
        numbers, stored = mat_sizes(tmp_path / f"{name}.mat")
        assert 8 * rows <= stored < 8 * rows + 1000
    assert numbers == 8  # of a struct its name alone is told
    with pytest.raises(InputError, match=r"c.mat cannot be read"):
        read_recording(tmp_path / "c.mat")
