"""Ours against the direct sum, in NumPy and in torch, on one frame of 12 channels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from rfgen_sionna._types import ComplexArray
from rfgen_sionna.records import RadarPaths
from tests.benchmarks import synthesis
from tests.benchmarks.measuring import timed


def torch_direct(radar: Any, paths: RadarPaths, parts: list[tuple[int, int, int]]) -> ComplexArray:
    """(part, sample) as :func:`tests.benchmarks.synthesis.direct`, in torch's complex128 on all cores."""
    import torch

    wave = radar.waveform
    t = torch.from_numpy(np.ascontiguousarray(wave.sample_times))
    found = []
    for chirp, tx, rx in parts:
        tau_0 = torch.from_numpy(np.ascontiguousarray(paths.tau[tx, rx]))
        rate = torch.from_numpy(np.ascontiguousarray(paths.tau_rate[tx, rx]))
        tau = tau_0 + rate * (wave.chirp_times[chirp, tx] + t - paths.times[0])
        cycles = tau * (wave.start_frequency + wave.slope * t - 0.5 * wave.slope * tau)
        cycles -= torch.round(cycles)
        gain = torch.from_numpy(np.conj(paths.a[tx, rx, :, 0]))
        found.append((gain @ torch.polar(torch.ones_like(cycles), 2 * np.pi * cycles)).numpy())
    return np.array(found)


def run(quick: bool, progress: Callable[[str], None]) -> dict[str, Any]:
    """Times of a whole frame, measured side by side; the direct sums on a share of its chirps and scaled."""
    radar, paths = synthesis.frame("awr1843", "mmmesh", "people")
    loops, tx, rx, _ = radar.frame_shape
    parts = synthesis.some_parts(radar, 8 if quick else 24)
    scale = loops * tx * rx / len(parts)
    progress("synthesiser: direct sums")
    numpy_seconds, truth = timed(lambda: synthesis.direct(radar, paths, parts))
    rows: list[dict[str, Any]] = [
        {"method": "direct sum, NumPy", "seconds": scale * numpy_seconds, "relative": 0.0, "measured_share": 1 / scale}
    ]
    try:
        torch_direct(radar, paths, parts[:1])
        torch_seconds, found = timed(lambda: torch_direct(radar, paths, parts))
        error = float(np.linalg.norm(found - truth) / np.linalg.norm(truth))
        rows.append({
            "method": "direct sum, torch", "seconds": scale * torch_seconds, "relative": error,
            "measured_share": 1 / scale,
        })  # fmt: skip
    except ImportError:
        progress("synthesiser: torch is not installed, its direct sum is left out")
    for eps in (1e-3, 1e-6) if quick else (1e-2, 1e-3, 1e-4, 1e-6, 1e-8):
        progress(f"synthesiser: ours at {eps:g}")

        def ours(eps: float = eps) -> ComplexArray:
            return synthesis.synthesize(radar, paths, 0.0, eps=eps, device="cpu")

        ours()
        trials = [timed(ours) for _ in range(2 if quick else 3)]
        found = np.array([trials[0][1][part] for part in parts])
        error = float(np.linalg.norm(found - truth) / np.linalg.norm(truth))
        rows.append({"method": "ours", "eps": eps, "seconds": min(each for each, _ in trials), "relative": error})
    return {"paths": paths.num_paths, "frame": list(radar.frame_shape), "rows": rows}
