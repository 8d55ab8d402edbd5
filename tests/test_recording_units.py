"""Wrong units beside columns that were not measured: only what is wrong is mended, and said."""

import functools

import numpy as np
import pytest
from machines import RECORDINGS
from seeds import drawn_anew

from omnijax import Case, Recording, read_case
from omnijax.recording._scales import mend_units

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
