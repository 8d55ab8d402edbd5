"""Recordings: every format read, every fault of the data found, said and survived."""

import gzip
import os
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from machines import RECORDINGS, machine
from recordings import STEP, columns, write
from seeds import drawn_anew

from omnijax import InputError, Recording, diagnose, read_case, read_recording, write_recording
from omnijax.recording import ordered_rows
from omnijax.recording._copies import LARGE
from omnijax.recording._formats.csv import read_csv
from omnijax.recording._time import GLITCH


def only(recording, kind):
    """The fault of this kind, which must be the only fault."""
    assert [fault.kind for fault in recording.faults] == [kind], list(map(str, recording.faults))
    return recording.faults[0]


def test_a_clean_file_has_no_fault_and_keeps_every_number(tmp_path):
    table = columns()
    note = 'rig = "rig.toml"\nrole = "held-out"\n[noise]\ndR = 2e-6\ndR_z = 3e-6\n'
    run = read_recording(write(tmp_path / "run-1.csv.gz", table, note))
    assert run.faults == []
    assert (run.name, run.wheels, run.held_out) == ("run-1", 3, True)
    assert run.groups == ("dR", "theta")
    assert run.rig_path == tmp_path / "rig.toml"
    assert run.step == pytest.approx(STEP)
    np.testing.assert_allclose(run.group("theta")[:, 2], table["theta_3"], rtol=1e-8)
    assert not run.force.any()  # absent: zero
    assert np.isnan(run.group("a")).all()
    assert [run.declared_noise(c) for c in ("dR_x", "dR_z", "a_x")] == [2e-6, 3e-6, None]


@pytest.mark.parametrize("suffix", [".csv", ".csv.gz", ".parquet", ".CSV.GZ", ".Parquet"])
def test_what_is_written_is_read_back(tmp_path, suffix):
    if suffix.lower() == ".parquet":
        pytest.importorskip("pyarrow")
    run = read_recording(write(tmp_path / "run.csv", columns(80), "[noise]\ndR = 1e-6\n"))
    run.channels["dR_y"][5:8] = np.nan
    again = read_recording(write_recording(tmp_path / f"copy{suffix}", run))
    assert only(again, "missing").rows == ((6, 8),)
    assert again.noise == run.noise
    for column, values in run.channels.items():
        np.testing.assert_array_equal(again.channels[column], values)


def test_matrices_of_a_mat_file_and_units_of_a_netcdf_file(tmp_path):
    import xarray

    table = columns(80)
    whole = {g: np.stack([table[f"{g}_{e}"] for e in ends], 1)
             for g, ends in (("torque", "123"), ("theta", "123"), ("dR", "xyz"))}  # fmt: skip
    scipy.io.savemat(tmp_path / "a.mat", {"t": table["t"], **whole})
    scipy.io.savemat(tmp_path / "b.mat", {"run": {"t": table["t"], **whole}})
    shown = whole | {"dR": 1e3 * whole["dR"]}
    data = xarray.Dataset({group: (("t", group), values) for group, values in shown.items()})
    data["t"] = ("t", table["t"])
    data["dR"].attrs["units"] = "mm"
    data.to_netcdf(tmp_path / "c.nc", engine="h5netcdf")
    for name in ("a.mat", "b.mat", "c.nc"):
        run = read_recording(tmp_path / name)
        assert run.faults == []
        np.testing.assert_allclose(run.group("dR"), whole["dR"], rtol=1e-12)
        np.testing.assert_allclose(run.torque, whole["torque"])


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of the readers' own making
def test_tdms_uff_and_mdf_files(tmp_path):
    nptdms, pyuff = pytest.importorskip("nptdms"), pytest.importorskip("pyuff")
    asammdf = pytest.importorskip("asammdf")
    table = columns(80)
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment([nptdms.ChannelObject("run", k, v) for k, v in table.items()])
    uff, mdf = pyuff.UFF(str(tmp_path / "b.uff")), asammdf.MDF()
    common = {
        "func_type": 1,
        "rsp_node": 1,
        "rsp_dir": 1,
        "ref_dir": 1,
        "ref_node": 1,
        "ord_data_type": 4,
    }
    for name in list(table)[1:]:
        axis = {"x": table["t"], "data": table[name], "binary": 0, "abscissa_spacing": 0}
        full = pyuff.prepare_58(id1=name, **axis, **common, return_full_dict=True)
        uff.write_sets({k: 0 if v is None else v for k, v in full.items()}, "add")
        mdf.append([asammdf.Signal(table[name], timestamps=table["t"], name=name)])
    mdf.save(tmp_path / "c.mf4")
    for name in ("a.tdms", "b.uff", "c.mf4"):
        run = read_recording(tmp_path / name)
        assert run.faults == [], name
        np.testing.assert_allclose(run.group("theta")[:, 1], table["theta_2"], rtol=1e-4)


