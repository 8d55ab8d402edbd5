"""Measured runs: reading them, saying what is wrong with them, writing them."""

from typing import TYPE_CHECKING

from .._lazy import lazy_face

if TYPE_CHECKING:
    from ._case import Case as Case
    from ._case import read_case as read_case
    from ._columns import channels as channels
    from ._columns import columns as columns
    from ._columns import group_of as group_of
    from ._columns import unit_of as unit_of
    from ._copies import Copy as Copy
    from ._copies import RunSamples as RunSamples
    from ._copies import share_in as share_in
    from ._copies import without_copies as without_copies
    from ._formats import may_be_run as may_be_run
    from ._formats import read_table as read_table
    from ._formats import stem_of as stem_of
    from ._grid import usual_step as usual_step
    from ._noise import NoiseFloor as NoiseFloor
    from ._noise import noise_floor as noise_floor
    from ._opening import at_first_sample as at_first_sample
    from ._read import read_recording as read_recording
    from ._read import rig_of_recording as rig_of_recording
    from ._recording import Fault as Fault
    from ._recording import Recording as Recording
    from ._speeds import SpeedTable as SpeedTable
    from ._speeds import speed_table as speed_table
    from ._time import ordered_rows as ordered_rows
    from ._turns import Unwound as Unwound
    from ._turns import unwound as unwound
    from ._write import check_beside as check_beside
    from ._write import files_of_recording as files_of_recording
    from ._write import write_recording as write_recording

__getattr__, __dir__ = lazy_face(__name__)
