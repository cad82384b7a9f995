"""Identification of robot dynamics: arrays in, arrays out. No files, no stepping, no printing."""

import os

from .numba_cache import keep_kernels

# Sums of a threaded BLAS depend on the number of threads, and small problems run faster on one.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

keep_kernels()