def test_a_classic_netcdf_file_is_read(tmp_path):
    """It was told to be no netCDF file, though xarray writes it where only SciPy is there."""
    xarray = pytest.importorskip("xarray")
    table = columns(80)
    data = xarray.Dataset({k: ("t", np.asarray(x)) for k, x in table.items() if k != "t"})
    data = data.assign_coords(t=np.asarray(table["t"]))
    data["theta_1"].attrs["units"] = "deg"
    data.to_netcdf(tmp_path / "a.nc", engine="scipy")
    run = read_recording(tmp_path / "a.nc")
    np.testing.assert_array_equal(run.channels["theta_2"], table["theta_2"])
    np.testing.assert_allclose(run.channels["theta_1"], np.deg2rad(table["theta_1"]), rtol=1e-12)
    whole = (tmp_path / "a.nc").read_bytes()
    (tmp_path / "b.nc").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="is not a netCDF file"):
        read_recording(tmp_path / "b.nc")


def test_what_is_left_of_a_cut_file_is_refused_in_words(tmp_path):
    """Of the first there was a traceback, of the others half a sentence."""
    for reader in ("mcap", "pyuff", "nptdms"):
        pytest.importorskip(reader)
    scipy.io.savemat(tmp_path / "a.mat", {k: np.array(x) for k, x in columns(80).items()})
    whole = (tmp_path / "a.mat").read_bytes()
    parts = {"a.mat": whole[: len(whole) // 2], "b.mcap": b"", "c.uff": b"", "d.tdms": b""}
    said = {
        "a.mat": "a.mat cannot be read as .mat: could not read bytes.",
        "b.mcap": "b.mcap cannot be read as .mcap: EndOfFile.",
        "c.uff": "c.uff holds no columns of numbers.",
        "d.tdms": "d.tdms holds no columns of numbers.",
    }
    for name, content in parts.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError) as told:
            read_recording(tmp_path / name)
        assert str(told.value) == said[name]


def test_channels_of_a_uff_file_on_other_abscissas(tmp_path):
    """They were taken as at the first one's times; spectra as runs over time, ms as s."""
    pyuff = pytest.importorskip("pyuff")
    table = columns(80)
    nodes = dict.fromkeys(("rsp_node", "rsp_dir", "ref_dir", "ref_node"), 1)

    def write_uff(name, abscissa, **more):
        for column in list(table)[1:]:
            how = {"x": abscissa(column), "data": table[column], "binary": 0, "func_type": 1}
            how |= {"abscissa_spacing": 0, "ord_data_type": 4, **nodes, **more}
            full = pyuff.prepare_58(id1=column, **how, return_full_dict=True)
            full = {k: 0 if v is None else v for k, v in full.items()}
            pyuff.UFF(str(tmp_path / name)).write_sets(full, "add")
        return tmp_path / name

    slow = write_uff("a.uff", lambda c: table["t"] * (2 if c == "theta_2" else 1))
    run = read_recording(slow)
    assert [(x.column, x.kind) for x in run.faults] == [("theta_2", "time")]
    assert "theta_2" not in run.channels
    np.testing.assert_allclose(run.channels["theta_1"], table["theta_1"], rtol=1e-9)

    fine = write_uff("b.uff", lambda c: 10 * table["t"], abscissa_axis_units_lab="ms")
    np.testing.assert_allclose(read_recording(fine).time, 1e-2 * table["t"], rtol=1e-9)

    spectra = write_uff("c.uff", lambda c: table["t"], func_type=4, abscissa_spec_data_type=18)
    with pytest.raises(InputError, match=r"^c\.uff holds spectra only, no course over time\.$"):
        read_recording(spectra)

    cut = tmp_path / "d.uff"
    cut.write_bytes(fine.read_bytes()[:-300])
    assert [x.kind for x in read_recording(cut).faults] == ["cut off"]


def test_a_missing_reader_is_named_with_the_command_that_installs_it(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "nptdms", None)
    (tmp_path / "a.tdms").write_bytes(b"TDSm")
    with pytest.raises(InputError, match=r"needs `npTDMS`.*pip install 'omnijax\[measured\]'"):
        read_recording(tmp_path / "a.tdms")


def test_names_and_units_of_the_sidecar(tmp_path):
    table = columns(80)
    table["Probe 1"] = 1e3 * table.pop("dR_x")
    note = '[channels]\ndR_x = "Probe 1"\n[units]\ndR_x = "mm"\ntheta = "deg"\n'
    run = read_recording(write(tmp_path / "run.csv", table, note))
    assert run.faults == []
    np.testing.assert_allclose(run.group("dR")[:, 0], columns(80)["dR_x"], rtol=1e-7, atol=1e-15)
    np.testing.assert_allclose(run.group("theta")[:, 0], np.deg2rad(table["theta_1"]), rtol=1e-7)


def spelled(text, unit):
    """A recording whose columns have the units of a row below the header."""
    return text.replace("\n", "\n" + unit + "\n", 1)


@pytest.mark.parametrize(("unit", "factor"), [
    ("g", 9.80665), ("mg", 9.80665e-3), ("m s-2", None), ("mm s-2", 1e-3), ("[m/s2]", None),
])  # fmt: skip
def test_units_of_accelerations_as_recorders_write_them(tmp_path, unit, factor):
    """In a row of units, in NAME.toml and in an attribute alike; `g` is said."""
    import xarray

    table = {"t": STEP * np.arange(40), "torque_1": np.ones(40), "a_x": np.arange(40.0) % 7}
    text = write(tmp_path / "plain.csv", table).read_text()
    (tmp_path / "row.csv").write_text(spelled(text, f"s,N.m,{unit}"))
    bare = unit.strip("[]")
    write(tmp_path / "said.csv", table, f'[units]\na = "{bare}"\n')
    data = xarray.Dataset({k: ("t", table[k], {"units": bare} if k == "a_x" else {})
                           for k in ("torque_1", "a_x")}, {"t": table["t"]})  # fmt: skip
    data.to_netcdf(tmp_path / "attribute.nc", engine="h5netcdf")
    for name in ("row.csv", "said.csv", "attribute.nc"):
        run = read_recording(tmp_path / name)
        np.testing.assert_allclose(run.channels["a_x"], table["a_x"] * (factor or 1), rtol=1e-12)
        said = [str(f) for f in run.faults if f.column == "a_x"]
        gravity = f"is no mass; it is read as {factor:g} m/s^2" if "g" in unit else ""
        assert len(said) == bool(gravity) and all(gravity in x for x in said)


def test_units_of_speeds_and_angles_as_recorders_write_them(tmp_path):
    rows = {"rad s-1": 1.0, "degrees s-1": np.pi / 180, "dps": np.pi / 180, "1/s": 1.0, "s-1": 1.0,
            "RPM": np.pi / 30, "Hz": 2 * np.pi, "rev/s": 2 * np.pi}  # fmt: skip
    table = {"t": STEP * np.arange(40), "torque_1": np.ones(40), "Omega_x": np.arange(40.0) % 7}
    text = write(tmp_path / "plain.csv", table).read_text()
    for unit, factor in rows.items():
        (tmp_path / "row.csv").write_text(spelled(text, f"s,N-m,{unit}"))
        run = read_recording(tmp_path / "row.csv")
        assert [f for f in run.faults if f.kind == "unit"] == [], unit
        np.testing.assert_allclose(run.channels["Omega_x"], factor * table["Omega_x"], rtol=1e-9)
    for unit in ("counts", "blub"):
        (tmp_path / "row.csv").write_text(spelled(text, f"s,N m,{unit}/s"))
        (fault,) = [f for f in read_recording(tmp_path / "row.csv").faults if f.kind == "unit"]
        assert f"'{unit}/s' is not a unit of rad/s" in fault.what


def test_semicolons_decimal_commas_text_and_ragged_rows(tmp_path):
    lines = ["# logger 7", "t;torque_1;dR_x"] + [f"0,{i:02d};0,5;{i},25" for i in range(1, 9)]
    lines[4] = "0,03;0,5;oops"
    lines[6] = "0,05;0,5"
    (tmp_path / "run.csv").write_text("\n".join(lines))
    run = read_recording(tmp_path / "run.csv")
    said = "\n".join(map(str, run.faults))
    assert "column `dR_x`, row 3: 'oops' is not a number" in said
    assert "row 5: the row has 2 cells, but the header 3" in said
    np.testing.assert_allclose(run.group("dR")[[0, 7], 0], [1.25, 8.25])
    assert np.isnan(run.group("dR")[[2, 4], 0]).all()


def test_missing_values_and_infinite_ones(tmp_path):
    table = columns()
    table["dR_y"] = [f"{x:.9g}" for x in table["dR_y"]]
    table["dR_y"][99:130] = [""] * 31
    table["dR_y"][200] = "inf"
    fault = only(read_recording(write(tmp_path / "run.csv", table)), "missing")
    assert (fault.file, fault.column, fault.rows) == ("run.csv", "dR_y", ((100, 130), (201, 201)))
    assert "column `dR_y`, rows 100-130, 201: 32 of 600 values are missing (1 of them" in str(fault)


def test_a_missing_stretch_is_a_gap_in_time(tmp_path):
    table = {name: np.delete(x, slice(300, 350)) for name, x in columns().items()}
    run = read_recording(write(tmp_path / "run.csv", table))
    assert only(run, "gap").rows == ((300, 301),)
    assert "nothing was recorded from 0.598 s to 0.7 s" in str(run.faults[0])
    filled = run.filled()
    assert len(filled) == 600
    assert np.isnan(filled.group("dR")[300:350]).all()
    assert np.isfinite(filled.inputs).all()
    np.testing.assert_allclose(filled.time, columns()["t"], atol=1e-12)


def test_time_that_does_not_increase(tmp_path):
    table = columns()
    table["t"][[50, 51]] = table["t"][49]  # a repeated sample, twice
    table["t"][400] += 7.0  # one time ran ahead
    run = read_recording(write(tmp_path / "run.csv", table))
    fault = only(run, "non-increasing time")
    assert fault.rows == ((51, 52), (401, 401))
    assert len(run) == 597
    assert 400 not in run.rows - 1

    table = columns()
    table["t"][450:] -= table["t"][450]  # the logger started again
    run = read_recording(write(tmp_path / "run.csv", table))
    fault = only(run, "non-increasing time")
    assert fault.rows == ((451, 600),)
    assert "only the longest run is used, rows 1 to 450" in fault.consequence
    assert len(run) == 450

    table = columns()
    table["t"][40:] -= table["t"][40]  # it started again at once: all later rows had been lost
    table["t"][300] += 7.0
    run = read_recording(write(tmp_path / "run.csv", table))
    assert [fault.rows for fault in run.faults] == [((1, 40),), ((301, 301),)]
    np.testing.assert_array_equal(run.rows, np.delete(np.arange(41, 601), 260))


def test_the_rows_of_the_longest_run_are_found_among_glitches_and_runs():
    """A logger that starts again, coarse clocks, stamps that are damaged or missing."""
    rng, exact = drawn_anew("clocks of logs"), 0
    for _ in range(20):
        step, short = 10.0 ** rng.uniform(-4, -1), rng.integers(30, 300, rng.integers(0, 3))
        count, place = 400, rng.integers(len(short) + 1)
        parts = []
        for n in np.insert(short, place, count):
            own = step * (np.arange(n) + rng.uniform(-0.2, 0.2, n))
            parts.append(own + (parts[-1][-1] - step * 10 ** rng.uniform(1.5, 3) if parts else 0))
        time, begin = np.concatenate(parts), int(np.sum(short[:place]))
        damaged = np.zeros(len(time), bool)
        for at in 20 + begin + 40 * rng.choice(9, 3, replace=False):
            glitch = slice(at, at + rng.integers(1, GLITCH + 1))
            damaged[glitch] = True
            time[glitch] += rng.choice([-1, 1]) * step * 10 ** rng.uniform(4, 6)
        gone = rng.random(len(time)) < 0.05
        time[gone] = np.nan
        coarse = rng.choice([0, 3])  # rows that a clock shows alike
        if coarse:
            time = np.floor(time / (coarse * step)) * coarse * step
        rows, _ = ordered_rows("run.csv", time)
        good = np.flatnonzero(~gone & ~damaged)
        good = good[(good >= begin) & (good < begin + count)]
        if coarse:
            good = good[np.diff(time[good], prepend=-np.inf) > 0]
        assert np.all(np.diff(time[rows]) > 0)
        exact += np.array_equal(rows, good)
    assert exact >= 18  # glitches and runs together may be read in other ways: 4 of 1000 draws


def test_constant_clipped_and_stuck_channels(tmp_path):
    table = columns()
    table["dR_x"][:] = 1.5e-5
    run = read_recording(write(tmp_path / "a.csv", table))
    assert "constant at 1.5e-05" in only(run, "constant").what
    assert not run.mask("dR")[:, 0].any()

    table = columns()
    table["dR_z"] = np.clip(table["dR_z"], -1, 5e-5)
    run = read_recording(write(tmp_path / "b.csv", table))
    assert "clipped at 5e-05" in only(run, "clipped").what
    clipped = np.isclose(table["dR_z"], 5e-5, rtol=1e-9)
    np.testing.assert_array_equal(run.mask("dR")[:, 2], ~clipped)

    table = columns()
    table["theta_2"][300:380] = table["theta_2"][300]
    run = read_recording(write(tmp_path / "c.csv", table))
    assert only(run, "stuck").rows == ((301, 380),)
    assert np.isnan(run.group("theta")[300:380, 1]).all()


def test_a_simulated_run_may_rest_exactly(tmp_path):
    table = columns()
    for name in ("dR_x", "dR_y", "dR_z"):
        table[name] = np.zeros(600)
    note = "[noise]\ndR = 0.0\ntheta = 0.0\n"
    assert read_recording(write(tmp_path / "run.csv", table, note)).faults == []


def test_an_input_with_holes_is_bridged_and_said(tmp_path):
    table = columns()
    table["torque_1"] = np.linspace(0, 1, 600)
    table["torque_1"][10:13] = np.nan
    table["torque_1"][300:340] = np.nan
    run = read_recording(write(tmp_path / "run.csv", table))
    assert only(run, "missing").rows == ((11, 13), (301, 340))
    np.testing.assert_allclose(run.torque[:, 0], np.linspace(0, 1, 600), atol=1e-8)
    assert not run.mask("dR")[300:340].any()  # the answer to an unknown input says nothing
    assert run.mask("dR")[10:13].all()


@pytest.mark.parametrize("how", ["sidecar", "row", "netcdf"])
def test_a_slow_step_is_in_seconds_where_that_is_stated(tmp_path, how):
    """It was read as milliseconds, unless NAME.toml said so: a file's own word did not count."""
    table, path = columns(60), tmp_path / "run.csv"
    table["t"] = 0.5 / STEP * table["t"]
    if how == "netcdf":
        import xarray

        whole = {c: ("time", x, {"units": "s"} if c == "t" else {}) for c, x in table.items()}
        path = tmp_path / "run.nc"
        xarray.Dataset(whole).to_netcdf(path, engine="h5netcdf")
    else:
        write(path, table, '[units]\nt = "s"\n' if how == "sidecar" else None)
    if how == "row":
        head, values = path.read_text().split("\n", 1)
        units = {"t": "s", "torque": "N m", "theta": "rad", "dR": "m"}
        row = ",".join(units[c.split("_")[0]] for c in table)
        path.write_text(f"{head}\n{row}\n{values}")
    run = read_recording(path)
    assert run.step == pytest.approx(0.5) and run.faults == []


def test_one_cell_of_an_input_far_above_all_others_is_told_or_refused(tmp_path):
    """A torque of 1e30 N m was taken without a word."""
    rng, table = drawn_anew("far input"), columns()
    column, row = f"torque_{rng.integers(1, 4)}", int(rng.integers(250, 600))
    table[column][row - 1] = -(10.0 ** rng.uniform(3.5, 8))
    fault = only(read_recording(write(tmp_path / "run.csv", table)), "outlier")
    assert (fault.column, fault.rows) == (column, ((row, row),))
    assert f"{table[column][row - 1]:g} N m" in fault.what
    table[column][row - 1] = 10.0 ** rng.uniform(10, 300)
    with pytest.raises(InputError, match=f"run.csv, column `{column}`, row {row}: .* N m is more"):
        read_recording(write(tmp_path / "run.csv", table))


def test_unknown_columns_and_a_step_in_milliseconds(tmp_path):
    table = columns()
    table["omega_x"] = table["dR_x"]
    table["t"] = 1e3 * table["t"]
    run = read_recording(write(tmp_path / "run.csv", table))
    assert "did you mean `Omega_x`?" in str(run.faults[0])
    assert "looks like milliseconds" in str(run.faults[1])
    assert run.step == pytest.approx(STEP)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda t: t.pop("t"), "run.csv has no column `t`"),
        (lambda t: t.pop("torque_2"), "run.csv lacks the input `torque_2`"),
        (lambda t: t.update(torque_4=t["torque_1"]), "torques for 4 wheels, but the rig has 3"),
        (lambda t: t.update(torque_1=np.full(600, np.nan)), "`torque_1`: 600 of 600 values are"),
        (lambda t: t.update(t=np.zeros(600)), "column `t`: three samples at increasing times"),
    ],
)
def test_what_cannot_be_used_is_refused(tmp_path, spoil, message):
    table = columns()
    spoil(table)
    with pytest.raises(InputError, match=message):
        read_recording(write(tmp_path / "run.csv", table), machine())


