"""Attacks on the commands: wrong inputs, interruptions; `python -m tests.faults` prints figures."""
