"""Freed memory that the process keeps."""

import subprocess
import sys

import pytest

CODE = """
import resource, sys
import numpy as np
if sys.argv[1] == "kept":
    from omnijax.cli._console.heap import keep_freed_memory
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


GIVEN = """
import numpy as np
from omnijax.cli._console.heap import give_back_freed_memory, keep_freed_memory

def held():
    with open("/proc/self/status") as lines:
        return next(int(x.split()[1]) for x in lines if x.startswith("VmRSS")) * 1024

keep_freed_memory()
few = [np.ones(1_000_000) for _ in range(40)]
last = np.ones(1000)
del few
freed = held()
give_back_freed_memory()
print(freed - held())
"""


@pytest.mark.skipif(sys.platform != "linux", reason="glibc's heap")
def test_freed_memory_goes_back_between_stages():
    ran = subprocess.run([sys.executable, "-c", GIVEN], capture_output=True, text=True, check=True)
    assert int(ran.stdout) > 0.8 * 40 * 8_000_000