@pytest.mark.parametrize(
    ("note", "message"),
    [
        ("rol = 1\n", r"`rol` is not a key of a run \(did you mean `role`\?\)"),
        ('role = "test"\n', "`role` must be train or held-out, but is 'test'"),
        ("[noise]\ndr = 1\n", r"`noise.dr` is not a column or group \(did you mean `dR`\?\)"),
        ("[noise]\ndR = -1\n", "`noise.dR` must be a 1-sigma in m, 0 or more, but is -1"),
        (
            '[units]\ndR = "kg"\n',
            "`units.dR` must be a unit of m, but is 'kg'. Units that work here",
        ),
        ("[units]\ndR = 3\n", "`units.dR` must be a unit of m, but is 3"),
        ('[units]\ntheta = "counts"\n', "but is 'counts'. How many make a turn is not known"),
        ('[units]\ntorque_w1 = "mN m"\n', r"`units.torque_w1` is not .* mean `torque_1`\?\)"),
        ("[noise]\ndR_X = 1\n", r"`noise.dR_X` is not a column or group \(.* `dR_x`\?\)"),
        ("[noise]\nforce_q = 1\ndR_1 = 2\n", r"`noise.force_q` is not (?s:.)*`noise.dR_1` is not"),
        ('[channels]\ndR_X = "dR_x"\n', r"`channels.dR_X` is not a column or group"),
        ("[noise]\ntheta_0 = 1\n", "`noise.theta_0` is not a column or group"),
        (
            "[noise]\ntheta_4 = 1\n",
            "`noise.theta_4` is not a column of run.csv, which has 3 wheels",
        ),
        ('[channels]\ndR_x = "Prob"\n', "names the column 'Prob', which run.csv does not have"),
        ("role = \n", "is not valid TOML"),
    ],
)
def test_a_wrong_sidecar_is_refused(tmp_path, note, message):
    with pytest.raises(InputError, match=message):
        read_recording(write(tmp_path / "run.csv", columns(40), note))


