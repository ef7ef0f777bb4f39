"""Somebody breathes before a BGT60TR13C (github.com/zharfanw/bgt60tr13c_processing). Run with `--data FOLDER`."""

from __future__ import annotations

from pathlib import Path

import pytest

from rfgen_sionna.processing import displacement
from rfgen_sionna.signal.formats import open_capture


@pytest.mark.filterwarnings("ignore:displacement. the samples lie on no clear circle")
def test_a_real_chest_is_where_it_is_and_as_quick_as_it_is(recordings: Path) -> None:
    capture = open_capture(recordings / "bgt60")
    assert (len(capture), capture.radar.name) == (256, "bgt60tr13c")
    chest = displacement(capture.cube().data, capture.radar)
    assert chest.range == pytest.approx(0.33, abs=0.01)
    assert chest.rate() == pytest.approx(0.25, abs=0.02)
    assert capture.lost == ()
