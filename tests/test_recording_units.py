"""Wrong units beside columns that were not measured: only what is wrong is mended, and said."""

import functools

import numpy as np
import pytest
from machines import RECORDINGS
from seeds import drawn_anew

from omnijax import Case, Recording, read_case
from omnijax.recording._units.wrong_units import mend_units

Columns = dict[str, np.ndarray]


@functools.cache
def case() -> Case:
    """Three wheels, all channels, a force."""
    return read_case(RECORDINGS / "case-03")


def measured() -> Columns:
    """Columns of its first run, in SI."""
    return dict(case().runs[0].channels)


def check(true: Columns, wrong: dict[str, float], said: set[str]) -> None:
    """Columns `wrong` times too large are found, said of `said`, and are `true` again."""
    good = case().runs[0]
    run = Recording(
        "run", good.path, good.time, {c: x * wrong.get(c, 1.0) for c, x in true.items()}, 3
    )
    mend_units(run, case().rig, set())
    assert {(fault.column, fault.kind) for fault in run.faults} == {(c, "unit") for c in said}
    for column, values in run.channels.items():
        np.testing.assert_allclose(values, true[column], rtol=1e-9)


@pytest.mark.parametrize("group", ["dR", "a"])
def test_of_two_columns_the_one_in_a_wrong_unit_is_mended(group):
    """Both were: the group's RMS was too large."""
    rng, columns = drawn_anew(f"of two {group}"), measured()
    lost, wrong, _ = rng.permutation([f"{group}_{c}" for c in "xyz"])
    del columns[lost]
    check(columns, {wrong: 1e3}, {wrong})


@pytest.mark.parametrize("group", ["dR", "a"])
def test_a_quiet_column_is_in_the_unit_of_those_whose_noise_is_like_its_own(group):
    """Along an axis that hardly moves a size in mm would pass for metres."""
    rng, columns = drawn_anew(f"quiet {group}"), measured()
    names = [f"{group}_{c}" for c in "xyz"]
    quiet = rng.choice(names)
    noise = np.sqrt(np.mean(np.diff(columns[quiet][:200], 7) ** 2) / 3432)
    columns[quiet] = noise * rng.standard_normal(len(columns[quiet]))
    moving = set(names) - {quiet}
    check(columns, dict.fromkeys(names, 1e3), {group})
    check(columns, dict.fromkeys(moving, 1e3), moving)


DEGREES = 180 / np.pi
ENDS = {"dR": "xyz", "Omega": "xyz", "theta": "123", "torque": "123"}
OF = {group: [f"{group}_{end}" for end in ends] for group, ends in ENDS.items()}


@pytest.mark.parametrize(
    ("wrong", "factor", "lost"),
    [
        ("dR", 1e3, "theta"),
        ("torque", 1e3, "Omega"),
        ("torque", 1e-3, "Omega"),
        ("torque", 1e3, "Omega_z"),
        ("theta", DEGREES, "Omega"),
        ("theta", DEGREES, "Omega_z"),
        ("theta", DEGREES, "theta_2"),
        ("Omega", 1e3, "Omega_x"),
        ("Omega", DEGREES, "theta"),
    ],
)
def test_a_wrong_unit_is_told_without_the_channels_that_tell_it_best(wrong, factor, lost):
    columns = {c: x for c, x in measured().items() if c not in (lost, *OF.get(lost, ()))}
    check(columns, dict.fromkeys(set(OF[wrong]) & set(columns), factor), {wrong})
    check(columns, {}, set())


@pytest.mark.parametrize("wrong", ["theta_1", "theta_3", "Omega_y"])
def test_one_column_is_told_without_one_axis_of_omega(wrong):
    columns = measured()
    del columns["Omega_z"]
    check(columns, {wrong: DEGREES}, {wrong})


def test_empty_first_cells_hide_no_wrong_unit():
    columns = measured()
    for name in OF["theta"]:
        columns[name] = np.append(np.nan, columns[name][1:])
    check(columns, dict.fromkeys(OF["dR"], 1e3), {"dR"})