@pytest.mark.parametrize("content", ["", "t,torque_1\n", "1,2\n3,4\n"])
def test_a_file_without_data_is_refused(tmp_path, content):
    (tmp_path / "run.csv").write_text(content)
    with pytest.raises(InputError, match=r"run\.csv (holds no data|has no header row)"):
        read_recording(tmp_path / "run.csv")


@pytest.mark.parametrize("name", ["run.csv", "run.txt", "run.csv.gz"])
def test_a_file_that_is_no_text_is_refused_without_its_bytes(tmp_path, name):
    """The message held the bytes of the file, and the terminal rang and changed its colours."""
    raw = np.random.default_rng(0).bytes(3000).replace(b"\n", b",") + b"\n1,2\n3,4\n"
    raw = b"\x89PNG\r\n\x1a\n" + raw
    (tmp_path / name).write_bytes(gzip.compress(raw) if name.endswith("gz") else raw)
    with pytest.raises(InputError) as caught:
        read_recording(tmp_path / name)
    assert str(caught.value).endswith(f"{name}: is no text table: its bytes are those of another "
                                      "kind of file.")  # fmt: skip


def test_a_packed_file_that_was_cut_off_gives_what_it_holds(tmp_path):
    path = write(tmp_path / "run.csv.gz", columns())
    path.write_bytes(path.read_bytes()[:20000])
    run = read_recording(path)
    assert "truncated" in [fault.kind for fault in run.faults]
    assert 100 < len(run) < 600
    path.write_bytes(gzip.compress(b"x")[3:])
    with pytest.raises(InputError, match="is not a gzip file"):
        read_recording(path)


