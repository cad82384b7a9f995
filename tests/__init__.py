from testbench.blas import keep_blas_single

# Before anything loads numpy.
keep_blas_single()
