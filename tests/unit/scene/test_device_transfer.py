"""What Dr.Jit is given: the same numbers, copied but where they have room."""

import gc

import numpy as np
import pytest

from rfgen_sionna.scene.kernels import concatenate_aligned, empty_aligned, upload
from rfgen_sionna.scene.mitsuba_backend import ensure_backend


@pytest.fixture(scope="module")
def kinds():
    ensure_backend()
    import drjit as dr
    import mitsuba as mi

    return dr.float64_array_t(mi.Float), mi.UInt32


def test_numbers_arrive_whatever_their_layout(kinds):
    real, whole = kinds
    rng = np.random.default_rng(0)
    values = rng.normal(size=(7, 5, 3))
    for given in (values, values[::2], values[:, 1:], values.T, values.astype(np.float32), values[:0]):
        assert np.array_equal(upload(real, given).numpy(), given.astype(np.float64).ravel())
    assert np.array_equal(upload(whole, np.arange(5)).numpy(), np.arange(5))


def test_what_has_room_stays_where_it_is(kinds):
    """And lives as long as Dr.Jit has it; a CUDA device has memory of its own."""
    real, _ = kinds
    given = concatenate_aligned([np.arange(300.0).reshape(100, 3), np.ones((2, 3))])
    expected = given.copy()
    there = upload(real, given)
    if ensure_backend().startswith("llvm"):
        assert there.numpy().ctypes.data == given.ctypes.data
    del given
    gc.collect()
    assert np.array_equal(there.numpy(), expected.ravel())


def test_what_has_no_room_is_copied(kinds):
    """Arrays of other makers, parts of one with room that begin elsewhere, and those of another kind."""
    real, whole = kinds
    given = empty_aligned((100, 3))
    given[...] = 1.0
    for part in (np.ones((100, 3)), given[1:], given[:, :2]):
        there = upload(real, part)
        assert there.numpy().ctypes.data != part.ctypes.data
        assert (there.numpy() == 1.0).all()
    assert (upload(whole, empty_aligned((3,), np.uint32) * 0).numpy() == 0).all()
