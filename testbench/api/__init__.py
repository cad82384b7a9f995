"""The public functions and results, re-exported by ``testbench``: one file a task.

A function imports what it needs when it is called, so that ``import testbench`` takes a moment, and keeps
BLAS on one thread while it works, so that its results do not depend on the number of threads.
"""
