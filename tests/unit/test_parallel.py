"""NumPy's products on one thread, whoever asks for it."""

from threading import Barrier, Thread

from threadpoolctl import threadpool_info

from rfgen_sionna.parallel import one_blas_thread


def limits() -> list[int]:
    return [each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"]


def test_the_last_thread_to_leave_lifts_the_limit():
    """Two threads whose stays overlap: neither lifts it while the other is in, and none is left behind."""
    before, within, gate = limits(), [], Barrier(2, timeout=30)

    def first():
        with one_blas_thread():
            gate.wait()  # both are in
            gate.wait()  # the second one has left

    thread = Thread(target=first)
    thread.start()
    with one_blas_thread():
        gate.wait()
        within.append(limits())
    within.append(limits())
    gate.wait()
    thread.join()
    assert all(set(each) <= {1} for each in within)
    assert limits() == before


def test_the_limit_is_lifted_after_an_error():
    before = limits()
    try:
        with one_blas_thread():
            raise KeyError
    except KeyError:
        pass
    assert limits() == before
