"""The Doppler spectrum of an adult who only translates: what is beyond the body's own is the method's making.

As in the design: 27,420 facets, 0.58 m/s at 3 m, 77 GHz, half a second at 2 kHz, Blackman window.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal.windows import blackman

from rfgen_sionna._types import SPEED_OF_LIGHT, ComplexArray
from tests.benchmarks.errors import floor_db, slow_time
from tests.benchmarks.measuring import default_rtol, timed
from tests.benchmarks.methods import Beams, Method, Samples, Traced
from tests.benchmarks.pareto import PUBLISHED_VIEW
from tests.benchmarks.subjects import Subject, person

CHIRPS, INTERVAL, SPEED = 1000, 0.5e-3, 0.58


def walker() -> Subject:
    """The adult, as fast as in the design, moving along x."""
    subject = person(77)
    actors = tuple(replace(actor, velocity=(SPEED, 0, 0)) for actor in subject.actors)
    return replace(subject, actors=actors)


def run(
    quick: bool, seed: int, progress: Callable[[str], None]
) -> tuple[list[dict[str, Any]], dict[str, ComplexArray]]:
    """Rows, and the slow-time series for the picture."""
    subject = walker()
    times = INTERVAL * np.arange(CHIRPS)
    cases: list[Method] = [Traced(subject, default_rtol()), Samples(subject, 128, False, PUBLISHED_VIEW, seed)]
    cases.append(Samples(subject, 128, True, PUBLISHED_VIEW, seed))
    if not quick:
        cases += [Traced(subject, rtol) for rtol in (1e-2, 1e-3) if rtol != default_rtol()]
        cases += [Samples(subject, 512, False, PUBLISHED_VIEW, seed), Beams(subject, 128)]
    rows, series = [], {}
    for method in cases:
        progress(f"Doppler floor: {method.row}")
        method(0.0)
        seconds, found = timed(lambda method=method: slow_time(method, times))
        level = floor_db(found, INTERVAL, SPEED, subject.frequency)
        rows.append(method.row | {"floor_db": level, "seconds_for_all": seconds})
        key = method.row["method"] + ("" if isinstance(method, Traced) else f", {int(np.sqrt(method.row['pixels']))}²")
        series.setdefault(key, found)
    return rows, series


def draw(series: dict[str, ComplexArray], rows: list[dict[str, Any]], path: Path) -> None:
    """Two spectrograms side by side, of the same motion on the same scale."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    other = next(key for key in series if key.startswith("one sample per pixel,") and "jitter" not in key)
    floors = {"tracer": rows[0]["floor_db"], other: rows[1]["floor_db"]}
    titles = {"tracer": "this package, facets", other: f"{other} rays (60° view)"}
    figure, axes = plt.subplots(1, 2, figsize=(10, 4.2), sharey=True, constrained_layout=True)
    window, hop = blackman(128), 8
    for axis, key in zip(axes, ("tracer", other), strict=True):
        values = np.conj(series[key])
        starts = np.arange(0, len(values) - len(window) + 1, hop)
        blocks = np.stack([values[s : s + len(window)] * window for s in starts], axis=1)
        power = np.abs(np.fft.fftshift(np.fft.fft(blocks, 512, axis=0), axes=0)) ** 2
        level = 10 * np.log10(np.maximum(power / power.max(), 1e-30))
        doppler = np.fft.fftshift(np.fft.fftfreq(512, INTERVAL))
        image = axis.pcolormesh(
            (starts + 64) * INTERVAL,
            doppler,
            level,
            vmin=-100,
            vmax=0,
            cmap="magma",
            shading="nearest",
            rasterized=True,
        )
        axis.set_title(f"{titles[key]}: floor {floors[key]:.0f} dB", fontsize=10)
        axis.set_xlabel("time [s]")
    axes[0].set_ylabel("Doppler [Hz]")
    bar = figure.colorbar(image, ax=axes)
    bar.set_label("level under the peak [dB]")
    figure.suptitle(
        f"An adult who only translates, {SPEED} m/s at 3 m, 77 GHz: all but the line at "
        f"{2 * SPEED * walker().frequency / SPEED_OF_LIGHT:.0f} Hz is made by the method",
        fontsize=11,
    )
    figure.savefig(path, dpi=110)
    plt.close(figure)
