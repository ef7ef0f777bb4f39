"""Films play at the run's own speed."""

import shutil
import subprocess
from importlib.util import find_spec

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


def test_without_ffmpeg_an_mp4_becomes_a_gif_and_that_is_said(tmp_path, run_path, monkeypatch):
    monkeypatch.setattr("rfgen_sionna.show.film._ffmpeg", lambda: None)
    with pytest.warns(UserWarning, match=r"no ffmpeg found .*film.gif"):
        made = animation(run_path, tmp_path / "film.mp4", dpi=40)
    assert made == tmp_path / "film.gif"
    assert made.exists()


@pytest.mark.skipif(shutil.which("ffmpeg") is None and find_spec("imageio_ffmpeg") is None, reason="needs ffmpeg")
def test_an_mp4_is_one(tmp_path, run_path):
    made = animation(run_path, tmp_path / "film.mp4", dpi=40)
    assert made.read_bytes()[4:8] == b"ftyp"


def test_an_encoder_that_fails_leaves_nothing(tmp_path, run_path, monkeypatch):
    monkeypatch.setattr("rfgen_sionna.show.film._ffmpeg", lambda: "ffmpeg")
    failed = subprocess.CompletedProcess([], 1, stderr=b"no codec")
    monkeypatch.setattr("rfgen_sionna.show.film.subprocess.run", lambda *_, **__: failed)
    with pytest.raises(RuntimeError, match="failed: no codec"):
        animation(run_path, tmp_path / "film.mp4", dpi=40)
    assert list(tmp_path.iterdir()) == []


def test_bad_requests_are_named(tmp_path, run_path):
    with pytest.raises(ValueError, match=r"ends in '.avi'; allowed: .mp4, .gif"):
        animation(run_path, tmp_path / "film.avi")
    (tmp_path / "film.gif").write_text("precious")
    with pytest.raises(OutputError, match="exists"):
        animation(run_path, tmp_path / "film.gif")