def test_faults_between_runs_and_of_the_folder(tmp_path):
    note = 'rig = "rig.toml"\n'
    write(tmp_path / "run-1.csv", columns(), note)
    slow = {name: x[::2] for name, x in columns(seed=2).items() if not name.startswith("dR")}
    write(tmp_path / "run-2.csv", slow, note + 'role = "held-out"\n')
    write(tmp_path / "run-3.csv", columns(seed=3), note)
    write(tmp_path / "run-4.csv", {"t": np.arange(9.0), "dR_x": np.arange(9.0)}, note)
    write(tmp_path / "wheel.csv", {"theta": np.arange(9.0), "rho": np.zeros(9)})
    (tmp_path / "run-9.toml").write_text(note)
    case = read_case(tmp_path, rig=machine())
    said = {(fault.file, fault.kind) for fault in case.faults}
    assert [run.name for run in case.train] == ["run-1", "run-3"]
    assert [run.name for run in case.held_out] == ["run-2"]
    assert said == {
        ("run-2.csv", "different sampling"), ("run-2.csv", "missing output"),
        ("run-4.csv", "unusable"), ("wheel.csv", "not a run"), ("run-9.toml", "no run"),
    }  # fmt: skip


def test_a_held_out_run_that_a_train_run_holds_too_confirms_nothing(tmp_path):
    """It was taken without a word, and every effect was confirmed on the data it came from."""
    note, held = 'rig = "rig.toml"\n', 'rig = "rig.toml"\nrole = "held-out"\n'
    write(tmp_path / "a.csv", columns(), note)
    other = {k: 1e3 * x if k.startswith("dR") else x for k, x in columns().items()}
    other = {k: [f"{x:.6g}" for x in values] for k, values in other.items()}
    write(tmp_path / "b.csv", other, held + 'units = { dR = "mm" }\n')  # copied, and converted
    write(tmp_path / "c.csv", {k: x[150:450] for k, x in columns().items()}, held)  # a part
    moved = {k: x[150:450] for k, x in columns().items()}
    write(tmp_path / "d.csv", moved | {"t": moved["t"] + 0.1 * STEP}, held)  # by another clock
    write(tmp_path / "e.csv", columns(seed=2), held)  # the same drive, and noise of its own
    case = read_case(tmp_path, rig=machine())
    assert [run.name for run in case.train] == ["a"]
    assert [run.name for run in case.held_out] == ["e"]
    told = [str(fault) for fault in case.faults if fault.kind == "same samples"]
    use = "holds the same samples as a.csv: it confirms nothing; the run is not used as held-out."
    assert told == [f"{name}.csv: {use}" for name in "bcd"]


