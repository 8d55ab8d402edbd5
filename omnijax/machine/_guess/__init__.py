"""Guesses of what a stranger's log holds."""

from .described import Guess as Guess
from .guess import guess as guess
from .load import of_one_machine as of_one_machine
