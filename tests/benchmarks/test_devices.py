"""What the tracer finds on a CUDA device is what it finds on the CPU."""

from __future__ import annotations

import numpy as np
import pytest

from rfgen_sionna.scene.mitsuba_backend import has_cuda
from tests.benchmarks import devices


@pytest.mark.gpu
@pytest.mark.parametrize("name", ["room", "walker"])
def test_both_find_the_same_and_later_frames_are_quick(name: str) -> None:
    """Samples within a third of the tolerance: rays past edges fall on either side. No rays are lost where static and
    moving scenes are both asked (:func:`devices.run` raises), nothing is compiled in a second walk, memory stays."""
    if not has_cuda():
        pytest.fail("this test was asked for by -m gpu, but there is no CUDA device")
    found = devices.compare(name)
    assert max(found["samples_differ"].values()) < devices.RTOL / 3
    for side in ("cuda", "cpu"):
        seconds = found[side]["seconds"]
        assert found[side]["compiled_in_second_walk"] == 0
        assert np.median(seconds["frames again"]) < 0.5 * seconds["frames first"][0]
    assert found["cuda"]["grown_mb"] < 64
