"""Linear algebra on one thread while a public function works."""

from threadpoolctl import threadpool_info, threadpool_limits

from testbench.blas import single_blas_thread


def threads() -> set[int]:
    return {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}


def test_blas_has_one_thread_inside_and_as_many_as_before_afterwards() -> None:
    with single_blas_thread():
        pass
    with threadpool_limits(2, user_api="blas"):
        with single_blas_thread(), single_blas_thread():
            assert threads() == {1}
        assert threads() == {2}
