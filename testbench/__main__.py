"""``python -m testbench``: the command line."""

from .cli import main

main()
