"""Similarity of radar images, such as range-Doppler or range-azimuth maps: SSIM and PSNR, linear and in dB.

Linear images are dominated by their strongest cells: all else is near 0 in both, and every pair looks alike. In dB
the whole dynamic range counts. Sources: Z. Wang et al., IEEE Trans. Image Processing 13 (2004), 600; scikit-image.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from rfgen_sionna._types import FloatArray
from rfgen_sionna.evaluation.controlled_metric import ControlledMetric, with_controls

_WINDOW = 7
"""Side of the window of SSIM, scikit-image's default [pixels]."""


def compare_images(
    reference: ArrayLike,
    candidate: ArrayLike,
    controls: Mapping[str, ArrayLike],
    *,
    dynamic_range_db: float = 50.0,
) -> dict[str, ControlledMetric]:
    """SSIM and PSNR of power images: "ssim_db", "psnr_db", "ssim_linear", "psnr_linear".

    Parameters
    ----------
    reference, candidate, controls
        Powers (..., row, column) of one shape; leading axes are averaged over. Each image is relative to its own peak
        over all frames, so that a common factor does not count.
    dynamic_range_db
        Levels lower than this below the peak count as that level.

    Raises
    ------
    ValueError
        For shapes that differ or are below 7 x 7 pixels, and for powers that are negative, not finite or all 0.
    """
    if not dynamic_range_db > 0:
        raise ValueError(f"dynamic_range_db is {dynamic_range_db!r}: more than 0 dB is needed")
    first = _normalised("reference", reference)
    others = {name: _normalised(f"control {name!r}", image) for name, image in controls.items()}
    second = _normalised("candidate", candidate)
    for name, image in {"candidate": second, **others}.items():
        if image.shape != first.shape:
            raise ValueError(f"{name} has shape {image.shape}, the reference {first.shape}: one shape is needed")

    def decibels(image: FloatArray) -> FloatArray:
        return np.asarray(10 * np.log10(np.maximum(image, 10 ** (-dynamic_range_db / 10))))

    results = {}
    for scale, convert, span in (("db", decibels, dynamic_range_db), ("linear", np.asarray, 1.0)):
        images = [convert(first), convert(second)]
        against = {name: convert(image) for name, image in others.items()}
        for name, metric, unit in (("ssim", structural_similarity, ""), ("psnr", peak_signal_to_noise, "dB")):
            results[f"{name}_{scale}"] = with_controls(
                f"{name}_{scale}", partial(metric, span=span), images[0], images[1], against, unit=unit,
                higher_is_better=True,
            )  # fmt: skip
    return results


def structural_similarity(first: FloatArray, second: FloatArray, span: float) -> float:
    """Mean SSIM of images (..., row, column) with values over `span`; scikit-image, extra `evaluation`."""
    try:
        from skimage.metrics import structural_similarity as ssim
    except ImportError as error:
        raise ImportError("SSIM needs scikit-image: pip install 'rfgen-sionna[evaluation]'") from error
    pairs = zip(_stack(first), _stack(second), strict=True)
    return float(np.mean([ssim(a, b, data_range=span, win_size=_WINDOW) for a, b in pairs]))


def peak_signal_to_noise(first: FloatArray, second: FloatArray, span: float) -> float:
    """20 log10(span / rms difference) [dB] over all pixels; infinite for equal images."""
    error = float(np.mean(np.square(np.asarray(first) - np.asarray(second))))
    return float("inf") if error == 0 else float(10 * np.log10(span**2 / error))


def _stack(image: FloatArray) -> FloatArray:
    return image.reshape(-1, *image.shape[-2:])


def _normalised(name: str, image: ArrayLike) -> FloatArray:
    array = np.asarray(image, np.float64)
    if array.ndim < 2 or min(array.shape[-2:]) < _WINDOW:
        raise ValueError(f"{name} has shape {array.shape}: images of at least {_WINDOW} x {_WINDOW} pixels are needed")
    if not np.all(np.isfinite(array)) or array.min() < 0 or array.max() == 0:
        raise ValueError(f"{name} has values {array.min():.4g} … {array.max():.4g}: finite powers >= 0 are needed")
    return np.asarray(array / array.max())
