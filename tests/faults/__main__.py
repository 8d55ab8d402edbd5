"""`python -m tests.faults [NUMBER]`: attack the commands and print the figures."""

import sys
import tempfile
from pathlib import Path

from tests.faults.inputs import attack, cases, prepare


def main() -> int:
    """All attacks, or NUMBER of them."""
    chosen = cases(int(sys.argv[1]) if len(sys.argv) > 1 else None)
    with tempfile.TemporaryDirectory() as folder:
        prepare(Path(folder))
        wrong = [(case, said) for case in chosen if (said := attack(case)) is not None]
    for case, said in wrong:
        print(f"{case.name}: {said}")
    print(f"wrong inputs: {len(chosen) - len(wrong)} of {len(chosen)} right")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
