"""Detection in range-Doppler maps: CFAR thresholds, peaks, positions between bins.

Maps have the axes (range, velocity); the Doppler axis is periodic, the range axis is mirrored at its ends. Thresholds
are exact for independent cells of complex Gaussian noise, power-averaged over `looks` channels; a window or zero
padding correlates neighbouring cells and raises the false alarm rate. Sources: H. Finn and R. Johnson, RCA Review 29
(1968), 414 (cell averaging); H. Rohling, IEEE Trans. AES-19 (1983), 608 (ordered statistics).
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import gammaincinv
from scipy.stats import beta, f, gamma

from rfgen_sionna._types import FloatArray

_MODES = ("mirror", "wrap")


def cfar(
    power: ArrayLike,
    *,
    method: str = "ca",
    false_alarm: float = 1e-5,
    guard: tuple[int, int] = (2, 2),
    train: tuple[int, int] = (8, 8),
    looks: int = 1,
    rank: float = 0.75,
) -> tuple[NDArray[np.bool_], FloatArray]:
    """Constant-false-alarm-rate detection on a power map (range, velocity).

    Parameters
    ----------
    power
        (range, velocity), not in dB.
    method
        "ca" averages the training cells; "os" takes their quantile `rank`: slower, and robust to strong neighbours.
    false_alarm
        Probability per cell, 0 … 0.5.
    guard, train
        Guard and training cells on either side of the cell under test, along (range, velocity).
    looks
        Number of independent channels in the average of powers.
    rank
        Quantile for "os".

    Returns
    -------
    detected, noise
        (range, velocity) whether a cell exceeds its threshold, and the estimated mean noise power around it.

    Raises
    ------
    ValueError
        Naming the argument, its value and the allowed values.
    """
    array = np.asarray(power, np.float64)
    if array.ndim != 2 or array.size == 0 or not np.all(np.isfinite(array)) or array.min() < 0:
        raise ValueError(f"power has shape {array.shape}: a finite map (range, velocity) of powers >= 0 is needed")
    if not 0 < false_alarm <= 0.5:
        raise ValueError(f"false_alarm is {false_alarm!r}: a probability in 0 … 0.5 is needed")
    if min(guard) < 0 or min(train) < 0 or max(train) == 0 or looks < 1:
        raise ValueError(f"guard {guard}, train {train}, looks {looks}: guard >= 0, some training cells, looks >= 1")
    inner = tuple(2 * g + 1 for g in guard)
    outer = tuple(2 * (g + t) + 1 for g, t in zip(guard, train, strict=True))
    if any(size > length for size, length in zip(outer, array.shape, strict=True)):
        raise ValueError(f"guard {guard} and train {train} span {outer} cells; the map has {array.shape}")
    cells = outer[0] * outer[1] - inner[0] * inner[1]
    if method == "ca":
        whole = ndimage.uniform_filter(array, outer, mode=_MODES) * (outer[0] * outer[1])
        middle = ndimage.uniform_filter(array, inner, mode=_MODES) * (inner[0] * inner[1])
        # The running sums cancel to about 1e-16 of the strongest cell.
        noise = np.maximum((whole - middle) / cells, np.finfo(float).eps * array.max())
        return array > ca_factor(false_alarm, cells, looks) * noise, noise
    if method == "os":
        if not 0 < rank < 1:
            raise ValueError(f"rank is {rank!r}: a quantile between 0 and 1 is needed")
        order = min(cells, max(1, round(rank * cells)))
        ring = np.ones(outer, bool)
        ring[train[0] : outer[0] - train[0], train[1] : outer[1] - train[1]] = False
        # Rank filters take one mode for all axes: the map is padded first.
        (up, side) = (outer[0] // 2, outer[1] // 2)
        padded = np.pad(np.pad(array, ((up, up), (0, 0)), "reflect"), ((0, 0), (side, side)), "wrap")
        level = ndimage.rank_filter(padded, order - 1, footprint=ring)
        level = level[up : up + array.shape[0], side : side + array.shape[1]]
        # Quantile of averaged noise as a share of its mean.
        share = float(gammaincinv(looks, order / (cells + 1))) / looks
        return array > os_factor(false_alarm, cells, order, looks) * level, level / share
    raise ValueError(f"method is {method!r}; allowed: 'ca', 'os'")


@cache
def ca_factor(false_alarm: float, cells: int, looks: int = 1) -> float:
    """Threshold over the mean of `cells` training cells: the ratio of two gamma variables is F distributed."""
    return float(f.isf(false_alarm, 2 * looks, 2 * looks * cells))


@cache
def os_factor(false_alarm: float, cells: int, order: int, looks: int = 1) -> float:
    """Threshold over the `order`-th smallest (from 1) of `cells` training cells."""

    def excess(log_factor: float) -> float:
        # The order statistic of uniform numbers is beta distributed; gamma.ppf maps it to powers.
        def integrand(u: float) -> float:
            level = gamma.ppf(u, looks, scale=1 / looks)
            passing = gamma.sf(np.exp(log_factor) * level, looks, scale=1 / looks)
            return float(beta.pdf(u, order, cells + 1 - order) * passing)

        mode = order / (cells + 1)
        value, _ = quad(integrand, 0, 1, points=[mode], limit=200, epsabs=0, epsrel=1e-6)
        return float(np.log(max(value, np.finfo(float).tiny)) - np.log(false_alarm))

    return float(np.exp(brentq(excess, -3.0, 12.0, xtol=1e-6)))


def local_maxima(power: ArrayLike, *, size: tuple[int, int] = (3, 3)) -> NDArray[np.bool_]:
    """(range, velocity) cells that no neighbour within the box `size` exceeds."""
    array = np.asarray(power)
    return np.asarray(array >= ndimage.maximum_filter(array, size=size, mode=_MODES))


def refine_peaks(power: ArrayLike, cells: NDArray[np.integer]) -> tuple[FloatArray, FloatArray]:
    """Positions between bins by a parabola through the levels in dB along each axis.

    Parameters
    ----------
    power
        (range, velocity) map.
    cells
        (n, 2) indices of local maxima.

    Returns
    -------
    position, peak
        (n, 2) fractional indices, at most half a bin off the cells, and (n,) the power there.
    """
    array = np.asarray(power, np.float64)
    log = np.log(np.maximum(array, np.finfo(float).tiny))
    rows, columns = array.shape
    cells = np.asarray(cells)
    i, j = cells[:, 0], cells[:, 1]
    centre = log[i, j]
    position = cells.astype(np.float64)
    peak = centre.copy()
    for axis, (low, high) in enumerate(
        (
            (log[np.abs(i - 1), j], log[np.where(i + 1 < rows, i + 1, rows - 2), j]),
            (log[i, (j - 1) % columns], log[i, (j + 1) % columns]),
        )
    ):
        curvature = low - 2 * centre + high
        slope = (high - low) / 2
        shift = np.where(curvature < 0, np.clip(-slope / np.where(curvature < 0, curvature, -1.0), -0.5, 0.5), 0.0)
        position[:, axis] += shift
        peak += slope * shift + 0.5 * curvature * shift**2
    return position, np.exp(peak)
