"""Ours against the usual way, both measured in one run: ``python -m benchmarks [name ...]``.

One benchmark a file: a module with a docstring and ``measure() -> Report``. Files whose name begins
with an underscore are what benchmarks share.
"""

from testbench.blas import keep_blas_single

# Before anything loads numpy.
keep_blas_single()