@pytest.mark.parametrize("part", [(200, 500), (0, 250), (400, 600)])
def test_a_held_out_run_that_runs_on_from_a_fitted_one_confirms_nothing(tmp_path, part):
    """Only one that stands in it as a whole was noticed."""
    note, held = 'rig = "rig.toml"\n', 'rig = "rig.toml"\nrole = "held-out"\n'
    whole, (first, end) = columns(900), part
    write(tmp_path / "a.csv", {k: x[first:end] for k, x in whole.items()}, note)
    later = {k: x[300:600] for k, x in whole.items()}
    write(tmp_path / "b.csv", later | {"t": later["t"] - 7.0}, held)
    write(tmp_path / "c.csv", {k: x[450:900] for k, x in whole.items()}, held)
    case = read_case(tmp_path, rig=machine())
    shares = {name: max(0, min(end, b) - max(first, a)) / (b - a)
              for name, a, b in (("b", 300, 600), ("c", 450, 900))}  # fmt: skip
    left_out = {name: share for name, share in shares.items() if share >= LARGE}
    assert left_out.keys().isdisjoint(run.name for run in case.held_out)
    assert [str(fault) for fault in case.faults if fault.kind == "same samples"] == [
        f"{name}.csv: shares {100 * share:.0f} % of its samples with a.csv: it confirms nothing; "
        "the run is not used as held-out." for name, share in left_out.items()
    ]  # fmt: skip


