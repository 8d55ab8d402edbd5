"""Freed memory that the process keeps."""

import subprocess
import sys

import pytest

CODE = """
import resource, sys
import numpy as np
if sys.argv[1] == "kept":
    from omnijax.cli._heap import keep_freed_memory
    keep_freed_memory()
np.ones(2_000_000)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(40):
    np.ones(2_000_000)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="glibc's heap")
def test_freed_memory_is_not_cleared_again():
    faults = {
        how: int(subprocess.run([sys.executable, "-c", CODE, how], capture_output=True, text=True,
                                check=True).stdout)
        for how in ("kept", "returned")
    }  # fmt: skip
    assert faults["returned"] > 200
    assert faults["kept"] < faults["returned"] / 10
