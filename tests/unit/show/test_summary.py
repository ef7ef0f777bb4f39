"""A run in words."""

from rfgen_sionna.show import summary


def test_the_summary_says_what_the_file_holds(run_path, run):
    text = summary(run_path)
    for part in (
        "a ball rolling away",
        "an empty hall",
        "awr1843 · mmmesh",
        "4 × 32 × 3 × 4 × 128 (frame, chirp, tx, rx, sample) complex64, 4 frames, one each 100 ms",
        "24 × 24 pixels, 70° × 70°",
        "ball: metal, 642 vertices, 1280 faces",
        "radial_velocity (frame, actor) [m s-1] 0.8 … 0.8",
        "action (frame, actor) rolling",
        "noise 1",
        "numpy ",
        "at (0, 0, 1) m",
    ):
        assert part in text
    assert summary(run) == text
