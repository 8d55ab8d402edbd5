"""`python -m omnijax`: the command line."""

from .cli import main

main()
