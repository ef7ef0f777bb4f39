"""Summary of a capture as text."""

from __future__ import annotations

import numpy as np

from rfgen_sionna.signal.formats import Capture

_MOST_FILES = 3


def capture_lines(capture: Capture) -> list[tuple[str, str]]:
    """Name and text of each line on a capture: files, frames, scale, levels, losses. The samples are read once."""
    size = sum(path.stat().st_size for path in capture.paths) / 1e6
    files = ", ".join(str(path) for path in capture.paths[:_MOST_FILES])
    more = f" and {len(capture.paths) - _MOST_FILES} more" if len(capture.paths) > _MOST_FILES else ""
    radar, times = capture.radar, capture.frame_times
    step = f", one each {np.median(np.diff(times)) * 1e3:g} ms" if len(times) > 1 else ""
    shape = " × ".join(map(str, (len(capture), *radar.frame_shape)))
    used = ", ".join(path.name for path in capture.configs if path.is_file())
    rows = [
        ("capture", f"{capture.format}: {files}{more} ({size:.1f} MB)"),
        ("described by", used or "the radar given"),
        ("", f"reaches {radar.max_range:.2f} m and ±{radar.max_velocity:.2f} m/s"),
        ("ADC cube", f"{shape} (frame, chirp, tx, rx, sample) {radar.sample_type}, {len(capture)} frames{step}"),
        ("scale", "none: samples are in LSB" if capture.scale is None else f"{capture.scale:g} √W per LSB"),
        ("levels", _levels(capture)),
    ]
    lost = capture.lost
    rows.append(("lost", "nothing" if not lost else f"samples of {len(lost)} of {len(capture)} frames (zeros)"))
    rows += [("", str(loss)) for loss in lost[:10]]
    if len(lost) > 10:
        rows.append(("", f"and of {len(lost) - 10} frames more"))
    return rows


def _levels(capture: Capture) -> str:
    """Mean, root mean square and largest value [LSB] of each receiver, over all frames."""
    count = len(capture.radar.rx_names)
    sums, squares, peak = np.zeros(count, complex), np.zeros(count), 0.0
    for frame in range(len(capture)):
        samples = capture.lsb(frame)
        sums += samples.mean(axis=(0, 1, 3))
        squares += (np.abs(samples) ** 2).mean(axis=(0, 1, 3))
        peak = max(peak, float(np.abs(samples.real).max()), float(np.abs(samples.imag).max()))
    mean, rms = np.abs(sums / len(capture)), np.sqrt(squares / len(capture))
    texts = [
        f"{name} {level:.4g} (mean {offset:.3g})"
        for name, level, offset in zip(capture.radar.rx_names, rms, mean, strict=True)
    ]
    shown = ", ".join(texts[:4]) + (", …" if count > 4 else "")
    return f"rms {shown} LSB; largest value {peak:.5g}"
