"""Mirror flashes: what flat faces return where they are met at right angles.

A flash fills a few pixels of an image at most, and outshines what lies around it. A small network smears it; what it
must be follows from the sketch of a place: image theory for a flat face, with the Fresnel integrals of its extent.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.special import fresnel

from rfgen_sionna.generative.environment.bricks import Place
from rfgen_sionna.generative.environment.sketch import Sketch
from rfgen_sionna.pir.view import View
from rfgen_sionna.records import SPEED_OF_LIGHT, FloatArray
from rfgen_sionna.scene.furnished.finishes import surface_material
from rfgen_sionna.tracing.diffuse import reflectance

FREQUENCY = 77e9
"""Of the data that the models learn from [Hz]."""
_NEAREST = 0.05
"""Faces nearer than this have none [m]."""


def flashes(place: Place, sketch: Sketch, view: View) -> FloatArray:
    """(row, column) energy, isotropic |gain|^2, of the flashes that a view of a place of bricks shows; 0 elsewhere.

    A face of Fresnel reflectance |Gamma|^2 and scattering coefficient S whose plane lies at the distance d returns

        (lambda / (8 pi d))^2 |Gamma|^2 (1 - S^2) |F|^2

    if the foot of the perpendicular is on it. F is the product, over its two sides, of the Fresnel integrals from one
    end to the other, 1 for a side without end.

    Args:
        place: the place.
        sketch: what `view` shows of it: what hides a foot hides its flash.
        view: in the world of the place.
    """
    found, nearest = np.zeros(view.size), np.full(view.size, np.inf)
    own = np.einsum("bij,bj->bi", place.parts.axes, np.asarray(view.position) - place.parts.centre)
    wavelength = SPEED_OF_LIGHT / FREQUENCY
    for side in range(3):
        others = [axis for axis in range(3) if axis != side]
        half = place.parts.half[:, side]
        distance = np.abs(own[:, side]) - half
        above = (np.abs(own[:, others]) <= place.parts.half[:, others]).all(axis=1)
        for brick in np.flatnonzero(above & (distance > _NEAREST) & ~place.parts.round).tolist():
            towards = -np.sign(own[brick, side]) * place.parts.axes[brick, side]
            pixel, piece = int(view.pixels(towards)), int(place.owner[brick])
            if pixel < 0 or sketch.piece.ravel()[pixel] != piece or distance[brick] > nearest[pixel]:
                continue  # of bricks of one piece the foremost hides the others
            nearest[pixel] = distance[brick]
            ends = np.stack([-place.parts.half[brick, others], place.parts.half[brick, others]]) - own[brick, others]
            sines, cosines = fresnel(2.0 / np.sqrt(wavelength * distance[brick]) * ends)
            share = np.prod(np.diff(cosines + 1j * sines, axis=0) / (1.0 + 1.0j))
            mirror = (wavelength / (8.0 * np.pi * distance[brick])) ** 2 * abs(share) ** 2
            found[pixel] = mirror * _coherent(place.finishes.get(place.kinds[piece], ""))
    return found.reshape(view.resolution)


@cache
def _coherent(finish: str) -> float:
    """(1 - S^2) |Gamma|^2 at normal incidence; 0 of what isn't known."""
    if not finish:
        return 0.0
    made_of = surface_material(finish, FREQUENCY)
    return float((1.0 - made_of.scattering_coefficient**2) * reflectance(made_of, FREQUENCY, np.ones(1))[0])
