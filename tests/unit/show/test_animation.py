"""Films play at the run's own speed."""

import numpy as np
import pytest
from PIL import Image

from rfgen_sionna.dataset import OutputError
from rfgen_sionna.show import animation


def test_a_gif_has_every_frame_at_its_time(tmp_path, run_path):
    seen = []
    made = animation(run_path, tmp_path / "film.gif", dpi=40, progress=lambda done, all_: seen.append((done, all_)))
    assert made == tmp_path / "film.gif"
    with Image.open(made) as film:
        assert film.n_frames == 4
        assert film.info["duration"] == 100
        first = np.asarray(film.convert("RGB"), int)
        film.seek(3)
        assert np.abs(np.asarray(film.convert("RGB"), int) - first).max() > 50, "the pictures differ"
    assert seen == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert list(tmp_path.iterdir()) == [made]


def test_bad_requests_are_named(tmp_path, run_path):
    with pytest.raises(ValueError, match=r"ends in '.avi'; allowed: .gif"):
        animation(run_path, tmp_path / "film.avi")
    (tmp_path / "film.gif").write_text("precious")
    with pytest.raises(OutputError, match="exists"):
        animation(run_path, tmp_path / "film.gif")