def test_a_copy_of_a_fitted_run_counts_once(tmp_path):
    """It counted twice: every variance was half of what it is."""
    note = 'rig = "rig.toml"\n'
    for name, part in (("a", (100, 400)), ("b", (0, 600)), ("c", (0, 600)), ("d", (0, 0))):
        table = {k: x[slice(*part)] for k, x in columns().items()} if any(part) else columns(seed=2)
        write(tmp_path / f"{name}.csv", table, note)
    case = read_case(tmp_path, rig=machine())
    assert [run.name for run in case.runs] == ["b", "d"]
    assert [str(fault) for fault in case.faults if fault.kind == "same samples"] == [
        f"{name}.csv: holds the same samples as b.csv; the run is not used: they count once."
        for name in "ac"
    ]


def test_a_diagnosis_without_a_train_run_says_which_cannot_be_used(tmp_path):
    """It asked for a run with the role train, and that this one was left out stood nowhere."""
    table, held_out = columns(), 'rig = "rig.toml"\nrole = "held-out"\n'
    write(tmp_path / "run-1.csv", table | {"torque_1": np.full(len(table["t"]), np.nan)})
    write(tmp_path / "run-2.csv", table, held_out)
    with pytest.raises(InputError) as error:
        diagnose(read_case(tmp_path, rig=machine()))
    told, why = error.value.problems
    assert told.startswith("run-2: every run that can be used has the role `held-out`")
    assert why == (
        "run-1.csv: column `torque_1`: 600 of 600 values are missing, and inputs must be known; "
        "the run is not used."
    )


def test_a_folder_without_runs_or_rig_is_refused(tmp_path):
    with pytest.raises(InputError, match="no rig file: no run names one"):
        read_case(tmp_path)
    with pytest.raises(InputError, match="no run can be used"):
        read_case(tmp_path, rig=machine())
    (tmp_path / "run-1.toml").write_text("[noise]\ndR = 1e-6\n")
    with pytest.raises(InputError, match=r"no run can be used\.\n- run-1\.toml: the run that"):
        read_case(tmp_path, rig=machine())
    with pytest.raises(InputError, match=r"nowhere: there is no such folder\.$"):
        read_case(tmp_path / "nowhere")


WRONG_UNITS = [
    (("dR_x",), 1e3), (("dR_x", "dR_y", "dR_z"), 1e3), (("dR_z",), 1e-3),
    (("theta_2",), 180 / np.pi), (("theta_1", "theta_2", "theta_3"), 180 / np.pi),
    (("Omega_y",), 1e3), (("Omega_x", "Omega_y", "Omega_z"), 30 / np.pi), (("a_x",), 1e3),
    (("a_x", "a_y", "a_z"), 1e3), (("torque_1",), 1e3), (("torque_1", "torque_2", "torque_3"), 1e3),
    (("force_x", "force_y", "force_z"), 1e3),
]  # fmt: skip


def test_wrong_units_are_found_and_mended(tmp_path):
    from omnijax.recording._units.wrong_units import mend_units

    case = read_case(RECORDINGS / "case-03")
    faults = [fault.kind for fault in case.all_faults]
    assert faults == ["roles"]  # of one run; heavy rolling resistance is no wrong unit
    good = case.runs[0]
    for names, factor in WRONG_UNITS:
        spoilt = {c: x * (factor if c in names else 1) for c, x in good.channels.items()}
        run = Recording("run", good.path, good.time, spoilt, 3)
        mend_units(run, case.rig, set())
        assert [fault.kind for fault in run.faults] == ["unit"], (names, factor)
        size, which = (factor, "large") if factor > 1 else (1 / factor, "small")
        assert f"{size:.3g} times too {which}" in run.faults[0].what
        for column in names:
            np.testing.assert_allclose(run.channels[column], good.channels[column], rtol=1e-9)


