"""Speed and accuracy beside other tools, in one run on one core: `python -m benchmarks`."""
