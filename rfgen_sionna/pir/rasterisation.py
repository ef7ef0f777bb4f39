"""From paths to an image: the inverse of :mod:`rfgen_sionna.pir.fusion`."""

from __future__ import annotations

import numpy as np

from rfgen_sionna._types import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.pir.view import View
from rfgen_sionna.records import PathKind, Pir, RadarPaths

INCOHERENT = (PathKind.DIFFUSE, PathKind.ENVIRONMENT)
"""Kinds of paths whose phases are random: their energies add up."""


def rasterise(paths: RadarPaths, view: View, t: float) -> Pir:
    """Energy, time of arrival and velocity per pixel of what `paths` bring at instant `t` [s].

    A path belongs to the pixel that its direction of arrival falls into. Within a pixel gains of traced paths are added
    with their phases, as the radar would, at `paths.frequency`, and energies of paths with random phase without; both
    are means over the element pairs, without the elements' patterns. Time of arrival and velocity are weighted with the
    energies of the single paths.

    Parameters
    ----------
    paths
        Traced from the view's position; what falls outside of the view is left out.
    view
        The image.
    t
        Instant [s] within the paths' knots.
    """
    now = paths.at(np.array([t]))
    pixel = view.pixels(now.arrival[:, 0])
    chosen = np.flatnonzero(pixel >= 0)
    pixel, a = pixel[chosen], now.a[:, :, chosen, 0]
    delay, rate = (values[:, :, chosen, 0].mean(axis=(0, 1)) for values in (now.tau, now.tau_rate))

    def total(weights: FloatArray) -> FloatArray:
        return np.bincount(pixel, weights=weights, minlength=view.size).astype(np.float64, copy=False)

    random = np.isin(now.kind[chosen], INCOHERENT)
    power = np.mean(np.abs(a) ** 2, axis=(0, 1))
    energy = total(np.where(random, power, 0.0))
    turned = np.where(random, 0.0, a) * np.exp(-2j * np.pi * np.mod(paths.frequency * now.tau[:, :, chosen, 0], 1.0))
    for gains in turned.reshape(-1, len(chosen)):
        energy += (total(gains.real) ** 2 + total(gains.imag) ** 2) / (a.shape[0] * a.shape[1])
    weight = total(power)
    hit = weight > 0
    arrival, velocity = np.full(view.size, np.nan), np.zeros(view.size)
    arrival[hit] = total(power * delay)[hit] / weight[hit]
    velocity[hit] = 0.5 * SPEED_OF_LIGHT * total(power * rate)[hit] / weight[hit]
    return Pir(
        energy=energy.reshape(view.resolution),
        time_of_arrival=arrival.reshape(view.resolution),
        velocity=velocity.reshape(view.resolution),
        fov_deg=view.fov_deg,
        position=view.position,
        orientation=view.orientation,
        projection=view.projection,
        time=float(t),
    )