def test_wheels_that_roll_on_without_torque_are_in_no_wrong_unit():
    """Their factors, of nothing that causes a drift, come out at any size."""
    from omnijax.recording._units.wrong_units import mend_units
    from omnijax.rig import load_rig

    rig, rng = load_rig("atlas"), drawn_anew("rolling without torque")
    axes, ratio = np.asarray(rig.wheels.spin_axis), float(rig.wheel_radius[0] / rig.sphere.radius)
    t = 4e-3 * np.arange(800)
    for _ in range(40):
        turning = rng.uniform(-0.5, 0.5, 3) + np.cumsum(rng.normal(0, 1e-5, (800, 3)), axis=0)
        torque = 10.0 ** rng.uniform(-9, -4, 3) * rng.standard_normal((800, 3))
        torque[:, rng.random(3) < 0.5] = 0.0
        turned = np.cumsum(turning @ axes.T / ratio, axis=0) * 4e-3
        values = {f"torque_{i + 1}": torque[:, i] for i in range(3)}
        values |= {f"theta_{i + 1}": turned[:, i] for i in range(3)}
        values |= {f"Omega_{c}": turning[:, i] + rng.normal(0, 1e-4, 800)
                   for i, c in enumerate("xyz")}  # fmt: skip
        values |= {f"force_{c}": np.zeros(800) for c in "xyz"}
        run = Recording("run", Path("run.csv"), t, dict(values), 3)
        mend_units(run, rig, set())
        assert run.faults == []
        assert all(run.channels[c] is x for c, x in values.items())


def test_a_group_in_a_wrong_unit_is_mended_where_a_column_is_missing():
    from omnijax.recording._units.wrong_units import mend_units

    case = read_case(RECORDINGS / "case-03")
    good = case.runs[0]
    kept = {c: x * (1e3 if c.startswith("dR") else 1) for c, x in good.channels.items()}
    del kept["dR_x"]
    run = Recording("run", good.path, good.time, kept, 3)
    mend_units(run, case.rig, set())
    assert [fault.kind for fault in run.faults] == ["unit"]
    np.testing.assert_allclose(run.channels["dR_y"], good.channels["dR_y"], rtol=1e-9)


def test_a_unit_that_the_user_states_is_kept(tmp_path):
    from omnijax.recording._units.wrong_units import mend_units

    case = read_case(RECORDINGS / "case-03")
    run = case.runs[0]
    run.channels["dR_x"] *= 1e3
    mend_units(run, case.rig, {"dR"})
    assert "it is used in the unit that NAME.toml says" in run.faults[0].consequence
    assert np.nanstd(run.channels["dR_x"]) > 1e-3


def test_a_long_recording_is_read_without_fault():
    run = read_recording(RECORDINGS / "case-09" / "run-1.csv.gz")
    assert len(run) == 6001
    assert run.faults == []


def test_every_part_of_a_packed_file_is_read(tmp_path):
    rows = ["t,torque_1", *(f"{0.002 * i!r},{i}" for i in range(900))]
    halves = ["\n".join(rows[:400]) + "\n", "\n".join(rows[400:]) + "\n"]
    packed = b"".join(gzip.compress(half.encode()) for half in halves)
    file = tmp_path / "run.csv.gz"
    file.write_bytes(packed + bytes(512))  # what a tape fills up with
    found = read_csv(file)
    assert len(found.columns["t"]) == 900 and found.faults == []
    assert found.columns["torque_1"].tolist() == list(range(900))
    file.write_bytes(packed + b"more")
    with pytest.raises(InputError, match="has 4 bytes behind its packed rows"):
        read_csv(file)


def test_the_first_line_of_excel_names_the_mark(tmp_path):
    file = tmp_path / "run.csv"
    file.write_text("sep=;\nt;torque_1\n0;1,5\n0,1;2,5\n")
    assert read_csv(file).columns["torque_1"].tolist() == [1.5, 2.5]


def test_what_unpacks_beyond_memory_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("omnijax.recording._formats.csv.available", lambda: 8e6)
    file = tmp_path / "run.csv.gz"
    file.write_bytes(gzip.compress(b"t,torque_1\n" + b"0,0\n" * 400_000))
    with pytest.raises(InputError, match=r"unpacks to more than 1 MB"):
        read_csv(file)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes in folders")
def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "run.csv")
    for file in (tmp_path / "run.csv", Path("/dev/zero")):
        with pytest.raises(InputError, match="is a pipe, a socket or a device"):
            read_csv(file)


def test_a_time_column_of_another_name_is_pointed_at(tmp_path):
    (tmp_path / "run.csv").write_text("Time,torque_1\n0,1\n1,1\n")
    with pytest.raises(InputError, match=r'run\.toml: channels = \{ t = "Time" \}'):
        read_recording(tmp_path / "run.csv")
    (tmp_path / "run.csv").write_text("stamp,torque_1\n0,1\n1,1\n")
    with pytest.raises(InputError, match="its columns are `stamp`, `torque_1`"):
        read_recording(tmp_path / "run.csv")
